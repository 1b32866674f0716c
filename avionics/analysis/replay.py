"""Replay: the records of a log through the pipeline again, into a new log."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from avionics.config import ByCamera, FlightConfig
from avionics.config.load import apply_overrides, parse_config
from avionics.errors import RecordingError
from avionics.flight.pipelines import Pipelines
from avionics.output_paths import refuse_inputs
from avionics.recording import Damage, EncodedFrame, LogReader, LogWriter, appearing_whole
from avionics.records import Event, Health, MarkerTracks, Truth
from drivers.samples import Frame, ImuSample

if TYPE_CHECKING:
    from avionics.tracking import Tracker

Progress = Callable[[float], None]
TRACKS = ("/camera/*/tracks",)
INPUTS = frozenset(["/camera/*/image", "/imu/*", *TRACKS, "/wing/*/truth", "/health", "/event"])
"""What a replay reads of a log: the estimates are made again."""
REMADE = ("pod ", "root", "camera ", "estimator", "gs")
"""Sources whose counters and events the pipeline makes again."""


@dataclass(frozen=True, slots=True)
class ReplaySummary:
    """What a replay did.

    Attributes
    ----------
    records : int
        Records of the old log that went through.
    tracked : int
        Frames whose markers were tracked again.
    untracked : int
        Frames that could not be: no markers in the configuration.
    damage : Damage
        What could not be read of the old log.
    """

    records: int
    tracked: int
    untracked: int
    damage: Damage


def replay(
    log: Path,
    output: Path,
    *,
    config: FlightConfig | None = None,
    overrides: tuple[str, ...] = (),
    tracker: str | None = None,
    retrack: bool = False,
    images: bool = True,
    force: bool = False,
    progress: Progress | None = None,
) -> ReplaySummary:
    """Run the pipeline again on what a log recorded; the same log gives bit-identical estimates.

    Parameters
    ----------
    log, output : Path
        The log to read and the log to write.
    config : Config or WingsConfig, optional
        Instead of the log's own.
    overrides : tuple of str
        ``key=value`` pairs applied on top.
    tracker : str, optional
        Another tracker than the configuration's, by its name there.
    retrack : bool
        Track the images although the log holds tracks.
    images : bool
        Whether the images are copied into the new log.
    force : bool
        Replace an existing output.
    progress : callable, optional
        Called with the seconds replayed.

    Raises
    ------
    RecordingError
        If the log cannot be read, or the output is the log itself.
    ConfigError
        If an override does not fit.
    """
    refuse_inputs(output, log)
    reader = LogReader(log)
    flown = _configuration(config if config is not None else reader.config, overrides, tracker)
    has_tracks = next(reader.messages(TRACKS), None) is not None
    metadata = {**reader.metadata, "replayed_from": log.name}
    attachments = {
        name: data for name, data in reader.attachments.items() if not name.startswith("config.")
    }
    with (
        appearing_whole(output, force=force) as part,
        LogWriter(
            part,
            flown,
            utc_offset_ns=reader.utc_offset_ns,
            metadata=metadata,
            attachments=attachments,
            force=True,
        ) as writer,
    ):
        run = _Replay(flown, writer, track=retrack or not has_tracks, images=images)
        summary = run.over(reader, progress)
        if summary.records == 0:
            msg = f"{log}: holds neither gyro samples nor frames; there is nothing to replay"
            raise RecordingError(msg)
    return summary


def _configuration(
    config: FlightConfig, overrides: tuple[str, ...], tracker: str | None
) -> FlightConfig:
    pairs = (*overrides, *((f"tracker.name={tracker}",) if tracker else ()))
    if not pairs:
        return config
    tables = apply_overrides(config.model_dump(mode="json"), pairs)
    return parse_config(tables, origin="--set", is_flown=True)


class _Replay:
    def __init__(
        self, config: FlightConfig, writer: LogWriter, *, track: bool, images: bool
    ) -> None:
        self._images, self._track = images, track
        self._pipelines = Pipelines(config, writer)
        self._trackers: ByCamera[Tracker | None] | None = None
        if track:
            from avionics.flight.runner import trackers_for  # noqa: PLC0415 (and OpenCV with it)

            self._trackers = trackers_for(config)
        self._tracked = self._untracked = self._records = 0

    def over(self, reader: LogReader, progress: Progress | None) -> ReplaySummary:
        """Feed every record of a log."""
        start_ns: int | None = None
        # Frames are read even where they go nowhere: the rows due by their arrival come before
        # their tracks, which arrive at the same instant in a simulated flight.
        for message in reader.messages(INPUTS, decode_images=False):
            start_ns = message.arrival_ns if start_ns is None else start_ns
            self._take(message.record, message.arrival_ns)
            if progress is not None and self._records % 64 == 0:
                progress((message.arrival_ns - start_ns) * 1e-9)
        self._pipelines.close()
        return ReplaySummary(self._records, self._tracked, self._untracked, reader.damage)

    def _take(self, record: object, arrival_ns: int) -> None:
        match record:
            case ImuSample():
                self._records += 1
                self._pipelines.on_imu(record, arrival_ns)
            case EncodedFrame() | Frame():
                self._records += 1
                self._on_frame(record, arrival_ns)
            case MarkerTracks():
                if not self._track:
                    self._pipelines.on_tracks(record, arrival_ns)
            case Truth():
                self._pipelines.pass_on(record, arrival_ns)
            case Health() | Event():
                if not record.source.startswith(REMADE):
                    self._pipelines.pass_on(record, arrival_ns)
            case _:
                pass

    def _on_frame(self, frame: EncodedFrame | Frame, arrival_ns: int) -> None:
        if self._images:
            self._pipelines.pass_on(frame, arrival_ns)
        else:
            self._pipelines.advance(arrival_ns)
        if self._trackers is None:
            return
        tracker = self._trackers.get(frame.camera)
        if tracker is None:
            self._untracked += 1
            return
        picture = frame.decode() if isinstance(frame, EncodedFrame) else frame
        prediction = self._pipelines.predict_markers(picture.t_ns, frame.camera)
        self._pipelines.on_tracks(tracker.update(picture, prediction), arrival_ns)
        self._tracked += 1
