"""Hardware in, samples out. Knows nothing of the application above it."""
