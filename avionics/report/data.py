"""What a report draws: the records of one log as arrays over time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from avionics.analysis.info import LogInfo, read_info
from avionics.analysis.tables import stacked
from avionics.config import Config, one_wing
from avionics.errors import RecordingError
from avionics.recording import LogReader
from avionics.records import Event, FloatArray, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import Frame, ImuSample

Times = NDArray[np.int64]
T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One quantity over time.

    Attributes
    ----------
    t_ns : ndarray, shape (n,)
        When, ns, increasing.
    values : ndarray, shape (n, ...)
        What.
    """

    t_ns: Times
    values: FloatArray

    def resampled(self, t_ns: Times) -> FloatArray:
        """Return the values at many instants, linear between neighbours, NaN outside."""
        t = (self.t_ns - self.t_ns[0]) * 1e-9
        wanted = (t_ns - self.t_ns[0]) * 1e-9
        flat = self.values.reshape(len(t), -1)
        columns = [np.interp(wanted, t, one, left=np.nan, right=np.nan) for one in flat.T]
        return np.stack(columns, axis=-1).reshape(len(wanted), *self.values.shape[1:])

    def at(self, t_ns: int) -> FloatArray:
        """Return the values at an instant, linear between neighbours, held at the ends."""
        right = int(np.searchsorted(self.t_ns, t_ns))
        if right == 0 or right == len(self.t_ns):
            return np.asarray(self.values[min(right, len(self.t_ns) - 1)])
        left = right - 1
        weight = (t_ns - self.t_ns[left]) / (self.t_ns[right] - self.t_ns[left])
        before, behind = self.values[left], self.values[right]
        return np.asarray(before + weight * (behind - before), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class EstimateHistory:
    """One kind of estimate over the flight; every array has one row per estimate.

    Attributes
    ----------
    t_ns : ndarray, shape (n,)
        Instants, ns.
    line_m, marker_px : ndarray, shapes (n, S, 3), (n, K, 2)
        Reference line in body axes, m, and predicted pixels.
    tip_sigma_m : ndarray, shape (n, 3)
        One-sigma of the last point, m.
    bias_rad_s, bias_sigma_rad_s : ndarray, shape (n, M, 3)
        Gyro bias, rad/s; NaN where not estimated.
    nis : ndarray, shape (n,)
        Normalised innovation squared per degree of freedom.
    used : ndarray, shape (n,)
        Markers that the update used.
    basis : str
        Identifier of the mode basis.
    """

    t_ns: Times
    line_m: FloatArray
    tip_sigma_m: FloatArray
    marker_px: FloatArray
    bias_rad_s: FloatArray
    bias_sigma_rad_s: FloatArray
    nis: FloatArray
    used: NDArray[np.int64]
    basis: str

    @property
    def line(self) -> Series:
        """The reference line over time."""
        return Series(self.t_ns, self.line_m)

    @property
    def pixels(self) -> Series:
        """The predicted pixels over time."""
        return Series(self.t_ns, self.marker_px)


@dataclass(slots=True, eq=False)
class Flight:
    """One log, ready to draw.

    Attributes
    ----------
    path : Path
        The log.
    config : Config
        What flew.
    info : LogInfo
        Counts, rates, losses.
    origin_ns : int
        Instant that the plots call zero, ns.
    rates : dict of str to Series
        Angular rate by pod, rad/s, (n, 3).
    estimates : dict of str to EstimateHistory
        By kind.
    found : Series or None
        Which markers each frame shows, (n, K) of 0 and 1, at the exposures.
    tracked_px : Series or None
        Where, (n, K, 2).
    latency_s : Series or None
        From exposure to arrival of the tracks, s.
    truth_markers_m, truth_line_m : Series or None
        True marker positions (n, K, 3) and reference line (n, S, 3), body axes, m.
    truth_source : str
        "sim", "mocap" or empty.
    frames_ns : dict of int to int
        Exposure by frame index.
    events : list of Event
        All of them.
    """

    path: Path
    config: Config
    info: LogInfo
    origin_ns: int
    rates: dict[str, Series] = field(default_factory=dict)
    estimates: dict[str, EstimateHistory] = field(default_factory=dict)
    found: Series | None = None
    tracked_px: Series | None = None
    latency_s: Series | None = None
    truth_markers_m: Series | None = None
    truth_line_m: Series | None = None
    truth_source: str = ""
    frames_ns: dict[int, int] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)

    def seconds(self, t_ns: Times | int) -> FloatArray:
        """Return instants as seconds since the origin."""
        return np.asarray((np.asarray(t_ns) - self.origin_ns) * 1e-9, dtype=np.float64)

    @property
    def offset_ns(self) -> int:
        """What is added to a frame's exposure to bring it onto the gyro clock, ns."""
        camera = self.config.camera
        return 0 if camera is None else round(camera.time_offset_s * 1e9)


def read_flight(path: Path) -> Flight:
    """Return one log as arrays.

    Raises
    ------
    RecordingError
        If it is no log of ours, or holds neither gyro samples nor estimates.
    """
    reader = LogReader(path)
    by_type: dict[type, list[tuple[int, object]]] = {}
    for _, record, arrival_ns in reader.messages(["/imu/*", "*/tracks", "/wing/*", "/event"]):
        by_type.setdefault(type(record), []).append((arrival_ns, record))

    def of(kind: type[T]) -> list[tuple[int, T]]:
        return [(at, record) for at, record in by_type.get(kind, []) if isinstance(record, kind)]

    samples = [r for _, r in of(ImuSample)]
    estimates = [r for _, r in of(WingShapeEstimate)]
    if not samples and not estimates:
        msg = f"{path}: holds neither gyro samples nor estimates; there is nothing to report"
        raise RecordingError(msg)
    first: list[ImuSample | WingShapeEstimate] = [*samples[:50], *estimates[:50]]
    origin_ns = min(record.t_ns for record in first)
    config = one_wing(reader.config, f"{path}: report")
    flight = Flight(path, config, read_info(path), origin_ns)
    for pod in sorted({sample.pod for sample in samples}):
        mine = [sample for sample in samples if sample.pod == pod]
        flight.rates[pod] = _series(mine, [sample.rate_rad_s for sample in mine])
    for kind in {estimate.kind: None for estimate in estimates}:
        flight.estimates[kind] = _history([one for one in estimates if one.kind == kind])
    _add_tracks(flight, of(MarkerTracks))
    _add_truth(flight, [r for _, r in of(Truth)])
    flight.events = [r for _, r in of(Event)]
    return flight


def _series(records: Sequence[ImuSample | Truth], rows: Sequence[FloatArray]) -> Series:
    t_ns = np.array([record.t_ns for record in records], dtype=np.int64)
    order = np.argsort(t_ns, kind="stable")
    return Series(t_ns[order], np.array(rows)[order])


def _history(estimates: list[WingShapeEstimate]) -> EstimateHistory:
    estimates = sorted(estimates, key=lambda one: one.t_ns)
    count = len(estimates)
    return EstimateHistory(
        np.array([one.t_ns for one in estimates], dtype=np.int64),
        stacked([one.line_in_body_m for one in estimates]).reshape(count, -1, 3),
        stacked([one.tip_sigma_m for one in estimates]),
        stacked([one.marker_px for one in estimates]).reshape(count, -1, 2),
        stacked([one.bias_rad_s for one in estimates]).reshape(count, -1, 3),
        stacked([one.bias_sigma_rad_s for one in estimates]).reshape(count, -1, 3),
        np.array([one.nis for one in estimates]),
        np.array([int(one.used.sum()) for one in estimates]),
        estimates[0].basis,
    )


def _add_tracks(flight: Flight, items: list[tuple[int, MarkerTracks]]) -> None:
    if not items:
        return
    items = sorted(items, key=lambda item: item[1].t_ns)
    tracks = [one for _, one in items]
    t_ns = np.array([one.t_ns for one in tracks], dtype=np.int64)
    arrival_ns = np.array([arrival for arrival, _ in items], dtype=np.int64)
    flight.found = Series(t_ns, stacked([one.found.astype(np.float64) for one in tracks]))
    pixel = stacked([one.pixel for one in tracks]).reshape(len(tracks), -1, 2)
    flight.tracked_px = Series(t_ns, pixel)
    flight.latency_s = Series(t_ns, np.asarray((arrival_ns - t_ns) * 1e-9, dtype=np.float64))
    flight.frames_ns = {one.frame_index: one.t_ns for one in tracks}


def _add_truth(flight: Flight, truths: list[Truth]) -> None:
    if not truths:
        return
    flight.truth_source = truths[0].source
    with_markers = [one for one in truths if one.marker_in_body_m.size]
    if with_markers:
        shape = (len(with_markers), -1, 3)
        rows = stacked([one.marker_in_body_m for one in with_markers]).reshape(shape)
        flight.truth_markers_m = _series(with_markers, list(rows))
    lines = [(one, one.line_in_body_m) for one in truths if one.line_in_body_m is not None]
    if lines:
        flight.truth_line_m = _series([one for one, _ in lines], [line for _, line in lines])


def read_frames(path: Path, indices: set[int]) -> dict[int, Frame]:
    """Return the frames with these indices, decoded; those not in the log are left out."""
    found: dict[int, Frame] = {}
    for _, record, _ in LogReader(path).messages(["/camera/*/image"], decode_images=False):
        index = getattr(record, "index", None)
        if index in indices and index not in found:
            found[index] = record.decode()  # type: ignore[union-attr]
            if len(found) == len(indices):
                break
    return found
