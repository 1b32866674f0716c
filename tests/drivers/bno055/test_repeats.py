"""Data that repeat: passed on at first, refused when stale, healed when frozen; and slow lines."""

import numpy as np
import pytest

from drivers.bno055.ports import UartRegisterPort
from drivers.repeats import FROZEN_AFTER, STALE_AFTER
from sim_bus.buses.uart import SimSerialPort
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.clock import SimClock
from tests.drivers.wing_bench import START, Swing


@pytest.mark.parametrize("bus", ["i2c", "uart"])
@pytest.mark.parametrize("ticks", [STALE_AFTER - 2, STALE_AFTER + 7])
def test_repeated_data_are_counted_and_refused_when_stale(bench, bus, ticks) -> None:
    # GIVEN a chip in flight WHEN its registers stand still for some ticks
    one = bench(bus)
    one.imus.open()
    one.fly(0.5)
    before = {name: one.count(name) for name in ("repeated", "stale")}
    one.fault("freeze", 0, 0.0, ticks * 0.01)
    samples = one.fly(1.0)
    repeated, stale = (one.count(name) - n for name, n in before.items())
    # THEN the first repeats are passed on, later ones not, and the chip is not set up again
    assert repeated == pytest.approx(ticks, abs=2)
    assert stale == max(0, repeated - STALE_AFTER + 1)
    assert (stale > 0) == (ticks > STALE_AFTER)
    assert len(samples) == pytest.approx(100 - stale, abs=1)
    assert ticks < FROZEN_AFTER
    assert one.count("frozen") == one.count("reinitialised") == 0


def test_answer_that_comes_over_many_milliseconds_is_put_together() -> None:
    clock, rng = SimClock(START), np.random.default_rng(1)
    chip = SimBno055(Swing(), rng, power_on_ns=START)
    line = SimSerialPort(chip, clock, baud=9600, overruns=False)
    port = UartRegisterPort(line, clock)
    before_ns = clock.now_ns()
    assert port.read(0x00, 16) == chip.read(0x00, 16, clock.now_ns())
    assert clock.now_ns() - before_ns > 18 * 1_000_000  # a byte takes 1.04 ms
    assert not port.counters
