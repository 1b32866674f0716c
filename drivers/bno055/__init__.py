"""The BNO055: registers, how to reach them over I2C or UART, and the chip as a device."""
