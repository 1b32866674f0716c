"""The simulated wing: a nonlinear beam, what loads it and what its stations feel."""
