"""Opening a chip select: what is set, what is said when it fails, a node that comes back."""

import errno
import os
import sys
import types
from typing import ClassVar

import pytest

from drivers.errors import BusError, BusTimeoutError, DeviceNotFoundError
from drivers.icm42688.spi_port import SpiRegisterPort
from drivers.spi import open_spi


class FakeSpiDev:
    """Behaves as ``spidev.SpiDev`` does; fails as it is told."""

    opened: ClassVar[list["FakeSpiDev"]] = []
    open_errors: ClassVar[list[int]] = []

    def __init__(self) -> None:
        self.transfer_errors: list[int] = []
        self.is_open = False
        self.mode = self.max_speed_hz = 0

    def open(self, bus: int, device: int) -> None:
        if self.open_errors:
            number = self.open_errors.pop(0)
            raise OSError(number, os.strerror(number))
        self.place, self.is_open = (bus, device), True
        self.opened.append(self)

    def xfer2(self, values):
        if self.transfer_errors:
            number = self.transfer_errors.pop(0)
            raise OSError(number, os.strerror(number))
        return [0, *[0x47] * (len(values) - 1)]

    def close(self) -> None:
        self.is_open = False


@pytest.fixture
def spidev(monkeypatch):
    module = types.ModuleType("spidev")
    module.SpiDev = FakeSpiDev
    monkeypatch.setitem(sys.modules, "spidev", module)
    monkeypatch.setattr(FakeSpiDev, "opened", [])
    monkeypatch.setattr(FakeSpiDev, "open_errors", [])
    return FakeSpiDev


def test_bus_speed_and_mode_are_set(spidev) -> None:
    line = open_spi(1, 2, speed_hz=8_000_000, mode=3)
    (one,) = spidev.opened
    assert (one.place, one.max_speed_hz, one.mode) == ((1, 2), 8_000_000, 3)
    assert SpiRegisterPort(line).read(0x75, 1) == b"\x47"
    line.close()
    line.close()
    assert not one.is_open


def test_missing_package_is_named_with_its_command(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "spidev", None)
    with pytest.raises(DeviceNotFoundError, match=r"pip install 'wing-avionics\[spi\]'"):
        open_spi(0, 0, speed_hz=1_000_000, mode=0)


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (errno.ENOENT, r"/dev/spidev0\.1 does not exist; enable SPI on this board"),
        (errno.EACCES, r"no permission for /dev/spidev0\.1; add the user to the group spi"),
        (errno.EBUSY, r"/dev/spidev0\.1 does not open: .* \(errno 16\)"),
    ],
)
def test_node_that_does_not_open_is_named_with_a_remedy(spidev, number, message) -> None:
    spidev.open_errors.append(number)
    with pytest.raises(DeviceNotFoundError, match=message):
        open_spi(0, 1, speed_hz=1_000_000, mode=0)


def test_node_that_vanished_is_opened_again(spidev) -> None:
    line = open_spi(0, 0, speed_hz=1_000_000, mode=0)
    port = SpiRegisterPort(line)
    spidev.opened[0].transfer_errors.append(errno.ESHUTDOWN)
    spidev.open_errors.append(errno.ENOENT)
    for _ in range(2):
        with pytest.raises(BusError, match="read of register 0x75 over SPI"):
            port.read(0x75, 1)
    assert port.read(0x75, 1) == b"\x47"
    assert line.reopened == 1
    assert port.counters == {"spi_io": 2}
    assert not spidev.opened[0].is_open


def test_failed_transfer_leaves_the_node_open(spidev) -> None:
    line = open_spi(0, 0, speed_hz=1_000_000, mode=0)
    port = SpiRegisterPort(line)
    spidev.opened[0].transfer_errors += [errno.EIO, errno.ETIMEDOUT]
    with pytest.raises(BusError, match=r"Input/output error \(errno 5\)"):
        port.read(0x75, 1)
    with pytest.raises(BusTimeoutError, match="write of register 0x11 over SPI"):
        port.write(0x11, b"\x01")
    assert line.reopened == 0
    assert port.counters == {"spi_io": 1, "spi_timeout": 1}


def test_port_writes_one_byte_a_transfer(spidev, monkeypatch) -> None:
    line = open_spi(0, 0, speed_hz=1_000_000, mode=0)
    sent = []
    monkeypatch.setattr(FakeSpiDev, "xfer2", lambda _, values: sent.append(values) or values)
    SpiRegisterPort(line).write(0x4F, b"\x06\x07")
    assert sent == [[0x4F, 0x06], [0x50, 0x07]]
