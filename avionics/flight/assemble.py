"""A rig of hardware: opened to fly, or looked at by ``avionics doctor``."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from avionics.config import Config, Pod
from avionics.config.links import CanLink, GStreamerCamera, I2cLink, UartLink
from avionics.errors import ConfigError
from avionics.flight.doctor import imu_openers, open_camera
from avionics.flight.rig import Rig
from drivers.clock import Clock, SteadyClock
from drivers.errors import DeviceNotFoundError, DriverError


def open_rig(config: Config, clock: Clock | None = None) -> Rig:
    """Open everything that a configuration names and wait until it delivers.

    Parameters
    ----------
    config : Config
        The configuration.
    clock : Clock, optional
        The one clock of all samples; the steady clock if absent.

    Raises
    ------
    ConfigError
        If a pod has no link, or the links contradict each other.
    DeviceNotFoundError
        If a device is missing or not what it should be; the message names it and the remedy.
    DriverError
        If a device fails while it is set.
    """
    rig = Rig(SteadyClock() if clock is None else clock)
    try:
        # The camera first: it takes seconds, in which the buses would fill with unread frames.
        if config.camera is not None and config.camera.source is not None:
            rig.cameras.append(open_camera(config.camera, rig.clock))
        for open_source in imu_openers(config.pods, rig.clock):
            rig.imus.append(open_source())
    except BaseException:
        rig.close()
        raise
    return rig


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


def probe(config: Config, clock: Clock | None = None) -> list[Finding]:
    """Return what of a configuration is there and what is missing.

    Every bus and device is opened and closed again; nothing is left running.

    Parameters
    ----------
    config : Config
        The configuration.
    clock : Clock, optional
        The steady clock if absent.
    """
    clock = SteadyClock() if clock is None else clock
    findings = [
        _try(f"pod {pod.id} on {_place(pod)}", partial(_probe_pod, pod, clock))
        for pod in config.pods
    ]
    if not config.pods:
        findings.append(Finding(ok=False, what="pods", found="none", remedy="add [[pods]] tables"))
    findings.append(_probe_camera(config, clock))
    findings.append(_probe_disk())
    return findings


def _place(pod: Pod) -> str:
    match pod.link:
        case I2cLink() as link:
            mux = (
                "" if link.mux_address is None else f" behind multiplexer 0x{link.mux_address:02X}"
            )
            return f"/dev/i2c-{link.bus} at 0x{link.address:02X}{mux}"
        case UartLink() as link:
            return link.port
        case CanLink() as link:
            return f"{link.interface} {link.channel}, node {link.node}"
    return "nothing"


def _try(what: str, look: Callable[[], str]) -> Finding:
    try:
        return Finding(ok=True, what=what, found=look())
    except (DriverError, ConfigError) as error:
        found, _, remedy = str(error).partition("; ")
        return Finding(ok=False, what=what, found=found, remedy=remedy or _remedy(error))


def _remedy(error: Exception) -> str:
    text = str(error)
    if "chip id" in text or "no answer" in text:
        return "check supply, wiring, pull-ups and address (COM3); `i2cdetect -y` shows who answers"
    return "see the driver's message"


def _probe_pod(pod: Pod, clock: Clock) -> str:
    (opener,) = imu_openers([pod], clock)
    source = opener()
    try:
        sample = source.read(1.0)
    finally:
        source.close()
    if sample is None:
        msg = f"pod {pod.id}: set up, but no sample within 1 s; see `avionics run` for its counters"
        raise DeviceNotFoundError(msg)
    return f"{pod.chip.title} answers; {pod.chip.summary}, samples come"


def _probe_camera(config: Config, clock: Clock) -> Finding:
    camera = config.camera
    if camera is None:
        return Finding(ok=True, what="camera", found="none configured: gyros alone")
    what = f"camera {camera.name}"
    if camera.source is None:
        remedy = 'add [camera.source], e.g. kind = "v4l2", device = "/dev/video0"'
        return Finding(ok=False, what=what, found="has no source", remedy=remedy)
    if isinstance(camera.source, GStreamerCamera) and shutil.which("gst-launch-1.0") is None:
        remedy = "apt install gstreamer1.0-tools gstreamer1.0-plugins-{base,good,bad}"
        return Finding(ok=False, what=what, found="GStreamer is not installed", remedy=remedy)

    def look() -> str:
        source = open_camera(camera, clock)
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

    return _try(what, look)


def _probe_disk() -> Finding:
    free_bytes = shutil.disk_usage(Path.cwd()).free
    is_enough = free_bytes > 2 << 30
    remedy = "" if is_enough else "free at least 2 GB: an hour of JPEG frames takes about that"
    found = f"{free_bytes / 2**30:.1f} GB free"
    return Finding(ok=is_enough, what="disk of the working folder", found=found, remedy=remedy)
