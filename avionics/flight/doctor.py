"""From the links of a configuration to drivers on their buses."""

import errno
import os
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import serial
import smbus2

from avionics.config import Camera, Pod
from avionics.config.links import (
    CanLink,
    FileCamera,
    GStreamerCamera,
    I2cLink,
    UartLink,
)
from avionics.config.links import SocketCamera as SocketSource
from avionics.config.links import V4l2Camera as V4l2Source
from avionics.errors import ConfigError
from avionics.flight.chips import make_chip, pod_settings
from drivers.bno055.ports import I2cRegisterPort, Tca9548a, UartRegisterPort
from drivers.cameras import FrameProcess, V4l2Camera, VideoFile, jetson_csi_line
from drivers.cameras.socket import SocketCamera
from drivers.can.imus import CanImus
from drivers.can.pod.codec import filters
from drivers.can.python_can import open_can
from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError
from drivers.interfaces import Source
from drivers.polled_imus import PolledImus
from drivers.reopening import ReopeningI2cBus, ReopeningSerial
from drivers.samples import Frame, ImuSample

CanBus = tuple[str, str, int | None]


def imu_openers(pods: Iterable[Pod], clock: Clock) -> list[Callable[[], Source[ImuSample]]]:
    """Return one call per bus that opens it with all its pods and waits until they deliver.

    Parameters
    ----------
    pods : iterable of Pod
        Pods with their links.
    clock : Clock
        The steady clock.

    Raises
    ------
    ConfigError
        If a pod has no link. The calls raise it where links contradict each other, and
        ``DriverError`` where a device is missing or fails.
    """
    i2c: dict[int, list[Pod]] = {}
    can: dict[CanBus, list[Pod]] = {}
    openers: list[Callable[[], Source[ImuSample]]] = []
    for pod in pods:
        match pod.link:
            case I2cLink(bus=bus):
                i2c.setdefault(bus, []).append(pod)
            case CanLink(interface=interface, channel=channel, bitrate=bitrate):
                can.setdefault((interface, channel, bitrate), []).append(pod)
            case UartLink(port=port, baud=baud):
                openers.append(partial(_open_uart, pod, port, baud, clock))
            case None:
                msg = (
                    f'pod {pod.id}: has no link; add e.g. link = {{ kind = "i2c", bus = 1, '
                    "address = 0x28 } to fly it"
                )
                raise ConfigError(msg)
    openers += [partial(_open_i2c, bus, group, clock) for bus, group in i2c.items()]
    openers += [partial(_open_can, bus, group, clock) for bus, group in can.items()]
    return openers


def _common_rate_hz(where: str, pods: list[Pod]) -> float:
    rates = {pod.chip.rate_hz for pod in pods}
    if len(rates) > 1:
        msg = f"{where}: pods are read at {sorted(rates)} Hz; one bus has one rate_hz"
        raise ConfigError(msg)
    return rates.pop()


def _open_i2c(number: int, pods: list[Pod], clock: Clock) -> PolledImus:
    rate_hz = _common_rate_hz(f"i2c bus {number}", pods)
    try:
        bus = ReopeningI2cBus(partial(smbus2.SMBus, number))
    except OSError as error:
        raise DeviceNotFoundError(_i2c_advice(number, error)) from error
    muxes: dict[int, Tca9548a] = {}
    chips = []
    for pod in pods:
        assert isinstance(pod.link, I2cLink)
        mux = None
        if pod.link.mux_address is not None:
            mux = muxes.setdefault(pod.link.mux_address, Tca9548a(bus, pod.link.mux_address))
        port = I2cRegisterPort(bus, pod.link.address, mux=mux, channel=pod.link.mux_channel)
        chips.append(make_chip(pod, port, clock))
    return _opened(PolledImus(chips, clock, rate_hz, bus=bus, name=f"i2c bus {number}"))


def _i2c_advice(number: int, error: OSError) -> str:
    node = f"/dev/i2c-{number}"
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        remedy = "`modprobe i2c-dev`, enable the bus, and see `i2cdetect -l` for its number"
        return f"i2c bus {number}: {node} does not exist; {remedy}"
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"i2c bus {number}: no permission for {node}; add the user to the group i2c"
    return f"i2c bus {number}: {node} does not open: {error.strerror} (errno {error.errno})"


def _open_uart(pod: Pod, port: str, baud: int, clock: Clock) -> PolledImus:
    try:
        line = ReopeningSerial(
            partial(serial.Serial, port, baud, timeout=0.05, write_timeout=0.5, exclusive=True)
        )
    except (OSError, ValueError) as error:  # SerialException is an OSError
        number = getattr(error, "errno", None)
        remedy = "see `ls /dev/tty*` for the port's name"
        if number in (errno.EACCES, errno.EPERM):
            remedy = "add the user to the group dialout"
        elif number in (errno.EAGAIN, errno.EBUSY):
            remedy = f"another program holds it; see `fuser -v {port}` for which"
        why = os.strerror(number) if number else str(error)
        msg = f"pod {pod.id}: serial port {port} does not open: {why}; {remedy}"
        raise DeviceNotFoundError(msg) from error
    chip = make_chip(pod, UartRegisterPort(line, clock), clock)
    return _opened(PolledImus([chip], clock, pod.chip.rate_hz, bus=line, name=f"uart {port}"))


def _opened(imus: PolledImus) -> PolledImus:
    try:
        imus.open()
    except BaseException:
        imus.close()
        raise
    return imus


def _open_can(bus: CanBus, pods: list[Pod], clock: Clock) -> CanImus:
    interface, channel, bitrate = bus
    nodes = {pod.link.node: pod for pod in pods if isinstance(pod.link, CanLink)}
    if len(nodes) < len(pods):
        names = ", ".join(pod.name for pod in pods)
        msg = f"can {channel}: pods {names} share a node number; give each its own"
        raise ConfigError(msg)
    trigger_hz = _trigger_hz(f"can {channel}", pods)
    port = open_can(interface, channel, clock, bitrate=bitrate, identifiers=filters())
    imus = CanImus(
        port,
        {node: pod.name for node, pod in nodes.items()},
        clock,
        settings={node: pod_settings(pod) for node, pod in nodes.items()},
        trigger_hz=trigger_hz,
    )
    try:
        imus.open()
    except BaseException:
        imus.close()
        raise
    return imus


def _trigger_hz(where: str, pods: list[Pod]) -> float:
    wanted = {isinstance(pod.link, CanLink) and pod.link.triggered for pod in pods}
    if len(wanted) > 1:
        msg = f"{where}: some pods are triggered, some are not; give all links the same"
        raise ConfigError(msg)
    return _common_rate_hz(where, pods) if wanted.pop() else 0.0


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
