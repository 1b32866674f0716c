"""Simulated I2C, UART and CAN buses, and the pods and faults on them."""
