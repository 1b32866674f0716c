"""Buses and cameras of this machine; every refusal names the device and the remedy."""

import errno
import os
from functools import partial
from pathlib import Path

import serial
import smbus2

from avionics.config import Camera, FlightConfig, Pod, RootImu
from avionics.config.links import FileCamera, GStreamerCamera, Link, SpiLink
from avionics.config.links import SocketCamera as SocketSource
from avionics.config.links import V4l2Camera as V4l2Source
from avionics.errors import ConfigError
from avionics.flight.assemble import assemble
from avionics.flight.rig import Rig
from drivers.cameras import FrameProcess, V4l2Camera, VideoFile, jetson_csi_line
from drivers.cameras.socket import SocketCamera
from drivers.can.pod.codec import filters
from drivers.can.port import CanPort
from drivers.can.python_can import open_can
from drivers.clock import Clock, SteadyClock
from drivers.errors import DeviceNotFoundError
from drivers.interfaces import I2cBus, ImuSource, SerialPort, Source, SpiDevice
from drivers.polled_imus import PolledImus
from drivers.reopening import ReopeningI2cBus, ReopeningSerial
from drivers.samples import Frame
from drivers.spi import open_spi


class HardwareBuses:
    """Opens the devices of this machine; a ``Buses``.

    Parameters
    ----------
    clock : Clock
        The steady clock.
    """

    keeps_calibration = True

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def link(self, pod: Pod | RootImu) -> Link:
        """Return how a pod is connected."""
        if pod.link is None:
            msg = (
                f'{pod.title}: has no link; add e.g. link = {{ kind = "i2c", bus = 1, '
                "address = 0x28 } to fly it"
            )
            raise ConfigError(msg)
        return pod.link

    def polling_clock(self) -> Clock:
        """Return the steady clock: every bus is read in a thread of its own."""
        return self._clock

    def i2c(self, number: int, clock: Clock) -> I2cBus:
        """Open /dev/i2c-``number``, again whenever it comes back."""
        try:
            return ReopeningI2cBus(partial(smbus2.SMBus, number))
        except OSError as error:
            raise DeviceNotFoundError(_i2c_advice(number, error)) from error

    def spi(self, link: SpiLink, clock: Clock) -> SpiDevice:
        """Open a chip select, again whenever it comes back."""
        return open_spi(link.bus, link.device, speed_hz=link.speed_hz, mode=link.mode)

    def serial(self, port: str, baud: int, clock: Clock) -> SerialPort:
        """Open a serial port for us alone, again whenever it comes back."""
        try:
            return ReopeningSerial(
                partial(serial.Serial, port, baud, timeout=0.05, write_timeout=0.5, exclusive=True)
            )
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise DeviceNotFoundError(_serial_advice(port, error)) from error

    def can(self, interface: str, channel: str, bitrate: int | None) -> CanPort:
        """Open a CAN bus for the frames of pods."""
        return open_can(interface, channel, self._clock, bitrate=bitrate, identifiers=filters())

    def polled(self, imus: PolledImus, clock: Clock) -> ImuSource:
        """Return the source itself."""
        return imus

    def camera(self, camera: Camera) -> Source[Frame] | None:
        """Open the source of a camera; None if it has none."""
        return None if camera.source is None else open_camera(camera, self._clock)


def open_rig(config: FlightConfig, clock: Clock | None = None) -> Rig:
    """Open everything that a configuration names on this machine and wait until it delivers.

    Parameters
    ----------
    config : Config or WingsConfig
        What flies.
    clock : Clock, optional
        The one clock of all samples; the steady clock if absent.

    Raises
    ------
    ConfigError, DeviceNotFoundError, DriverError
        As ``assemble``.
    """
    clock = SteadyClock() if clock is None else clock
    return assemble(config, HardwareBuses(clock), clock)


def _i2c_advice(number: int, error: OSError) -> str:
    node = f"/dev/i2c-{number}"
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        remedy = "`modprobe i2c-dev`, enable the bus, and see `i2cdetect -l` for its number"
        return f"i2c bus {number}: {node} does not exist; {remedy}"
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"i2c bus {number}: no permission for {node}; add the user to the group i2c"
    return f"i2c bus {number}: {node} does not open: {error.strerror} (errno {error.errno})"


def _serial_advice(port: str, error: OSError | ValueError) -> str:
    number = getattr(error, "errno", None)
    remedy = "see `ls /dev/tty*` for the port's name"
    if number in (errno.EACCES, errno.EPERM):
        remedy = "add the user to the group dialout"
    elif number in (errno.EAGAIN, errno.EBUSY):
        remedy = f"another program holds it; see `fuser -v {port}` for which"
    why = os.strerror(number) if number else str(error)
    return f"serial port {port} does not open: {why}; {remedy}"


def open_camera(camera: Camera, clock: Clock) -> Source[Frame]:
    """Open the source of a camera.

    Parameters
    ----------
    camera : Camera
        The camera; its mode and exposure are asked of the source.
    clock : Clock
        The steady clock.

    Raises
    ------
    ConfigError
        If it has no source.
    DriverError
        If the source is missing or fails.
    """
    match camera.source:
        case FileCamera(path=path):
            return VideoFile(Path(path), clock, camera=camera.name)
        case V4l2Source() as source:
            return V4l2Camera(
                source.device,
                clock,
                camera=camera.name,
                width_px=camera.width_px,
                height_px=camera.height_px,
                fps=camera.fps,
                exposure_us=source.exposure_us,
                gain=source.gain,
                white_balance_k=source.white_balance_k,
                stamp_to_middle_s=_stamp_to_middle_s(source.exposure_us, camera.exposure_s),
            )
        case GStreamerCamera() as source:
            line = source.pipeline or jetson_csi_line(
                sensor_id=source.sensor_id,
                width_px=camera.width_px,
                height_px=camera.height_px,
                fps=camera.fps,
                exposure_us=source.exposure_us,
                gain=source.gain,
                white_balance=source.white_balance,
            )
            process = FrameProcess(
                line,
                clock,
                camera=camera.name,
                fps=camera.fps,
                stamp_to_middle_s=_stamp_to_middle_s(source.exposure_us, camera.exposure_s),
            )
            try:
                process.open()
            except BaseException:
                process.close()
                raise
            return process
        case SocketSource(path=path):
            return SocketCamera(Path(path), clock, camera=camera.name, fps=camera.fps)
    msg = f"camera {camera.name}: no source; add [camera.source]"
    raise ConfigError(msg)


def _stamp_to_middle_s(exposure_us: int | None, exposure_s: float) -> float:
    """Stamps are taken at the start of the read-out, when the exposure is over."""
    return -0.5 * (exposure_s if exposure_us is None else exposure_us * 1e-6)
