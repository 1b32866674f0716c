"""Our driver meets what is no BNO055: it says so and leaves the thing as it was."""

import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from smbus2 import SMBus

from avionics.config import Pod
from avionics.config.links import I2cLink
from drivers.errors import DeviceNotFoundError, DriverError
from sim_bus.bench.cuse_i2c import CuseI2cBus, I2cMessage
from tests.opening import open_imus

pytestmark = pytest.mark.uml

IDS = (0xA0, 0xFB, 0x32, 0x0F)
STUB = "kernel/drivers/i2c/i2c-stub.ko"


def open_pod(bus: int) -> None:
    pod = Pod(id=0, s_m=0.5, link=I2cLink(bus=bus, address=0x28))
    open_imus([pod]).close()


@pytest.fixture
def stub() -> Iterator[int]:
    """The kernel's own I2C stub: a memory that answers SMBus commands."""
    release = subprocess.run(["uname", "-r"], capture_output=True, text=True, check=True).stdout
    module = Path("/usr/lib/uml/modules") / release.strip() / STUB
    before = set(Path("/dev").glob("i2c-*"))
    done = subprocess.run(
        ["insmod", str(module), "chip_addr=0x28"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (node,) = set(Path("/dev").glob("i2c-*")) - before
    yield int(node.name.removeprefix("i2c-"))
    subprocess.run(["rmmod", "i2c_stub"], check=False, capture_output=True)


def memory(bus: int) -> list[int]:
    with SMBus(bus) as client:
        return [client.read_byte_data(0x28, register) for register in range(128)]


def test_empty_stub_is_refused_and_untouched(stub: int) -> None:
    with pytest.raises(DeviceNotFoundError, match="0x00"):
        open_pod(stub)
    assert memory(stub) == [0] * 128


def test_stub_with_our_chip_id_does_not_pass_for_a_chip(stub: int) -> None:
    with SMBus(stub) as client:
        for register, value in enumerate(IDS):
            client.write_byte_data(0x28, register, value)
    with pytest.raises(DriverError):
        open_pod(stub)


def test_absent_address_is_named(stub: int) -> None:
    pod = Pod(id=0, s_m=0.5, link=I2cLink(bus=stub, address=0x29))
    with pytest.raises(DriverError, match="0x29"):
        open_imus([pod])


def test_another_sensor_at_our_address_is_never_written() -> None:
    written: list[bytes] = []

    def other(messages: Sequence[I2cMessage]) -> list[bytes]:
        # A sensor whose identification register, 0x00, reads 0xD1.
        written.extend(m.written for m in messages if len(m.written) > 1)
        return [bytes([0xD1] * m.read_length) for m in messages if m.read_length is not None]

    served = CuseI2cBus(27, other)
    served.start()
    try:
        with pytest.raises(DeviceNotFoundError, match="0xD1"):
            open_pod(27)
    finally:
        served.close()
    assert written == []
