"""The report of a flight: one self-contained page."""
