"""What ``avionics doctor`` finds of a configuration's devices, and how to mend the rest."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from avionics.config import Camera, FlightConfig, Pod, RootImu
from avionics.config.links import CanLink, GStreamerCamera, I2cLink, SpiLink, UartLink
from avionics.errors import ConfigError
from avionics.flight.assemble import Buses, check_chip_ids, imu_sources, mounts_of
from avionics.flight.hardware import HardwareBuses
from drivers.clock import Clock, SteadyClock
from drivers.errors import DeviceNotFoundError, DriverError


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that ``avionics doctor`` looked at.

    Attributes
    ----------
    ok : bool
        Whether it is as it has to be.
    what, found, remedy : str
        What was looked at, what was there, and how to mend it (empty if there is nothing to).
    """

    ok: bool
    what: str
    found: str
    remedy: str = ""


def probe(
    config: FlightConfig, clock: Clock | None = None, buses: Buses | None = None
) -> list[Finding]:
    """Return what of a configuration is there and what is missing.

    Every bus and device is opened and closed again; nothing is left running.

    Parameters
    ----------
    config : Config or WingsConfig
        The configuration.
    clock : Clock, optional
        The steady clock if absent.
    buses : Buses, optional
        This machine's if absent.
    """
    clock = SteadyClock() if clock is None else clock
    buses = HardwareBuses(clock) if buses is None else buses
    desk = _Desk(clock, buses, config)
    findings = [
        _try(f"{imu.title} on {_place(imu)}", imu.title, partial(desk.look_at, imu))
        for imu in _imus(config)
    ]
    if not config.pods:
        findings.append(Finding(ok=False, what="pods", found="none", remedy="add [[pods]] tables"))
    for camera in config.cameras:
        findings.append(_probe_camera(camera, buses))
    if not config.cameras:
        findings.append(Finding(ok=True, what="camera", found="none configured: gyros alone"))
    findings.append(_probe_disk())
    return findings


class _Desk:
    """Looks at one pod after the other."""

    def __init__(self, clock: Clock, buses: Buses, config: FlightConfig) -> None:
        self._clock, self._buses = clock, buses
        # All that is connected: a bus with several multiplexers is set as in flight.
        self._mounts = mounts_of((imu for imu in _imus(config) if imu.link is not None), buses)
        self._chip_ids: dict[str, bytes] = {}

    def look_at(self, pod: Pod | RootImu) -> str:
        """Return what was found of a pod; raises where it cannot fly."""
        self._buses.link(pod)
        (source,) = imu_sources(self._mounts, self._buses, self._clock, only=pod.name)
        try:
            source.open()
            self._chip_ids |= source.chip_ids()
            check_chip_ids(self._chip_ids)
            sample = source.read(1.0)
        finally:
            source.close()
        if sample is None:
            msg = (
                f"{pod.title}: set up, but no sample within 1 s; see `avionics run` for its "
                "counters"
            )
            raise DeviceNotFoundError(msg)
        return f"{pod.chip.title} answers; {pod.chip.summary}, samples come"


def _imus(config: FlightConfig) -> list[Pod | RootImu]:
    return [*config.pods, *([] if config.root is None else [config.root])]


def _place(pod: Pod | RootImu) -> str:
    match pod.link:
        case I2cLink() as link:
            mux = (
                "" if link.mux_address is None else f" behind multiplexer 0x{link.mux_address:02X}"
            )
            return f"/dev/i2c-{link.bus} at 0x{link.address:02X}{mux}"
        case SpiLink() as link:
            return f"/dev/spidev{link.bus}.{link.device}"
        case UartLink() as link:
            return link.port
        case CanLink() as link:
            return f"{link.interface} {link.channel}, node {link.node}"
    return "nothing"


def _try(what: str, name: str, look: Callable[[], str]) -> Finding:
    """Look; a message that begins with the device's name need not repeat it."""
    try:
        return Finding(ok=True, what=what, found=look())
    except (DriverError, ConfigError) as error:
        found, _, remedy = str(error).removeprefix(f"{name}: ").partition("; ")
        return Finding(ok=False, what=what, found=found, remedy=remedy or _remedy(error))


def _remedy(error: Exception) -> str:
    text = str(error)
    if "chip id" in text or "no answer" in text:
        return (
            "check supply, wiring, pull-ups and address (COM3 or AP_AD0); `i2cdetect -y` shows who "
            "answers"
        )
    return "see the driver's message"


def _probe_camera(camera: Camera, buses: Buses) -> Finding:
    what = f"camera {camera.name}"
    if isinstance(camera.source, GStreamerCamera) and shutil.which("gst-launch-1.0") is None:
        remedy = "apt install gstreamer1.0-tools gstreamer1.0-plugins-{base,good,bad}"
        return Finding(ok=False, what=what, found="GStreamer is not installed", remedy=remedy)

    def look() -> str:
        source = buses.camera(camera)
        if source is None:
            remedy = 'add [camera.source], e.g. kind = "v4l2", device = "/dev/video0"'
            msg = f"has no source; {remedy}"
            raise ConfigError(msg)
        try:
            frame = source.read(5.0)
        finally:
            source.close()
        if frame is None:
            msg = f"{what}: no frame within 5 s; check cable and sensor number"
            raise DeviceNotFoundError(msg)
        height, width = frame.image.shape[:2]
        if (width, height) != (camera.width_px, camera.height_px):
            msg = (
                f"{what}: frames of {width} x {height} px, the configuration says "
                f"{camera.width_px} x {camera.height_px}; make them agree"
            )
            raise DeviceNotFoundError(msg)
        return f"frames of {width} x {height} px come"

    return _try(what, what, look)


def _probe_disk() -> Finding:
    free_bytes = shutil.disk_usage(Path.cwd()).free
    is_enough = free_bytes > 2 << 30
    remedy = "" if is_enough else "free at least 2 GB: an hour of JPEG frames takes about that"
    found = f"{free_bytes / 2**30:.1f} GB free"
    return Finding(ok=is_enough, what="disk of the working folder", found=found, remedy=remedy)
