import errno

import numpy as np
import pytest

from sim_bus.buses.faults import KINDS, Fault, FaultPlan
from sim_bus.buses.i2c import SimI2cBus, Wired
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.clock import SimClock

S = 1_000_000_000


def bus(wave, *faults: Fault, places=((None, 0, 0x28),)):
    clock = SimClock()
    wired = {
        place: Wired(SimBno055(wave, np.random.default_rng(n)), f"pod {n}")
        for n, place in enumerate(places)
    }
    return clock, SimI2cBus(clock, wired, FaultPlan(list(faults), np.random.default_rng(0))), wired


def test_block_reads_and_writes_take_their_time(wave) -> None:
    clock, b, _ = bus(wave)
    assert b.read_i2c_block_data(0x28, 0x00, 2) == [0xA0, 0xFB]
    assert clock.now_ns() == 5 * 180_000
    b.write_i2c_block_data(0x28, 0x3D, [0x07])
    clock.advance(20_000_000)
    assert b.read_byte_data(0x28, 0x3D) == 0x07
    b.write_byte(0x28, 0x00)
    assert b.read_byte(0x28) == 0xA0


def test_nobody_at_an_address_is_a_nak(wave) -> None:
    _, b, _ = bus(wave)
    with pytest.raises(OSError) as caught:
        b.read_i2c_block_data(0x29, 0x00, 1)
    assert caught.value.errno == errno.EREMOTEIO


def test_blocks_are_at_most_32_bytes(wave) -> None:
    _, b, _ = bus(wave)
    with pytest.raises(ValueError, match="33, wanted 1 to 32"):
        b.read_i2c_block_data(0x28, 0x00, 33)
    with pytest.raises(ValueError, match="33, wanted at most 32"):
        b.write_i2c_block_data(0x28, 0x00, [0] * 33)


def test_multiplexer_chooses_the_chip(wave) -> None:
    _, b, wired = bus(wave, places=((0x70, 0, 0x28), (0x70, 3, 0x28)))
    with pytest.raises(OSError, match=r"."):
        b.read_i2c_block_data(0x28, 0x00, 1)
    uids = []
    for channel in (0, 3):
        b.write_byte(0x70, 1 << channel)
        b.write_i2c_block_data(0x28, 0x07, [1])
        uids.append(bytes(b.read_i2c_block_data(0x28, 0x50, 16)))
    assert uids == [w.chip.unique_id for w in wired.values()]


@pytest.mark.parametrize(
    ("kind", "number"),
    [
        ("nak", errno.EREMOTEIO),
        ("io_error", errno.EIO),
        ("arbitration_lost", errno.EAGAIN),
        ("stuck_bus", errno.ETIMEDOUT),
    ],
)
def test_errors_come_by_their_kernel_number_and_end(wave, kind: str, number: int) -> None:
    clock, b, _ = bus(wave, Fault(kind, "pod 0", 1 * S, 2 * S))
    b.read_byte_data(0x28, 0x00)
    clock.advance_to(1 * S)
    with pytest.raises(OSError) as caught:
        b.read_byte_data(0x28, 0x00)
    assert caught.value.errno == number
    clock.advance_to(2 * S)
    assert b.read_byte_data(0x28, 0x00) == 0xA0


def test_spike_sets_bit_7_of_one_byte(wave) -> None:
    _, b, _ = bus(wave, Fault("spike", "*", 0, S))
    found = bytes(b.read_i2c_block_data(0x28, 0x36, 1))
    assert found == b"\x8f"


def test_probability_is_a_share_of_transactions(wave) -> None:
    _, b, _ = bus(wave, Fault("nak", "*", 0, 1000 * S, probability=0.25))
    failed = 0
    for _ in range(400):
        try:
            b.read_byte_data(0x28, 0x00)
        except OSError:
            failed += 1
    assert 70 < failed < 130


def test_chip_faults_begin_once(wave) -> None:
    clock, b, _ = bus(
        wave,
        Fault("config_reset", "pod 0", 1 * S, 2 * S),
        Fault("page_left", "pod 0", 3 * S, 4 * S),
    )
    b.write_i2c_block_data(0x28, 0x3D, [0x07])
    clock.advance_to(S + 1)
    assert b.read_byte_data(0x28, 0x3D) == 0
    b.write_i2c_block_data(0x28, 0x3D, [0x07])
    clock.advance(20_000_000)
    assert b.read_byte_data(0x28, 0x3D) == 7
    clock.advance_to(3 * S)
    assert b.read_byte_data(0x28, 0x07) == 1


def test_faults_switch_while_it_runs(wave) -> None:
    clock, b, _ = bus(wave)
    plan = b._faults
    plan.switch_on(Fault("nak", "pod 0", 0, 1 << 60))
    with pytest.raises(OSError, match=r"."):
        b.read_byte_data(0x28, 0x00)
    plan.switch_off("nak", "pod 0", clock.now_ns())
    assert b.read_byte_data(0x28, 0x00) == 0xA0


def test_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="'nack' is unknown; wanted one of"):
        Fault("nack", "*", 0, 1)
    assert len(KINDS) >= 20
    assert len(set(KINDS)) == len(KINDS)
