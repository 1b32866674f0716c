"""The driver on a genuine /dev/i2c-N, in real time: the matrix, slow chips, a multiplexer."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np
import pytest
import smbus2

from drivers.bno055.device import Bno055
from drivers.bno055.registers import Mode
from drivers.bno055.settings import Settings
from drivers.clock import SteadyClock
from drivers.i2c_registers import I2cRegisterPort
from drivers.polled_imus import PolledImus
from drivers.prompt_threads import prompt_threads
from drivers.reopening import ReopeningI2cBus
from drivers.tca9548a import Muxes
from sim_bus.bench.cuse_i2c import CuseI2cBus
from sim_bus.bench.i2c_adapter import transfer_on
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.i2c import Place, SimI2cBus, Wired
from tests import machine
from tests.drivers import genuine
from tests.drivers.fault_matrix import CASES, Case

pytestmark = pytest.mark.uml
FULL_HZ = 100

ADDRESS, MUX = 0x28, 0x70
Z_RAD_S = -0.3


@contextlib.contextmanager
def flight_on(
    number: int,
    rates: Mapping[Place, float],
    *,
    mode: Mode = Mode.AMG,
    byte_ns: int = 50_000,
    rate_hz: float = FULL_HZ,
) -> Iterator[genuine.Flight]:
    """Serve chips that turn at ``rates`` as /dev/i2c-``number``, and open our driver on it."""
    clock, plan = SteadyClock(), FaultPlan([], np.random.default_rng(2))
    wires = {
        place: Wired(genuine.make_chip(z_rad_s, seed=n), f"pod {n}")
        for n, (place, z_rad_s) in enumerate(rates.items())
    }
    node = CuseI2cBus(number, transfer_on(SimI2cBus(clock, wires, plan, byte_ns=byte_ns)))
    node.start()
    with contextlib.closing(node):
        bus = ReopeningI2cBus(partial(smbus2.SMBus, number))
        muxes = Muxes(bus, [MUX])
        chips = [
            Bno055(
                I2cRegisterPort(
                    bus, at, behind=None if first is None else muxes.channel(first, channel)
                ),
                clock, pod=str(n), settings=Settings(mode=mode),
            )
            for n, (first, channel, at) in enumerate(rates)
        ]  # fmt: skip
        with (
            prompt_threads(),
            contextlib.closing(PolledImus(chips, clock, rate_hz, bus=bus)) as imus,
        ):
            imus.open()
            yield genuine.Flight(imus, plan)


@pytest.fixture(scope="module")
def flight() -> Iterator[genuine.Flight]:
    with flight_on(8, {(None, 0, ADDRESS): Z_RAD_S}) as one:
        yield one


@pytest.mark.parametrize(
    "case", [case for case in CASES if case.bus == "i2c"], ids=lambda case: case.name
)
def test_fault_on_the_node_is_survived_and_counted(flight: genuine.Flight, case: Case) -> None:
    genuine.survive(flight, case, Z_RAD_S)


def test_chip_that_stretches_the_clock_misses_ticks_and_no_more() -> None:
    # GIVEN a chip whose burst of 21 bytes takes 12.6 ms WHEN it is asked every 10 ms
    with flight_on(9, {(None, 0, ADDRESS): Z_RAD_S}, byte_ns=600_000) as flight:
        samples = flight.read(1.5)
        # THEN every burst that fits is a good sample, and the ticks between are counted
        assert len(samples) > 30
        assert genuine.z_errors(samples, Z_RAD_S).max() < genuine.RATE_MARGIN_RAD_S
        missed = samples[-1].seq - samples[0].seq + 1 - len(samples)
        assert 0 < missed <= flight.count("ticks_missed") + flight.count("read_slow")
        assert flight.count("read_failed") == 0


def test_three_chips_behind_a_multiplexer_each_give_their_own_rate(machine_speed: float) -> None:
    rate_hz = machine.rate_hz(FULL_HZ, machine_speed)
    rates = (0.2, -0.4, 0.6)
    places = {(MUX, channel, ADDRESS): rate for channel, rate in zip((0, 3, 7), rates, strict=True)}
    with flight_on(10, places, mode=Mode.GYRONLY, rate_hz=rate_hz) as flight:
        assert_own_rates(flight, rates, rate_hz)
        # GIVEN three chips on one address WHEN one stops to acknowledge THEN the others go on
        end_ns = flight.fault("nak", genuine.LONGEST_S, pod=1)
        during = flight.read(genuine.LONGEST_S)
        assert {s.pod for s in during[len(during) // 2 :]} == {"0", "2"}
        assert flight.count("i2c_nak", pod=1) > 0
        # WHEN it is back THEN it is read again, and by its own channel
        back = flight.wait_for(1, pod="1")
        assert (back[0].t_ns - end_ns) * 1e-9 < genuine.RETURN_S
        assert_own_rates(flight, rates, rate_hz)


def assert_own_rates(flight: genuine.Flight, rates: Sequence[float], rate_hz: int) -> None:
    """Read 100 ticks; at least 30 of each chip must be samples, at its own rate."""
    samples = flight.read(FULL_HZ / rate_hz)
    for n, rate in enumerate(rates):
        mine = [s for s in samples if s.pod == str(n)]
        assert len(mine) > 30, flight.imus.health()
        assert genuine.z_errors(mine, rate).max() < genuine.RATE_MARGIN_RAD_S
