"""A flight: from the configured links to estimates, live or in lockstep."""
