"""How a BNO055 shall be set, and what follows: the worth of a bit, the age of a rate."""

from dataclasses import dataclass
from typing import Final

from drivers.bno055 import registers as reg
from drivers.bno055.registers import Mode
from drivers.gyro_delay import GyroDelay, low_pass_delay_s

# Sec. 4.6: COM3 low, high.
ADDRESSES: Final = (0x28, 0x29)
MODE_BY_NAME: Final = {
    "gyronly": Mode.GYRONLY,
    "amg": Mode.AMG,
    "imu": Mode.IMU,
    "ndof": Mode.NDOF,
}


@dataclass(frozen=True, slots=True)
class Settings:
    """What is written to the chip and must read back.

    Attributes
    ----------
    mode : Mode
        Operation mode. In fusion modes the chip overrides range and bandwidth (2000 deg/s, 32 Hz).
    gyro_range_dps, gyro_bandwidth_hz : int
        Range, deg/s, and bandwidth, Hz, of the raw modes.
    external_crystal : bool
        Whether a 32 kHz crystal is fitted and shall be used.
    """

    mode: Mode = Mode.AMG
    gyro_range_dps: int = 2000
    gyro_bandwidth_hz: int = 32
    external_crystal: bool = False

    @property
    def gyro_scale_rad_s(self) -> float:
        """Worth of one LSB of the gyro registers, rad/s."""
        return reg.gyro_scale_rad_s(self.mode, self.gyro_range_dps)

    @property
    def delay(self) -> GyroDelay:
        """Age of the rates in this mode, which in fusion modes is the chip's own choice."""
        is_fusion = self.mode.is_fusion
        bandwidth_hz = reg.FUSION_BANDWIDTH_HZ if is_fusion else self.gyro_bandwidth_hz
        data_hz = reg.FUSION_DATA_HZ if is_fusion else reg.GYRO_DATA_HZ[bandwidth_hz]
        return GyroDelay(low_pass_delay_s(bandwidth_hz), 1.0 / data_hz)
