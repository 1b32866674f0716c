"""Configuration of the IMU chips: one class each, told apart by ``kind``."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from avionics.config.links import I2cLink, Link, Section
from drivers.bno055 import settings as bno055
from drivers.gyro_delay import GyroDelay
from drivers.icm42688 import settings as icm42688

DriverSettings = bno055.Settings | icm42688.Settings
GYRO_BANDWIDTHS_HZ = (12, 23, 32, 47, 64, 116, 230, 523)


class ChipSettings(Section):
    """What every chip has: where it can be, and the age of its rates."""

    title: ClassVar[str]
    links: ClassVar[tuple[str, ...]]
    addresses: ClassVar[tuple[int, ...]]

    @property
    def summary(self) -> str:
        """Its main settings in a few words."""
        raise NotImplementedError

    def driver_settings(self) -> DriverSettings:
        """Return what the driver writes to the chip and reads back."""
        raise NotImplementedError

    @property
    def delay(self) -> GyroDelay:
        """How old the rates are when they are read.

        It follows from the configuration, so that a replay knows it too. What flies is what is
        configured: the drivers read the settings back from the chip, a pod on CAN confirms them,
        and a log carries the configuration it was flown with.
        """
        return self.driver_settings().delay

    def misfit(self, link: Link) -> str | None:
        """Return why the chip cannot be behind a link, or None."""
        if link.kind not in self.links:
            wanted = " or ".join(f'"{kind}"' for kind in self.links)
            return f'link.kind = "{link.kind}": the {self.title} wants {wanted}'
        if isinstance(link, I2cLink) and link.address not in self.addresses:
            wanted = " or ".join(f"0x{address:02X}" for address in self.addresses)
            return f"link.address = 0x{link.address:02X}: the {self.title} answers at {wanted}"
        return None


class Bno055Settings(ChipSettings):
    """How the BNO055, the chip if `kind` is absent, is set; read back when it is opened."""

    title: ClassVar[str] = "BNO055"
    links: ClassVar[tuple[str, ...]] = ("i2c", "uart", "can")
    addresses: ClassVar[tuple[int, ...]] = bno055.ADDRESSES

    # Not written, so that a configuration of these chips is what it was before there were others.
    kind: Literal["bno055"] = Field(default="bno055", exclude=True)
    mode: Literal["gyronly", "amg", "ndof", "imu"] = "amg"
    """Operation mode; fusion modes (imu, ndof) override range and bandwidth."""
    gyro_range_dps: Literal[125, 250, 500, 1000, 2000] = 2000
    """Full scale, deg/s."""
    gyro_bandwidth_hz: Literal[12, 23, 32, 47, 64, 116, 230, 523] = 32
    """Low-pass of the gyro, Hz."""
    external_crystal: bool = False
    """Whether a 32 kHz crystal is fitted."""
    calibration_file: str | None = None
    """JSON of offsets by chip id: restored at the start, saved at the end if fully calibrated."""
    rate_hz: float = Field(default=100.0, gt=0, le=1000)
    """How often the chip is read, Hz."""

    @property
    def summary(self) -> str:
        """Mode and range."""
        return f"{self.mode.upper()}, {self.gyro_range_dps} deg/s"

    def driver_settings(self) -> bno055.Settings:
        """Return what the driver writes to the chip and reads back."""
        return bno055.Settings(
            mode=bno055.MODE_BY_NAME[self.mode],
            gyro_range_dps=self.gyro_range_dps,
            gyro_bandwidth_hz=self.gyro_bandwidth_hz,
            external_crystal=self.external_crystal,
        )


class Icm42688Settings(ChipSettings):
    """How the ICM-42688-P is set; read back and checked when it is opened."""

    title: ClassVar[str] = "ICM-42688-P"
    links: ClassVar[tuple[str, ...]] = ("spi", "i2c")
    addresses: ClassVar[tuple[int, ...]] = icm42688.ADDRESSES

    kind: Literal["icm42688"]
    accelerometer: bool = True
    """Whether it runs beside the gyro."""
    gyro_range_dps: Literal[125, 250, 500, 1000, 2000] = 2000
    """Full scale, deg/s."""
    accel_range_g: Literal[2, 4, 8, 16] = 16
    """Full scale, g."""
    data_hz: Literal[200, 500, 1000] = 1000
    """Output data rate: how often the registers change, Hz."""
    filter_order: Literal[1, 2, 3] = 2
    """Order of the low-pass of both sensors."""
    gyro_bandwidth_hz: int = Field(
        default=48,
        description="low-pass of both sensors, Hz; at order 2 and 1000 Hz 21, 48, 60, 97, 118, "
        "192 or 231, elsewhere the error names them",
    )
    rate_hz: float = Field(default=100.0, gt=0, le=1000)
    """How often the chip is read, Hz."""

    @model_validator(mode="after")
    def _chip_has_them(self) -> "Icm42688Settings":
        self.driver_settings()
        if self.rate_hz > self.data_hz:
            msg = (
                f"rate_hz = {self.rate_hz:g} is above data_hz = {self.data_hz}, the registers' rate"
            )
            raise ValueError(msg)
        return self

    @property
    def summary(self) -> str:
        """Bandwidth and range."""
        return f"{self.gyro_bandwidth_hz} Hz, {self.gyro_range_dps} deg/s"

    def driver_settings(self) -> icm42688.Settings:
        """Return what the driver writes to the chip and reads back."""
        return icm42688.Settings(
            has_accel=self.accelerometer,
            gyro_range_dps=self.gyro_range_dps,
            accel_range_g=self.accel_range_g,
            data_hz=self.data_hz,
            filter_order=self.filter_order,
            gyro_bandwidth_hz=self.gyro_bandwidth_hz,
        )


def _kind(value: Any) -> Any:
    """Return the chip of a table: without ``kind`` it is a BNO055."""
    if isinstance(value, dict):
        return value.get("kind", "bno055")
    return getattr(value, "kind", None)


Chip = Annotated[
    Annotated[Bno055Settings, Tag("bno055")] | Annotated[Icm42688Settings, Tag("icm42688")],
    Discriminator(
        _kind,
        custom_error_type="chip_kind",
        custom_error_message='wants a table with kind = "bno055" or "icm42688"',
    ),
]
