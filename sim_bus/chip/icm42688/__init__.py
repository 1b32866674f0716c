"""The simulated ICM-42688-P."""
