"""Simulated ICM-42688-P chips on a stepped clock, behind I2C and SPI."""

import numpy as np

from drivers.i2c_registers import I2cRegisterPort
from drivers.icm42688.device import Icm42688
from drivers.icm42688.settings import Settings
from drivers.icm42688.spi_port import SpiRegisterPort
from drivers.polled_imus import PolledImus
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.i2c import SimI2cBus, Wired
from sim_bus.buses.spi import SimSpiDevice
from sim_bus.chip.icm42688.chip import SimIcm42688
from sim_bus.chip.sensing import ImuGrade
from sim_bus.clock import SimClock
from tests.drivers.wing_bench import GOOD, START, Bench, Swing


def make_icm_bench(
    bus: str,
    *,
    settings: Settings | None = None,
    grade: ImuGrade = GOOD,
    seed: int = 1,
    rate_hz: float = 100.0,
    is_booted: bool = True,
) -> Bench:
    """Return a bench with one chip that is not yet open."""
    clock, rng = SimClock(START), np.random.default_rng(seed)
    plan = FaultPlan([], np.random.default_rng(seed + 1))
    chip = SimIcm42688(Swing(), rng, grade=grade, power_on_ns=START, is_booted=is_booted)
    if bus == "spi":
        line = SimSpiDevice(chip, clock, target="pod 0", faults=plan)
        port = SpiRegisterPort(line)
    else:
        wires = {(None, 0, 0x68): Wired(chip, "pod 0")}
        line = SimI2cBus(clock, wires, plan)
        port = I2cRegisterPort(line, 0x68)
    device = Icm42688(port, clock, pod="0", settings=settings)
    return Bench(clock, [chip], PolledImus([device], clock, rate_hz, bus=line), plan)
