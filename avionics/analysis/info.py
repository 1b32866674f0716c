"""What a log holds, in plain lines: what flew, how long, what came and what was lost."""

from dataclasses import dataclass, field
from pathlib import Path

from avionics.config import Config, FlightConfig
from avionics.errors import AvionicsError
from avionics.recording import Damage, EncodedFrame, LogReader
from avionics.records import Event, Health, MarkerTracks
from drivers.samples import ImuSample


@dataclass(slots=True)
class TopicInfo:
    """One topic of a log.

    Attributes
    ----------
    name : str
        The topic.
    count : int
        Records on it.
    first_ns, last_ns : int
        Arrival of the first and the last, ns of the steady clock.
    lost : int or None
        Numbers missing in the source's own count; None where it had none, as in imported sets.
    note : str
        What else is worth knowing, e.g. the share of markers found.
    """

    name: str
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    lost: int | None = 0
    note: str = ""

    @property
    def lost_text(self) -> str:
        """``lost`` for a table."""
        return "-" if self.lost is None else str(self.lost)

    @property
    def rate_hz(self) -> float:
        """Mean rate, Hz; NaN for a single record."""
        length_ns = self.last_ns - self.first_ns
        return (self.count - 1) * 1e9 / length_ns if length_ns > 0 else float("nan")


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
        What flew; None if it cannot be read, then ``config_error`` says why.
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
    """

    path: Path
    size_bytes: int
    metadata: dict[str, str]
    config: FlightConfig | None
    config_error: str
    attachments: dict[str, int]
    topics: dict[str, TopicInfo] = field(default_factory=dict)
    counters: dict[str, dict[str, int]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    damage: Damage = field(default_factory=Damage)

    @property
    def duration_s(self) -> float:
        """From the first arrival to the last, s."""
        if not self.topics:
            return 0.0
        first_ns = min(topic.first_ns for topic in self.topics.values())
        return (max(topic.last_ns for topic in self.topics.values()) - first_ns) * 1e-9


def read_info(path: Path) -> LogInfo:
    """Return what a log holds.

    Raises
    ------
    RecordingError
        If it is no log of ours.
    """
    reader = LogReader(path)
    config, config_error = None, ""
    try:
        config = reader.config
    except AvionicsError as error:
        config_error = str(error)
    info = LogInfo(
        path,
        path.stat().st_size,
        reader.metadata,
        config,
        config_error,
        {name: len(data) for name, data in reader.attachments.items()},
    )
    is_imported = reader.metadata.get("command") == "import"
    numbers: dict[str, int] = {}
    markers: dict[str, tuple[int, int]] = {}
    for topic, record, arrival_ns in reader.messages(decode_images=False):
        entry = info.topics.setdefault(topic, TopicInfo(topic, first_ns=arrival_ns))
        entry.count += 1
        entry.last_ns = arrival_ns
        if isinstance(record, ImuSample | EncodedFrame):
            number = record.seq if isinstance(record, ImuSample) else record.index
            if is_imported and isinstance(record, ImuSample):
                entry.lost = None
            if entry.lost is not None:
                entry.lost += max(0, number - numbers.get(topic, number - 1) - 1)
            numbers[topic] = number
        elif isinstance(record, MarkerTracks):
            found, total = markers.get(topic, (0, 0))
            markers[topic] = found + int(record.found.sum()), total + record.found.size
        elif isinstance(record, Health):
            info.counters[record.source] = record.counters
        elif isinstance(record, Event) and record.level != "info":
            info.events.append(record)
    for topic, (found, total) in markers.items():
        info.topics[topic].note = f"{found / max(total, 1):.1%} of markers found"
    info.damage = reader.damage
    return info


def info_text(path: Path) -> str:
    """Return ``read_info`` as plain lines for the terminal.

    Raises
    ------
    RecordingError
        If it is no log of ours.
    """
    info = read_info(path)
    lines = [
        f"{path}  {info.size_bytes / 1e6:.2f} MB, {info.duration_s:.2f} s",
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
        told = ", ".join(f"{name} {count}" for name, count in counters.items() if count)
        if told:
            lines.append(f"    {source}: {told}")
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
