"""What a report is about: one wing of a flight, its series in order of time, its scores."""

from dataclasses import dataclass

from avionics.analysis.flight import Flight
from avionics.analysis.frames import Frames
from avionics.analysis.info import LogInfo, log_info
from avionics.analysis.series import (
    EstimateSeries,
    ImuSeries,
    TimeArray,
    TrackSeries,
    TruthSeries,
    WingData,
    in_time_order,
)
from avionics.config import Config
from avionics.errors import RecordingError
from avionics.kinds import CRG
from avionics.records import ROOT, FloatArray
from avionics.report.scores import Scores, score_flight


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """One wing of a flight, ready to draw; every series is in order of time.

    Attributes
    ----------
    flight : Flight
        The log.
    info : LogInfo
        Counts, rates, losses.
    config : Config
        What flew.
    imu : dict of str to ImuSeries
        By pod, sorted by name.
    estimates : dict of str to EstimateSeries
        By kind.
    tracks : TrackSeries or None
        Where the markers were found.
    frames : Frames or None
        The camera's pictures.
    truth : TruthSeries or None
        The true shape.
    scores : Scores
        Estimates against the truth.
    """

    flight: Flight
    info: LogInfo
    config: Config
    imu: dict[str, ImuSeries]
    estimates: dict[str, EstimateSeries]
    tracks: TrackSeries | None
    frames: Frames | None
    truth: TruthSeries | None
    scores: Scores

    def seconds(self, t_ns: TimeArray | int) -> FloatArray:
        """Return instants as seconds since the start of the flight."""
        return self.flight.seconds(t_ns)

    @property
    def offset_ns(self) -> int:
        """What is added to a frame's exposure to bring it onto the gyro clock, ns."""
        camera = self.config.camera
        return 0 if camera is None else round(camera.time_offset_s * 1e9)

    @property
    def main_estimate(self) -> EstimateSeries:
        """CRG-WSE as flown, or the first kind in the log without it."""
        return self.estimates.get(CRG) or next(iter(self.estimates.values()))

    @property
    def marker_ids(self) -> list[int]:
        """Numbers of the markers in the tracks."""
        count = 0 if self.tracks is None else self.tracks.found.shape[1]
        return [marker.id for marker in self.config.markers] or list(range(count))


def subjects_of(flight: Flight) -> tuple[Subject, ...]:
    """Return what there is to report of the wings of a log, in the order of the configuration.

    Raises
    ------
    RecordingError
        If it holds neither gyro samples nor estimates.
    """
    wings = flight.wings
    if not flight.imu and not any(wing.estimates for wing in wings.values()):
        msg = f"{flight.path}: holds neither gyro samples nor estimates; there is nothing to report"
        raise RecordingError(msg)
    configs = flight.config.wing_configs
    if len(configs) == 1:
        return (_subject(flight, flight.wing, configs[0], set(flight.imu)),)
    return tuple(
        _subject(flight, wings[name], one, {ROOT, *one.pod_names})
        for one in configs
        if (name := one.wing.name) in wings
    )


def _subject(flight: Flight, wing: WingData, config: Config, pods: set[str]) -> Subject:
    camera = flight.camera_of(wing)
    tracks = None if camera is None else camera.tracks
    return Subject(
        flight,
        log_info(flight),
        config,
        {pod: in_time_order(flight.imu[pod]) for pod in sorted(flight.imu) if pod in pods},
        {kind: in_time_order(one) for kind, one in wing.estimates.items()},
        None if tracks is None else in_time_order(tracks),
        None if camera is None else camera.frames,
        None if wing.truth is None else in_time_order(wing.truth),
        score_flight(flight, wing),
    )
