"""Adafruit's CircuitPython driver, unmodified, on /dev/i2c-N: prints a few rates, rad/s."""

import json
import sys
import time

import adafruit_bno055
from adafruit_extended_bus import ExtendedI2C

sensor = adafruit_bno055.BNO055_I2C(ExtendedI2C(int(sys.argv[1])))
found = []
for _ in range(20):
    time.sleep(0.02)
    found.append(sensor.gyro)
print(json.dumps(found))
