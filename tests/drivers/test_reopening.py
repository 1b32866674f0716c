"""GIVEN a bus whose node vanishes WHEN it returns THEN the samples do, without a new start."""

import errno
import os
import tty
from functools import partial
from pathlib import Path

import pytest
import serial

from drivers.bno055.device import Bno055
from drivers.bno055.settings import Settings
from drivers.i2c_registers import I2cRegisterPort
from drivers.polled_imus import PolledImus
from drivers.reopening import ReopeningI2cBus, ReopeningSerial
from tests.drivers.wing_bench import make_bench


class Adapter:
    """A USB adapter: pulled out, its open files are dead for good and its node is not there."""

    def __init__(self, bus) -> None:
        self.bus, self.is_there, self.generation = bus, True, 0

    def open(self) -> "OpenNode":
        if not self.is_there:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), "/dev/i2c-9")
        self.generation += 1
        return OpenNode(self, self.generation)

    def pull_out(self) -> None:
        self.is_there, self.generation = False, self.generation + 1


class OpenNode:
    def __init__(self, adapter: Adapter, generation: int) -> None:
        self._adapter, self._generation, self.is_open = adapter, generation, True

    def _check(self) -> None:
        assert self.is_open
        if self._generation != self._adapter.generation:
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))

    def read_i2c_block_data(self, i2c_addr, register, length):
        self._check()
        return self._adapter.bus.read_i2c_block_data(i2c_addr, register, length)

    def write_i2c_block_data(self, i2c_addr, register, data):
        self._check()
        self._adapter.bus.write_i2c_block_data(i2c_addr, register, data)

    def close(self) -> None:
        self.is_open = False


def test_i2c_adapter_pulled_out_and_put_in_again() -> None:
    bench = make_bench("i2c")
    adapter = Adapter(bench.imus._bus)
    bus = ReopeningI2cBus(adapter.open)
    chip = Bno055(I2cRegisterPort(bus, 0x28), bench.clock, pod="0", settings=Settings())
    bench.imus = PolledImus([chip], bench.clock, bus=bus)
    bench.imus.open()
    assert len(bench.fly(1.0)) > 95
    adapter.pull_out()
    assert len(bench.fly(1.0)) <= 2
    adapter.is_there = True
    bench.fly(1.5)
    assert len(bench.fly(1.0)) > 95
    assert bench.count("bus_reopened") == 1
    told = [event.message for event in bench.imus.take_events()]
    assert any("bringing it up again" in message for message in told)
    assert told[-1] == f"is up; chip {bench.chips[0].unique_id.hex()}"
    bench.imus.close()


def test_a_nak_does_not_close_the_node() -> None:
    bench = make_bench("i2c")
    adapter = Adapter(bench.imus._bus)
    bus = ReopeningI2cBus(adapter.open)
    with pytest.raises(OSError, match=r"121|Remote I/O"):
        bus.read_i2c_block_data(0x40, 0, 1)
    assert bus.read_i2c_block_data(0x28, 0, 1) == [0xA0]
    assert (bus.reopened, adapter.generation) == (0, 1)


def test_an_adapter_that_is_not_there_at_first_says_so() -> None:
    adapter = Adapter(None)
    adapter.is_there = False
    with pytest.raises(FileNotFoundError):
        ReopeningI2cBus(adapter.open)


def test_serial_line_hangs_up_and_returns(tmp_path: Path) -> None:
    link = tmp_path / "ttyUSB0"

    def plug() -> int:
        master, slave = os.openpty()
        for end in (master, slave):
            tty.setraw(end)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(slave))
        os.close(slave)
        return master

    master = plug()
    line = ReopeningSerial(partial(serial.Serial, str(link), 115200, timeout=0.5))
    line.timeout = 0.2
    line.write(b"ab")
    assert os.read(master, 8) == b"ab"
    os.close(master)
    with pytest.raises(OSError, match=r".+"):
        line.read(1)
    link.unlink()
    with pytest.raises(OSError, match=r".+"):
        line.read(1)
    master = plug()
    line.write(b"cd")
    assert os.read(master, 8) == b"cd"
    os.write(master, b"ef")
    assert line.read(2) == b"ef"
    assert (line.timeout, line.reopened) == (0.2, 1)
    line.close()
    os.close(master)
