"""Adafruit's CircuitPython driver, unmodified, on a serial port: prints a few rates, rad/s."""

import json
import sys
import time

import adafruit_bno055
import serial

sensor = adafruit_bno055.BNO055_UART(serial.Serial(sys.argv[1], 115200, timeout=0.5))
found = []
while len(found) < 20:
    time.sleep(0.02)
    try:
        found.append(sensor.gyro)
    except RuntimeError as error:  # the chip's overrun: the driver leaves the repetition to us
        print(error, file=sys.stderr)
        time.sleep(0.05)
print(json.dumps(found))
