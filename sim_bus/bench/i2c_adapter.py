"""The simulated I2C bus behind a CUSE node: messages in, register accesses out."""

from collections.abc import Sequence

from sim_bus.bench.cuse_i2c import I2cMessage, Transfer
from sim_bus.buses.i2c import BLOCK_MAX, SimI2cBus


def transfer_on(bus: SimI2cBus) -> Transfer:
    """Return a function that runs I2C messages on a simulated bus.

    A write's first byte is the register pointer, as on every BNO055; a write of nothing probes.
    """
    pointers: dict[int, int] = {}

    def transfer(messages: Sequence[I2cMessage]) -> list[bytes]:
        reads = []
        for message in messages:
            address = message.address
            if message.read_length is not None:
                start = pointers.get(address, 0)
                reads.append(_read(bus, address, start, message.read_length))
            elif len(message.written) > 1:
                bus.write_i2c_block_data(address, message.written[0], list(message.written[1:]))
                pointers[address] = message.written[0]
            elif message.written:
                bus.write_byte(address, message.written[0])
                pointers[address] = message.written[0]
            else:
                bus.write_byte(address, pointers.get(address, 0))
        return reads

    return transfer


def _read(bus: SimI2cBus, address: int, start: int, length: int) -> bytes:
    if length == 0:
        bus.write_byte(address, start)
        return b""
    data: list[int] = []
    while len(data) < length:
        count = min(BLOCK_MAX, length - len(data))
        data += bus.read_i2c_block_data(address, (start + len(data)) & 0xFF, count)
    return bytes(data)
