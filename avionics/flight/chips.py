"""From a pod's ``chip`` table to its driver: the place that knows chips by name."""

from pathlib import Path

from avionics.config.chips import Bno055Settings, Chip, Icm42688Settings
from drivers.bno055.calibration import CalibrationFile
from drivers.bno055.device import Bno055
from drivers.can.pod.messages import ConfigKey
from drivers.clock import Clock
from drivers.icm42688.device import Icm42688
from drivers.interfaces import ImuChip
from drivers.register_port import RegisterPort


def make_chip(
    chip: Chip, name: str, port: RegisterPort, clock: Clock, *, keeps_calibration: bool
) -> ImuChip:
    """Return the driver of a chip, not yet brought up.

    Parameters
    ----------
    chip : Bno055Settings or Icm42688Settings
        Which one it is, and its settings.
    name : str
        Identifier that the samples carry.
    port : RegisterPort
        How the chip's registers are reached.
    clock : Clock
        The clock of its bus.
    keeps_calibration : bool
        Whether the chip's calibration file is read and written; not for a simulated chip.
    """
    match chip:
        case Bno055Settings(calibration_file=path):
            calibrations = None
            if path is not None and keeps_calibration:
                calibrations = CalibrationFile(Path(path))
            return Bno055(
                port,
                clock,
                pod=name,
                settings=chip.driver_settings(),
                calibrations=calibrations,
            )
        case Icm42688Settings():
            return Icm42688(port, clock, pod=name, settings=chip.driver_settings())


def pod_settings(chip: Chip) -> dict[ConfigKey, int]:
    """Return what a CAN pod is asked to set; its chip is a BNO055."""
    assert isinstance(chip, Bno055Settings)  # the configuration allows no other on CAN
    mode = chip.driver_settings().mode
    wanted = {ConfigKey.MODE: int(mode)}
    if not mode.is_fusion:
        wanted[ConfigKey.GYRO_RANGE_DPS] = chip.gyro_range_dps
        wanted[ConfigKey.GYRO_BANDWIDTH_HZ] = chip.gyro_bandwidth_hz
    wanted[ConfigKey.RATE_HZ] = round(chip.rate_hz)
    wanted[ConfigKey.STREAMS] = int(mode.has_accel) | int(mode.has_mag) << 1
    if chip.external_crystal:
        wanted[ConfigKey.EXTERNAL_CRYSTAL] = 1
    return wanted
