"""Estimates and truth of one log as arrays over time, and values between their instants."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from avionics.recording import EncodedFrame, LogReader
from avionics.records import FloatArray, MarkerTracks, Truth, WingShapeEstimate

TimeArray = NDArray[np.int64]
MAX_GAP_NS = 45_000_000


@dataclass(frozen=True, slots=True, eq=False)
class EstimateHistory:
    """All estimates of one kind.

    Attributes
    ----------
    t_ns : ndarray, shape (n,)
    basis : str
        Identifier of the mode basis.
    amplitude_rad : ndarray, shape (n, modes)
        Bending, twist and in-plane amplitudes.
    tip_m, tip_sigma_m : ndarray, shape (n, 3)
    nis : ndarray, shape (n,)
        Per degree of freedom of the last update; NaN if none.
    """

    t_ns: TimeArray
    basis: str
    amplitude_rad: FloatArray
    tip_m: FloatArray
    tip_sigma_m: FloatArray
    nis: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class TruthHistory:
    """The truth of one log.

    Attributes
    ----------
    source : str
        "sim" or "mocap".
    t_ns : ndarray, shape (n,)
    marker_m : ndarray, shape (n, K, 3)
        Truth markers, body axes; NaN where missing.
    tip_m : ndarray, shape (n, 3), or None
    angles_rad : ndarray, shape (n, 3, S), or None
        phi, theta, psi at ``linspace(0, span, S)``.
    """

    source: str
    t_ns: TimeArray
    marker_m: FloatArray
    tip_m: FloatArray | None
    angles_rad: FloatArray | None


@dataclass(frozen=True, slots=True, eq=False)
class LogHistory:
    """What an evaluation needs of one log.

    Attributes
    ----------
    estimates : dict of str to EstimateHistory
        By kind.
    truth : TruthHistory or None
    frame_ns : ndarray, shape (n,)
        Exposure of every frame or set of tracks, ns, by the camera's own stamps.
    found : ndarray of bool, shape (m, K)
        Markers found, by tracked frame.
    """

    estimates: dict[str, EstimateHistory]
    truth: TruthHistory | None
    frame_ns: TimeArray
    found: NDArray[np.bool_]


def read_history(reader: LogReader) -> LogHistory:
    """Return what an evaluation needs of a log."""
    estimates: dict[str, list[WingShapeEstimate]] = {}
    truths: list[Truth] = []
    frame_ns: set[int] = set()
    found: list[NDArray[np.bool_]] = []
    for message in reader.messages(decode_images=False):
        record = message.record
        if isinstance(record, WingShapeEstimate):
            estimates.setdefault(record.kind, []).append(record)
        elif isinstance(record, Truth):
            truths.append(record)
        elif isinstance(record, EncodedFrame):
            frame_ns.add(record.t_ns)
        elif isinstance(record, MarkerTracks):
            frame_ns.add(record.t_ns)
            found.append(record.found)
    return LogHistory(
        {kind: _estimates(records) for kind, records in sorted(estimates.items())},
        _truths(truths),
        np.array(sorted(frame_ns), dtype=np.int64),
        np.array(found, dtype=np.bool_).reshape(len(found), -1)
        if found
        else np.zeros((0, 0), bool),
    )


def _estimates(records: list[WingShapeEstimate]) -> EstimateHistory:
    records = sorted({r.t_ns: r for r in records}.values(), key=lambda r: r.t_ns)
    return EstimateHistory(
        np.array([r.t_ns for r in records], dtype=np.int64),
        records[0].basis,
        np.array([np.concatenate([r.phi_rad, r.theta_rad, r.psi_rad]) for r in records]),
        np.array([r.line_in_body_m[-1] for r in records]),
        np.array([r.tip_sigma_m for r in records]),
        np.array([r.nis for r in records]),
    )


def _truths(records: list[Truth]) -> TruthHistory | None:
    if not records:
        return None
    records = sorted({r.t_ns: r for r in records}.values(), key=lambda r: r.t_ns)
    lines = [r.line_in_body_m for r in records]
    angles = [(r.phi_rad, r.theta_rad, r.psi_rad) for r in records]
    has_angles = all(a is not None for three in angles for a in three)
    return TruthHistory(
        records[0].source,
        np.array([r.t_ns for r in records], dtype=np.int64),
        np.array([r.marker_in_body_m for r in records]),
        np.array([line[-1] for line in lines if line is not None])
        if all(line is not None for line in lines)
        else None,
        np.array(angles, dtype=np.float64) if has_angles else None,
    )


def between(
    t_ns: TimeArray, values: FloatArray, wanted_ns: TimeArray, *, max_gap_ns: int = MAX_GAP_NS
) -> FloatArray:
    """Return values between samples by a cubic spline; NaN outside and inside longer gaps.

    Parameters
    ----------
    t_ns : ndarray, shape (n,)
        Instants of the samples, increasing.
    values : ndarray, shape (n, ...)
        Samples; each column is interpolated over its own finite ones.
    wanted_ns : ndarray, shape (m,)
        Instants wanted.
    max_gap_ns : int
        Longest gap that is interpolated, ns.

    Returns
    -------
    ndarray, shape (m, ...)
    """
    flat = values.reshape(len(values), -1)
    result = np.full((len(wanted_ns), flat.shape[1]), np.nan)
    patterns: dict[bytes, list[int]] = {}
    finite = np.isfinite(flat)
    for column in range(flat.shape[1]):
        patterns.setdefault(finite[:, column].tobytes(), []).append(column)
    for columns in patterns.values():
        use = finite[:, columns[0]]
        if use.sum() < 4:
            continue
        known_ns = t_ns[use]
        after = np.searchsorted(known_ns, wanted_ns)
        low = np.clip(after - 1, 0, len(known_ns) - 1)
        high = np.clip(after, 0, len(known_ns) - 1)
        exact = known_ns[high] == wanted_ns
        gap = known_ns[high] - known_ns[low]
        inside = (wanted_ns >= known_ns[0]) & (wanted_ns <= known_ns[-1])
        fits = inside & (exact | (gap <= max_gap_ns))
        origin = known_ns[0]
        spline = CubicSpline((known_ns - origin) * 1e-9, flat[use][:, columns])
        rows = np.flatnonzero(fits)
        result[np.ix_(rows, np.array(columns))] = spline((wanted_ns[rows] - origin) * 1e-9)
    return result.reshape(len(wanted_ns), *values.shape[1:])
