"""A genuine i2c-dev node: smbus2 and i2c-tools reach a simulated bus through the kernel."""

import errno
import os
import subprocess
from collections.abc import Iterator, Sequence
from functools import partial

import pytest
from smbus2 import SMBus, i2c_msg

from drivers.reopening import ReopeningI2cBus
from sim_bus.bench.cuse_i2c import CuseI2cBus, I2cMessage

pytestmark = pytest.mark.uml

ADDRESS = 0x28


class Memory:
    """256 registers behind a pointer, at one address; anything else does not acknowledge."""

    def __init__(self) -> None:
        self.registers = bytearray(range(256))
        self.pointer = 0
        self.fail_errno = 0

    def __call__(self, messages: Sequence[I2cMessage]) -> list[bytes]:
        reads = []
        for message in messages:
            if self.fail_errno:
                raise OSError(self.fail_errno, os.strerror(self.fail_errno))
            if message.address != ADDRESS:
                raise OSError(errno.EREMOTEIO, "no acknowledge")
            if message.read_length is None:
                if message.written:
                    self.pointer = message.written[0]
                    content = message.written[1:]
                    self.registers[self.pointer : self.pointer + len(content)] = content
            else:
                reads.append(
                    bytes(self.registers[self.pointer : self.pointer + message.read_length])
                )
        return reads


@pytest.fixture
def memory() -> Memory:
    return Memory()


@pytest.fixture
def bus(memory: Memory) -> Iterator[CuseI2cBus]:
    served = CuseI2cBus(7, memory)
    served.start()
    yield served
    served.close()


def test_smbus2_block_and_byte_data(bus: CuseI2cBus, memory: Memory) -> None:
    with SMBus(7) as client:
        assert client.read_i2c_block_data(ADDRESS, 0x14, 6) == list(range(0x14, 0x1A))
        client.write_i2c_block_data(ADDRESS, 0x3D, [1, 2, 3])
        assert bytes(memory.registers[0x3D:0x40]) == b"\x01\x02\x03"
        client.write_byte_data(ADDRESS, 0x07, 9)
        assert client.read_byte_data(ADDRESS, 0x07) == 9
        assert client.read_word_data(ADDRESS, 0x20) == 0x2120


def test_smbus2_combined_transfer_reads_more_than_smbus_allows(bus: CuseI2cBus) -> None:
    with SMBus(7) as client:
        register, answer = i2c_msg.write(ADDRESS, [0x08]), i2c_msg.read(ADDRESS, 45)
        client.i2c_rdwr(register, answer)
        assert list(answer) == list(range(8, 53))


@pytest.mark.parametrize("number", [errno.EREMOTEIO, errno.ETIMEDOUT, errno.EIO, errno.EAGAIN])
def test_faults_arrive_by_number(bus: CuseI2cBus, memory: Memory, number: int) -> None:
    memory.fail_errno = number
    with SMBus(7) as client, pytest.raises(OSError) as caught:
        client.read_i2c_block_data(ADDRESS, 0, 6)
    assert caught.value.errno == number


def test_i2c_tools_see_the_chip(bus: CuseI2cBus) -> None:
    found = subprocess.run(
        ["i2cdetect", "-y", "7"], capture_output=True, text=True, check=True
    ).stdout
    assert found.split("20:")[1].split("\n")[0].split() == ["--"] * 8 + ["28"] + ["--"] * 7
    value = subprocess.run(
        ["i2cget", "-y", "7", "0x28", "0x55"], capture_output=True, text=True, check=True
    ).stdout
    assert value.strip() == "0x55"
    block = subprocess.run(
        ["i2ctransfer", "-y", "7", "w1@0x28", "0x10", "r4"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert block.split() == ["0x10", "0x11", "0x12", "0x13"]


def test_node_vanishes_when_the_server_ends(bus: CuseI2cBus) -> None:
    client = SMBus(7)
    bus.close()
    with pytest.raises(OSError) as caught:
        client.read_i2c_block_data(ADDRESS, 0, 6)
    assert caught.value.errno in (errno.ENOTCONN, errno.ENODEV)
    client.close()
    assert not bus.path.exists()


def test_our_bus_returns_with_its_node(bus: CuseI2cBus, memory: Memory) -> None:
    client = ReopeningI2cBus(partial(SMBus, 7))
    assert client.read_i2c_block_data(ADDRESS, 0x14, 2) == [0x14, 0x15]
    bus.close()
    for _ in range(2):
        with pytest.raises(OSError, match=r".+"):
            client.read_i2c_block_data(ADDRESS, 0x14, 2)
    again = CuseI2cBus(7, memory)
    again.start()
    assert client.read_i2c_block_data(ADDRESS, 0x14, 2) == [0x14, 0x15]
    assert client.reopened == 1
    client.close()
    again.close()
