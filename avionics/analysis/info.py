"""Summary of a log in plain lines: what flew, for how long, what was recorded and lost."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from avionics.analysis.flight import Flight
from avionics.analysis.series import TimeArray
from avionics.config import Config, FlightConfig
from avionics.errors import AvionicsError
from avionics.recording import Damage
from avionics.records import Event


@dataclass(slots=True)
class TopicInfo:
    """One topic of a log.

    Attributes
    ----------
    name : str
        The topic.
    count : int
        Records on it.
    rate_hz : float
        Mean rate by arrival, Hz; NaN for a single record.
    lost : int or None
        Numbers missing in the source's own count; None where it had none, as in imported sets.
    note : str
        What else is worth knowing, e.g. the share of markers found.
    """

    name: str
    count: int
    rate_hz: float
    lost: int | None = 0
    note: str = ""

    @property
    def lost_text(self) -> str:
        """``lost`` for a table."""
        return "-" if self.lost is None else str(self.lost)


@dataclass(slots=True)
class LogInfo:
    """A log at a glance.

    Attributes
    ----------
    path : Path
        The file.
    size_bytes : int
        Its size.
    metadata : dict of str to str
        Versions, clock offset and what the command added.
    config : Config, WingsConfig or None
        What flew; None if it cannot be read, then ``config_error`` gives the reason.
    config_error : str
        Empty, or why there is no configuration.
    attachments : dict of str to int
        Sizes of the attached files, bytes.
    topics : dict of str to TopicInfo
        By topic, in order of appearance.
    counters : dict of str to dict of str to int
        Last reported counters by source.
    events : list of Event
        Warnings and errors.
    damage : Damage
        What could not be read.
    duration_s : float
        From the first arrival to the last, s.
    """

    path: Path
    size_bytes: int
    metadata: dict[str, str]
    config: FlightConfig | None
    config_error: str
    attachments: dict[str, int]
    topics: dict[str, TopicInfo]
    counters: dict[str, dict[str, int]]
    events: list[Event]
    damage: Damage
    duration_s: float


def log_info(flight: Flight) -> LogInfo:
    """Return what a log holds."""
    config, config_error = None, ""
    try:
        config = flight.config
    except AvionicsError as error:
        config_error = str(error)
    return LogInfo(
        flight.path,
        flight.path.stat().st_size,
        flight.metadata,
        config,
        config_error,
        {name: len(data) for name, data in flight.attachments.items()},
        _topics(flight),
        flight.health.last,
        [event for event in flight.events if event.level != "info"],
        flight.damage,
        flight.duration_s,
    )


def _topics(flight: Flight) -> dict[str, TopicInfo]:
    topics = {name: TopicInfo(name, one.count, one.rate_hz) for name, one in flight.topics.items()}
    is_imported = flight.metadata.get("command") == "import"
    for samples in flight.imu.values():
        topics[samples.topic].lost = None if is_imported else _lost(samples.seq)
    for camera in flight.cameras.values():
        if camera.frames is not None:
            topics[camera.frames.topic].lost = _lost(camera.frames.index)
        if camera.tracks is not None:
            found = camera.tracks.found
            share = int(found.sum()) / max(found.size, 1)
            topics[camera.tracks.topic].note = f"{share:.1%} of markers found"
    return topics


def _lost(number: TimeArray) -> int:
    """Return how many numbers a count leaves out where it goes on."""
    return int(np.maximum(np.diff(number) - 1, 0).sum())


def info_text(flight: Flight) -> str:
    """Return ``log_info`` as plain lines for the terminal."""
    info = log_info(flight)
    lines = [
        f"{info.path}  {info.size_bytes / 1e6:.2f} MB, {info.duration_s:.2f} s",
        f"  {info.damage.text()}",
        *(f"  {key}: {value}" for key, value in sorted(info.metadata.items())),
        *_config_lines(info),
        "",
        f"  {'topic':36} {'records':>8} {'rate Hz':>8} {'lost':>6}",
    ]
    for topic in info.topics.values():
        rate = f"{topic.rate_hz:8.2f}" if topic.count > 1 and topic.rate_hz > 0 else f"{'-':>8}"
        line = f"  {topic.name:36} {topic.count:8} {rate} {topic.lost_text:>6}  {topic.note}"
        lines.append(line.rstrip())
    if not info.topics:
        lines.append("  no records")
    lines += ["", "  attachments:"]
    lines += [f"    {name} ({size} bytes)" for name, size in info.attachments.items()]
    lines += _trouble_lines(info)
    return "\n".join(lines)


def _config_lines(info: LogInfo) -> list[str]:
    if info.config is None:
        return [f"  configuration: {info.config_error}"]
    config = info.config
    form = config.estimator.form
    return [
        *(_wing_line(one) for one in config.wing_configs),
        f"  estimator: {', '.join(config.estimators)}, form '{form}';"
        f" tracker: {config.tracker.name}",
    ]


def _wing_line(config: Config) -> str:
    wing = config.wing
    return (
        f"  wing '{wing.name}': span {wing.span_m} m, {len(config.pods)} pods,"
        f" {len(config.markers)} markers,"
        f" {'no camera' if config.camera is None else f'camera {config.camera.name!r}'}"
    )


MAX_EVENTS = 20


def _trouble_lines(info: LogInfo) -> list[str]:
    lines = []
    for source, counters in info.counters.items():
        counted = ", ".join(f"{name} {count}" for name, count in counters.items() if count)
        if counted:
            lines.append(f"    {source}: {counted}")
    if lines:
        lines = ["  counters at the end:", *lines]
    if info.events:
        lines.append("  warnings and errors:")
        lines += [
            f"    t = {event.t_ns * 1e-9:.3f} s {event.level}: {event.source}: {event.message}"
            for event in info.events[:MAX_EVENTS]
        ]
        if len(info.events) > MAX_EVENTS:
            lines.append(f"    and {len(info.events) - MAX_EVENTS} more")
    return lines
