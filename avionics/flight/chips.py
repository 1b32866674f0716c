"""From a pod's ``chip`` table to the driver's settings: the place that knows chips by name."""

from avionics.config.links import Bno055Settings
from drivers.bno055.settings import MODE_BY_NAME, Settings
from drivers.can.pod.messages import ConfigKey
from drivers.gyro_delay import GyroDelay


def chip_settings(chip: Bno055Settings) -> Settings:
    """Return what the driver writes to the chip and reads back."""
    return Settings(
        mode=MODE_BY_NAME[chip.mode],
        gyro_range_dps=chip.gyro_range_dps,
        gyro_bandwidth_hz=chip.gyro_bandwidth_hz,
        external_crystal=chip.external_crystal,
    )


def gyro_delay(chip: Bno055Settings) -> GyroDelay:
    """Return how old the rates of a chip are when they are read.

    It follows from the configuration, so that a replay knows it too. What flies is what is
    configured: the drivers read the settings back from the chip, a pod on CAN confirms them, and
    a log carries the configuration it was flown with.
    """
    return chip_settings(chip).delay


def pod_settings(chip: Bno055Settings) -> dict[ConfigKey, int]:
    """Return what a CAN pod is asked to set for a chip's configuration."""
    mode = chip_settings(chip).mode
    wanted = {ConfigKey.MODE: int(mode)}
    if not mode.is_fusion:
        wanted[ConfigKey.GYRO_RANGE_DPS] = chip.gyro_range_dps
        wanted[ConfigKey.GYRO_BANDWIDTH_HZ] = chip.gyro_bandwidth_hz
    wanted[ConfigKey.RATE_HZ] = round(chip.rate_hz)
    wanted[ConfigKey.STREAMS] = int(mode.has_accel) | int(mode.has_mag) << 1
    if chip.external_crystal:
        wanted[ConfigKey.EXTERNAL_CRYSTAL] = 1
    return wanted
