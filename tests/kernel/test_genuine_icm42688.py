"""The ICM-42688-P on a genuine /dev/i2c-N, in real time, opened as ``avionics run`` opens it."""

import contextlib

import numpy as np
import pytest

from avionics.config import Pod
from avionics.config.chips import Icm42688Settings
from avionics.config.links import I2cLink
from drivers.clock import SteadyClock
from drivers.prompt_threads import prompt_threads
from sim_bus.bench.cuse_i2c import CuseI2cBus
from sim_bus.bench.i2c_adapter import transfer_on
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.i2c import SimI2cBus, Wired
from sim_bus.chip.icm42688.chip import SimIcm42688
from tests import machine
from tests.drivers import genuine
from tests.drivers.wing_bench import GOOD, SECOND
from tests.opening import open_imus

pytestmark = pytest.mark.uml

NODE, ADDRESS, Z_RAD_S = 11, 0x69, 0.7


def test_chip_is_set_read_and_taken_up_again_after_a_brown_out(machine_speed: float) -> None:
    clock, plan = SteadyClock(), FaultPlan([], np.random.default_rng(2))
    chip = SimIcm42688(
        genuine.Turning(Z_RAD_S), np.random.default_rng(1), grade=GOOD,
        power_on_ns=clock.now_ns() - SECOND,
    )  # fmt: skip
    bus = SimI2cBus(clock, {(None, 0, ADDRESS): Wired(chip, "pod 0")}, plan)
    node = CuseI2cBus(NODE, transfer_on(bus))
    node.start()
    rate_hz = machine.rate_hz(100, machine_speed)
    settings = Icm42688Settings(kind="icm42688", rate_hz=rate_hz)
    pod = Pod(id=0, s_m=0.5, link=I2cLink(bus=NODE, address=ADDRESS), chip=settings)
    with contextlib.closing(node), prompt_threads(), contextlib.closing(open_imus([pod])) as imus:
        flight = genuine.Flight(imus, plan)
        samples = flight.wait_for(30)
        assert len(samples) == 30
        lost = samples[-1].seq - samples[0].seq + 1 - len(samples)
        assert lost <= flight.count("ticks_missed") + flight.count("read_slow")
        assert genuine.z_errors(samples, Z_RAD_S).max() < genuine.RATE_MARGIN_RAD_S
        assert chip.violations == []
        # WHEN it browns out THEN it is set again, on the kernel's own NAK
        flight.fault("brown_out", 0.001)
        flight.wait_for(30)
        assert flight.count("reinitialised") == 1
        again = flight.wait_for(10)
        assert genuine.z_errors(again, Z_RAD_S).max() < genuine.RATE_MARGIN_RAD_S
        assert chip.violations == []
