"""The simulated BNO055."""
