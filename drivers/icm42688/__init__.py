"""ICM-42688-P, six-axis IMU, over SPI and I2C: registers, bring-up, burst reads, screening."""
