"""How an ICM-42688-P shall be set, and what follows: the worth of a bit, the age of a rate."""

from dataclasses import dataclass
from typing import Final

from drivers.gyro_delay import GyroDelay, low_pass_delay_s
from drivers.icm42688 import registers as reg

# Sec. 9.3: AP_AD0 low, high.
ADDRESSES: Final = (0x68, 0x69)


@dataclass(frozen=True, slots=True)
class Settings:
    """What is written to the chip and must read back.

    Attributes
    ----------
    has_accel : bool
        Whether the accelerometer runs beside the gyro.
    gyro_range_dps, accel_range_g : int
        Full scales, deg/s and g.
    data_hz : int
        Output data rate of both sensors, Hz.
    filter_order : int
        Order of the low-pass of both sensors, 1 to 3.
    gyro_bandwidth_hz : int
        Its bandwidth, Hz, rounded; see ``filter_bandwidths_hz``.

    Raises
    ------
    ValueError
        If the chip does not have such a setting.
    """

    has_accel: bool = True
    gyro_range_dps: int = 2000
    accel_range_g: int = 16
    data_hz: int = 1000
    filter_order: int = 2
    gyro_bandwidth_hz: int = 48

    def __post_init__(self) -> None:
        for name, value, known in (
            ("gyro_range_dps", self.gyro_range_dps, reg.GYRO_RANGE_BITS),
            ("accel_range_g", self.accel_range_g, reg.ACCEL_RANGE_BITS),
            ("data_hz", self.data_hz, reg.DATA_RATE_BITS),
            ("filter_order", self.filter_order, reg.FILTER_BANDWIDTH_HZ),
        ):
            if value not in known:
                msg = f"{name} = {value}: the ICM-42688-P wants one of {sorted(known)}"
                raise ValueError(msg)
        if self.gyro_bandwidth_hz not in self._bandwidths_hz:
            msg = (
                f"gyro_bandwidth_hz = {self.gyro_bandwidth_hz}: at filter_order = "
                f"{self.filter_order} and data_hz = {self.data_hz} the ICM-42688-P wants one of "
                f"{sorted(self._bandwidths_hz)}"
            )
            raise ValueError(msg)

    @property
    def _bandwidths_hz(self) -> tuple[int, ...]:
        return reg.filter_bandwidths_hz(self.filter_order, self.data_hz)

    @property
    def gyro_scale_rad_s(self) -> float:
        """Worth of one LSB of the gyro registers, rad/s."""
        return reg.gyro_scale_rad_s(self.gyro_range_dps)

    @property
    def accel_scale_m_s2(self) -> float:
        """Worth of one LSB of the accelerometer registers, m/s^2."""
        return reg.accel_scale_m_s2(self.accel_range_g)

    @property
    def delay(self) -> GyroDelay:
        """Age of the rates: anti-alias filter, low-pass with its decimation, register."""
        delays_ms = reg.FILTER_DELAY_MS[self.filter_order]
        delay_s = 1e-3 * delays_ms[self._bandwidths_hz.index(self.gyro_bandwidth_hz)]
        scale = max(reg.FILTER_BASE_HZ, self.data_hz) / reg.FILTER_BASE_HZ
        filter_s = delay_s / scale + low_pass_delay_s(reg.ANTI_ALIAS_HZ)
        return GyroDelay(filter_s, 1.0 / self.data_hz)

    def configuration(self, *, is_spi: bool) -> dict[int, int]:
        """Return the wanted values of INTF_CONFIG0 to ACCEL_CONFIG1 by register.

        Parameters
        ----------
        is_spi : bool
            Whether the chip is reached over SPI, not I2C.
        """
        order = self.filter_order - 1
        bandwidth = self._bandwidths_hz.index(self.gyro_bandwidth_hz) + 1
        data_rate = reg.DATA_RATE_BITS[self.data_hz]
        return {
            reg.INTF_CONFIG0: reg.BIG_ENDIAN_SPI_ONLY if is_spi else reg.BIG_ENDIAN_I2C_ONLY,
            reg.INTF_CONFIG1: reg.NO_ADAPTIVE_RANGE,
            reg.PWR_MGMT0: reg.GYRO_LOW_NOISE | (reg.ACCEL_LOW_NOISE if self.has_accel else 0),
            reg.GYRO_CONFIG0: reg.GYRO_RANGE_BITS[self.gyro_range_dps] << 5 | data_rate,
            reg.ACCEL_CONFIG0: reg.ACCEL_RANGE_BITS[self.accel_range_g] << 5 | data_rate,
            # Temperature filter and DEC2_M2 order at their reset values.
            reg.GYRO_CONFIG1: 0x12 | order << 2,
            reg.GYRO_ACCEL_CONFIG0: bandwidth << 4 | bandwidth,
            reg.ACCEL_CONFIG1: 0x05 | order << 3,
        }
