"""What Foxglove draws, derived from the records."""
