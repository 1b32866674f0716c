"""Configuration of what is connected: buses and picture sources; the chips are in ``chips``."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

JetsonWhiteBalance = Literal[
    "off", "auto", "incandescent", "fluorescent", "warm-fluorescent", "daylight",
    "cloudy-daylight", "twilight", "shade",
]  # fmt: skip


class Section(BaseModel):
    """Base of every table: unknown keys are errors, values never change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class I2cLink(Section):
    """A chip on an I2C bus."""

    kind: Literal["i2c"] = "i2c"
    bus: int = Field(default=1, ge=0, description="N of /dev/i2c-N")
    address: int = Field(default=0x28, ge=0x08, le=0x77)
    """Address of the chip: BNO055 0x28, or 0x29 with COM3 high; ICM-42688-P 0x68 or 0x69."""
    mux_address: int | None = Field(default=None, ge=0x70, le=0x77, description="TCA9548A")
    mux_channel: int = Field(default=0, ge=0, le=7)
    """Channel of the multiplexer."""

    @model_validator(mode="after")
    def _channel_has_a_multiplexer(self) -> "I2cLink":
        # A stored configuration names both keys, absent ones as null.
        if "mux_channel" in self.model_fields_set and "mux_address" not in self.model_fields_set:
            msg = (
                f"mux_channel = {self.mux_channel} without mux_address; add mux_address = 0x70 (to "
                "0x77, as its pins say), or leave mux_channel out"
            )
            raise ValueError(msg)
        return self


class UartLink(Section):
    """A BNO055 on a serial port."""

    kind: Literal["uart"]
    port: str
    """Serial device, e.g. /dev/ttyUSB0."""
    baud: int = 115200
    """Line speed; the BNO055 knows 115200 only."""


class CanLink(Section):
    """A pod on a CAN bus."""

    kind: Literal["can"]
    interface: str = Field(default="socketcan", description="python-can interface name")
    channel: str = "can0"
    """Name of the channel, e.g. can0."""
    bitrate: int | None = None
    """Bit rate where the interface sets it, bit/s."""
    node: int = Field(default=1, ge=0, le=15, description="pod number on the bus")
    triggered: bool = False
    """Whether each sync makes all pods of the bus sample at once, at their rate_hz."""


class SpiLink(Section):
    """A chip on an SPI bus, with a chip select of its own."""

    kind: Literal["spi"]
    bus: int = Field(default=0, ge=0, description="B of /dev/spidevB.C")
    device: int = Field(default=0, ge=0, description="C of /dev/spidevB.C: the chip select")
    speed_hz: int = Field(default=1_000_000, ge=10_000, le=24_000_000)
    """Clock of the bus, Hz."""
    mode: Literal[0, 3] = 0
    """Polarity and phase of the clock."""


Link = Annotated[I2cLink | SpiLink | UartLink | CanLink, Field(discriminator="kind")]


class FileCamera(Section):
    """A recorded video as camera."""

    kind: Literal["file"]
    path: str
    """Video file."""


class V4l2Camera(Section):
    """A V4L2 device."""

    kind: Literal["v4l2"]
    device: str = "/dev/video0"
    """Device node."""
    exposure_us: int | None = Field(default=None, gt=0)
    """Fixed exposure, us; automatic if absent."""
    gain: int | None = Field(default=None, ge=0)
    """Fixed gain, device units."""
    white_balance_k: int | None = Field(default=None, gt=0)
    """Fixed white balance, K."""


class GStreamerCamera(Section):
    """A GStreamer child process; the default line is the Jetson's CSI camera."""

    kind: Literal["gstreamer"] = "gstreamer"
    pipeline: str | None = Field(default=None, description="up to raw video; None = Jetson CSI")
    sensor_id: int = 0
    """CSI port."""
    exposure_us: int | None = Field(
        default=None,
        gt=0,
        description="fixed exposure, us; absent = automatic. Beside a pipeline "
        "of your own: what it sets, for the time stamps",
    )
    gain: float | None = Field(default=None, ge=1)
    """Fixed gain."""
    white_balance: JetsonWhiteBalance | None = Field(
        default=None, description="fixed; absent = off if the exposure is fixed, otherwise auto"
    )

    @model_validator(mode="after")
    def _settings_have_a_place(self) -> "GStreamerCamera":
        named = [name for name in ("gain", "white_balance") if getattr(self, name) is not None]
        if self.pipeline is not None and named:
            msg = (
                f"{named[0]} is for the Jetson's own line; leave it out and set it in the pipeline"
            )
            raise ValueError(msg)
        return self


class SocketCamera(Section):
    """Pictures of another program on this machine, through a Unix socket (`avionics rig serve`)."""

    kind: Literal["socket"]
    path: str
    """The socket on which that program listens."""


CameraSource = Annotated[
    FileCamera | V4l2Camera | GStreamerCamera | SocketCamera, Field(discriminator="kind")
]
