"""The ELFs, built once a session; the helpers beside this file."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
FIRMWARE = HERE.parents[1] / "firmware"
sys.path.insert(0, str(HERE))  # importlib mode leaves it out, and the helpers are no package


def _built(name: str) -> Path:
    if shutil.which("arm-none-eabi-gcc") is None or shutil.which("make") is None:
        pytest.skip("no ARM compiler: apt install gcc-arm-none-eabi libnewlib-arm-none-eabi make")
    command = ["make", "-s", "-C", str(FIRMWARE), f"PYTHON={sys.executable}", f"build/{name}.elf"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={**os.environ, "MAKEFLAGS": ""}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return FIRMWARE / "build" / f"{name}.elf"


@pytest.fixture(scope="session")
def flight_elf() -> Path:
    """BNO055 on I2C, bxCAN."""
    return _built("flight")


@pytest.fixture(scope="session")
def serial_elf() -> Path:
    """BNO055 on a UART, SLCAN."""
    return _built("serial")
