"""Registers over I2C: errors by number, and the multiplexers of a bus as one."""

import numpy as np
import pytest

from drivers.errors import BusError, BusTimeoutError
from drivers.i2c_registers import I2cRegisterPort
from drivers.tca9548a import Muxes
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.i2c import SimI2cBus, Wired
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.clock import SimClock
from tests.drivers.bno055_scripts import ScriptedI2c
from tests.drivers.wing_bench import START, Swing


@pytest.mark.parametrize(
    ("number", "counter", "kind"),
    [
        (5, "i2c_io", BusError),
        (11, "i2c_arbitration_lost", BusError),
        (110, "i2c_timeout", BusTimeoutError),
        (121, "i2c_nak", BusError),
        (6, "i2c_nak", BusError),
        (107, "i2c_other", BusError),
    ],
)
def test_kernel_errors_are_told_apart_by_number(number, counter, kind) -> None:
    port = I2cRegisterPort(ScriptedI2c(OSError(number, "text")), 0x28)
    with pytest.raises(kind, match=rf"read of register 0x14 at 0x28: text \(errno {number}\)"):
        port.read(0x14, 6)
    with pytest.raises(kind, match="write of register 0x07"):
        port.write(0x07, b"\x00")
    assert port.counters == {counter: 2}


def test_short_i2c_answer_is_an_error() -> None:
    port = I2cRegisterPort(ScriptedI2c(b"\x00\x01"), 0x28)
    with pytest.raises(BusError, match="2 bytes, expected 6"):
        port.read(0x14, 6)


def test_multiplexer_is_switched_only_when_needed_and_again_after_an_error() -> None:
    bus = ScriptedI2c(bytes(1))
    muxes = Muxes(bus, [0x70])
    left, right = (I2cRegisterPort(bus, 0x28, behind=muxes.channel(0x70, c)) for c in (0, 3))
    left.read(0, 1)
    left.read(0, 1)
    right.read(0, 1)
    assert bus.writes == [(0x70, 1, b"\x01"), (0x70, 8, b"\x08")]
    bus.script[0] = OSError(121, "nak")
    with pytest.raises(BusError):
        right.read(0, 1)
    bus.script[0] = bytes(1)
    right.read(0, 1)
    assert bus.writes[-1] == (0x70, 8, b"\x08")
    assert len(bus.writes) == 3


TWO_MUXES = ((0x70, 0, 0x28), (0x71, 0, 0x28))


def two_behind_two(*addresses: int):
    """Return a bus with a chip of one address behind each of two multiplexers, and their ports."""
    clock = SimClock(START)
    chips = [
        SimBno055(Swing(), np.random.default_rng(n), power_on_ns=START - 10**9) for n in (1, 2)
    ]
    wires = {p: Wired(c, f"pod {n}") for n, (p, c) in enumerate(zip(TWO_MUXES, chips, strict=True))}
    bus = SimI2cBus(clock, wires, FaultPlan(), byte_ns=1000)
    muxes = Muxes(bus, addresses)
    ports = [I2cRegisterPort(bus, a, behind=muxes.channel(m, c)) for m, c, a in TWO_MUXES]
    return bus, chips, ports


def uid_read(port: I2cRegisterPort) -> bytes:
    port.write(0x07, b"\x01")
    try:
        return port.read(0x50, 16)
    finally:
        port.write(0x07, b"\x00")


def test_two_multiplexers_of_a_bus_are_not_open_at_once() -> None:
    _, chips, ports = two_behind_two(0x70, 0x71)
    for _ in range(2):
        assert [uid_read(port) for port in ports] == [chip.unique_id for chip in chips]


def test_a_multiplexer_that_was_left_open_is_closed_before_the_first_transfer() -> None:
    bus, chips, ports = two_behind_two(0x70, 0x71)
    bus.write_byte(0x71, 0xFF)
    assert uid_read(ports[0]) == chips[0].unique_id


def test_chips_that_are_on_together_answer_together() -> None:
    # GIVEN a driver that knows of one multiplexer only WHEN the other was left open
    bus, chips, ports = two_behind_two(0x70)
    bus.write_byte(0x71, 0x01)
    # THEN it reads the AND of both, as on the wire
    both = bytes(a & b for a, b in zip(*(chip.unique_id for chip in chips), strict=True))
    assert uid_read(ports[0]) == both


def test_a_multiplexer_that_is_not_there_does_not_hold_up_the_other() -> None:
    bus, chips, ports = two_behind_two(0x70, 0x71, 0x72)
    assert uid_read(ports[0]) == chips[0].unique_id
    with pytest.raises(OSError, match="Remote I/O error"):
        bus.write_byte(0x72, 0)


def test_a_disturbed_close_is_made_up_for(monkeypatch) -> None:
    # GIVEN the second multiplexer open, whose close is lost once
    bus, chips, ports = two_behind_two(0x70, 0x71)
    bus.write_byte(0x71, 0x01)
    honest, lost = bus.write_i2c_block_data, []

    def write(address, register, data) -> None:
        if address == 0x71 and not lost:
            lost.append(address)
            raise OSError(121, "Remote I/O error")
        honest(address, register, data)

    monkeypatch.setattr(bus, "write_i2c_block_data", write)
    # THEN the first transfer meets both chips and the next one its own
    ports[0].read(0x00, 1)
    assert lost
    assert uid_read(ports[0]) == chips[0].unique_id
