"""Drivers that others wrote, unmodified, read sane rates from our simulated chip."""

import json
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from drivers.clock import SteadyClock
from sim_bus.bench.cuse_i2c import CuseI2cBus
from sim_bus.bench.i2c_adapter import transfer_on
from sim_bus.bench.pty_uart import PtyUart
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.i2c import SimI2cBus, Wired
from sim_bus.buses.uart import SimSerialPort

FOLDER = Path(__file__).with_name("foreign")
# Sixteen counts a degree a second, and a chip that knows its own zero only so well.
TOLERANCE_RAD_S = 0.02
# The older driver divides by 900 what the chip gives in 16 counts a degree a second.
SCALES = {"legacy.py": 16 * np.degrees(1) / 900}

foreign = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("adafruit_bno055", "Adafruit_BNO055")),
    reason="third-party drivers are not installed: pip install wing-avionics[foreign]",
)


@pytest.fixture
def bus(make_chip) -> Iterator[int]:
    line = SimI2cBus(SteadyClock(), {(None, 0, 0x28): Wired(make_chip(), "pod 0")}, byte_ns=25_000)
    node = CuseI2cBus(17, transfer_on(line))
    node.start()
    yield 17
    node.close()


@pytest.fixture
def port(make_chip) -> Iterator[str]:
    clock = SteadyClock()
    line = PtyUart(SimSerialPort(make_chip(), clock, faults=FaultPlan(), overruns=False), clock)
    yield line.path
    line.close()


def rates(script: str, place: object) -> np.ndarray:
    done = subprocess.run(
        [sys.executable, "-W", "ignore", str(FOLDER / script), str(place)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return np.array(json.loads(done.stdout))


def assert_sane(found: np.ndarray, script: str, rate_rad_s: np.ndarray) -> None:
    assert found.shape == (20, 3)
    wanted = rate_rad_s * SCALES.get(script, 1.0)
    assert np.abs(found - wanted).max() < TOLERANCE_RAD_S, found


@foreign
@pytest.mark.uml
@pytest.mark.parametrize("script", ["circuitpython_i2c.py", "legacy.py"])
def test_third_party_driver_over_i2c(bus: int, script: str, rate_rad_s) -> None:
    assert_sane(rates(script, bus), script, rate_rad_s)


@foreign
@pytest.mark.parametrize("script", ["circuitpython_uart.py", "legacy.py"])
def test_third_party_driver_over_uart(port: str, script: str, rate_rad_s) -> None:
    assert_sane(rates(script, port), script, rate_rad_s)


@pytest.mark.uml
def test_i2c_tools_read_the_chip(bus: int) -> None:
    def tool(*words: str) -> str:
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout

    found = tool("i2cdetect", "-y", str(bus))
    assert found.split("20:")[1].split("\n")[0].split()[8] == "28"
    ids = [tool("i2cget", "-y", str(bus), "0x28", f"0x{register:02x}") for register in range(4)]
    assert [word.strip() for word in ids] == ["0xa0", "0xfb", "0x32", "0x0f"]
    tool("i2cset", "-y", str(bus), "0x28", "0x3d", "0x03")
    assert tool("i2cget", "-y", str(bus), "0x28", "0x3d").strip() == "0x03"
