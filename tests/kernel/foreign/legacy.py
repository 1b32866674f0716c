"""Adafruit's older Raspberry Pi driver, unmodified, on I2C or a serial port: prints its rates.

It says degrees a second, divides by the 900 counts of a radian a second, and leaves the chip at 16
counts a degree a second: what it gives is radians a second, 1.9 % too large.
"""

import json
import sys
import time

from Adafruit_BNO055 import BNO055

place = sys.argv[1]
sensor = BNO055.BNO055(busnum=int(place)) if place.isdigit() else BNO055.BNO055(serial_port=place)
assert sensor.begin()
status, self_test, error = sensor.get_system_status(run_self_test=False)
assert error == 0, (status, self_test, error)
found = []
for _ in range(20):
    time.sleep(0.02)
    found.append(sensor.read_gyroscope())
print(json.dumps(found))
