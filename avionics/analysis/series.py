"""The records of one topic as arrays over time: one class for each kind of record.

Every array is read-only and has one row per record, in the order of the log. What a quantity means
stands in the record's own class. All have in common:

``topic``
    The topic.
``t_ns``, int64, shape (n,)
    When the quantity was true, ns of the steady clock.
``arrival_ns``, int64, shape (n,)
    When the record arrived, ns of the steady clock.
``t_s``, shape (n,)
    ``t_ns`` as seconds since the start of the flight.
"""

from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from avionics.records import FloatArray

TimeArray = NDArray[np.int64]
FlagArray = NDArray[np.bool_]


def seconds(t_ns: TimeArray, start_ns: int) -> FloatArray:
    """Return instants, ns of the steady clock, as seconds since the start of the flight."""
    return np.asarray((t_ns - start_ns) * 1e-9, dtype=np.float64)


def _summary(series: Any) -> str:
    """Return topic and shapes; the arrays themselves would fill the screen."""
    shapes = ", ".join(
        f"{one.name} {value.shape}"
        for one in fields(series)
        if isinstance(value := getattr(series, one.name), np.ndarray)
    )
    return f"<{type(series).__name__} {series.topic}: {shapes}>"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ImuSeries:
    """Samples of one inertial measurement unit, ``/imu/<pod>``, sensor axes.

    Attributes
    ----------
    pod : str
        Name of the pod, or "root".
    seq : ndarray of int64, shape (n,)
        The source's own count; a gap is a lost sample.
    rate_rad_s : ndarray, shape (n, 3)
        Angular rate, rad/s.
    specific_force_m_s2 : ndarray, shape (n, 3), or None
        Specific force, m/s^2; None if no sample holds it, NaN where one does not.
    magnetic_flux_t : ndarray, shape (n, 3), or None
        Magnetic flux density, T; likewise.
    """

    topic: str
    t_ns: TimeArray
    arrival_ns: TimeArray
    t_s: FloatArray
    pod: str
    seq: TimeArray
    rate_rad_s: FloatArray
    specific_force_m_s2: FloatArray | None
    magnetic_flux_t: FloatArray | None
    __repr__ = _summary


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class TrackSeries:
    """Markers found in the frames of one camera, ``/camera/<name>/tracks``.

    Attributes
    ----------
    camera : str
        Name of the camera.
    tracker : str
        Name of the tracker.
    frame_index : ndarray of int64, shape (n,)
        Number of the frame.
    pixel : ndarray, shape (n, K, 2)
        (u, v) in the raw image, px; NaN where not found.
    sigma_px : ndarray, shape (n, K)
        One-sigma of each coordinate, px; NaN where not found.
    found : ndarray of bool, shape (n, K)
        Whether the marker was found.
    """

    topic: str
    t_ns: TimeArray
    arrival_ns: TimeArray
    t_s: FloatArray
    camera: str
    tracker: str
    frame_index: TimeArray
    pixel: FloatArray
    sigma_px: FloatArray
    found: FlagArray
    __repr__ = _summary


@dataclass(frozen=True, slots=True, eq=False)
class Covariances:
    """Covariances of the estimates that carry one.

    Attributes
    ----------
    t_ns : ndarray of int64, shape (m,)
        When, ns of the steady clock.
    P : ndarray, shape (m, n, n)
        Order phi, theta, psi, then biases by pod and axis.
    """

    t_ns: TimeArray
    P: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class EstimateSeries:
    """One kind of estimate of one wing, ``/wing/<name>/estimate_<kind>``.

    Attributes
    ----------
    wing, kind : str
        Name of the wing; "rg", "crg", "filtered" or another kind of ``avionics.records``.
    basis : str
        Identifier of the mode basis.
    phi_rad, theta_rad, psi_rad : ndarray, shapes (n, N), (n, Nt), (n, Np)
        Amplitudes of bending, twist and in-plane bending, rad.
    phi_sigma_rad, theta_sigma_rad, psi_sigma_rad : ndarray
        Their one-sigmas, rad.
    bias_rad_s, bias_sigma_rad_s : ndarray, shape (n, M, 3)
        Gyro bias by pod, local axes, and its one-sigma, rad/s; NaN where not estimated.
    line_in_body_m : ndarray, shape (n, S, 3)
        Reference line, body axes, m; the last point is the tip.
    tip_sigma_m : ndarray, shape (n, 3)
        One-sigma of the tip, m.
    marker_px, marker_sigma_px : ndarray, shape (n, K, 2)
        Predicted pixels of the markers and their one-sigmas, px.
    nis : ndarray, shape (n,)
        Normalised innovation squared over its degrees of freedom; NaN if none.
    used : ndarray of bool, shape (n, K)
        Markers that the last update used.
    covariance : Covariances or None
        Full covariances, at a lower rate; None if the log holds none.
    """

    topic: str
    t_ns: TimeArray
    arrival_ns: TimeArray
    t_s: FloatArray
    wing: str
    kind: str
    basis: str
    phi_rad: FloatArray
    theta_rad: FloatArray
    psi_rad: FloatArray
    phi_sigma_rad: FloatArray
    theta_sigma_rad: FloatArray
    psi_sigma_rad: FloatArray
    bias_rad_s: FloatArray
    bias_sigma_rad_s: FloatArray
    line_in_body_m: FloatArray
    tip_sigma_m: FloatArray
    marker_px: FloatArray
    marker_sigma_px: FloatArray
    nis: FloatArray
    used: FlagArray
    covariance: Covariances | None
    __repr__ = _summary

    @property
    def amplitude_rad(self) -> FloatArray:
        """All amplitudes in the order phi, theta, psi, rad, shape (n, modes)."""
        return np.concatenate([self.phi_rad, self.theta_rad, self.psi_rad], axis=1)

    @property
    def tip_in_body_m(self) -> FloatArray:
        """The end of the reference line, body axes, m, shape (n, 3)."""
        return self.line_in_body_m[:, -1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class TruthSeries:
    """The true shape of one wing, ``/wing/<name>/truth``.

    Attributes
    ----------
    wing, source : str
        Name of the wing; "sim" or "mocap".
    marker_in_body_m : ndarray, shape (n, K, 3)
        Truth markers, body axes, m; NaN where missing.
    line_in_body_m : ndarray, shape (n, S, 3), or None
        Reference line at ``linspace(0, span, S)``, body axes, m; None if no record holds it, NaN
        where one does not.
    phi_rad, theta_rad, psi_rad : ndarray, shape (n, S), or None
        Local angles at the same stations, rad; likewise.
    """

    topic: str
    t_ns: TimeArray
    arrival_ns: TimeArray
    t_s: FloatArray
    wing: str
    source: str
    marker_in_body_m: FloatArray
    line_in_body_m: FloatArray | None
    phi_rad: FloatArray | None
    theta_rad: FloatArray | None
    psi_rad: FloatArray | None
    __repr__ = _summary

    @property
    def tip_in_body_m(self) -> FloatArray | None:
        """The end of the reference line, body axes, m, shape (n, 3), or None."""
        return None if self.line_in_body_m is None else self.line_in_body_m[:, -1]


@dataclass(frozen=True, slots=True, eq=False)
class HealthSeries:
    """Counters of all sources, ``/health``; one row per counter of each report.

    Attributes
    ----------
    t_ns, arrival_ns : ndarray of int64, shape (n,)
        When the counts were true and when they arrived, ns of the steady clock.
    source, counter : tuple of str
        Source of the report and name of the counter, length n.
    count : ndarray of int64, shape (n,)
        The count since the start of the run.
    last : dict of str to dict of str to int
        The counters of the last report of each source.
    """

    t_ns: TimeArray
    arrival_ns: TimeArray
    source: tuple[str, ...]
    counter: tuple[str, ...]
    count: TimeArray
    last: dict[str, dict[str, int]]

    def counts(self, source: str, counter: str) -> tuple[TimeArray, TimeArray]:
        """Return one counter over time: ``t_ns`` and count; empty if it was never reported."""
        pairs = zip(self.source, self.counter, strict=True)
        rows = [row for row, pair in enumerate(pairs) if pair == (source, counter)]
        return self.t_ns[rows], self.count[rows]


@dataclass(slots=True, eq=False)
class WingData:
    """What a log holds of one wing.

    Attributes
    ----------
    name : str
        Name of the wing.
    estimates : dict of str to EstimateSeries
        By kind, in order of appearance.
    truth : TruthSeries or None
        The true shape, if the log holds it.
    """

    name: str
    estimates: dict[str, EstimateSeries] = field(default_factory=dict)
    truth: TruthSeries | None = None


Series: TypeAlias = ImuSeries | TrackSeries | EstimateSeries | TruthSeries
S = TypeVar("S", ImuSeries, TrackSeries, EstimateSeries, TruthSeries)


def in_time_order(series: S) -> S:
    """Return a series ordered by ``t_ns``; of records of one time only the last in the log.

    A record that came late stands in the log where it arrived.
    """
    if (np.diff(series.t_ns) > 0).all():
        return series
    # Of equal times `unique` finds the first: it looks from the end.
    _, from_end = np.unique(series.t_ns[::-1], return_index=True)
    rows = len(series.t_ns) - 1 - from_end
    arrays: dict[str, Any] = {
        one.name: value[rows]
        for one in fields(series)
        if isinstance(value := getattr(series, one.name), np.ndarray)
    }
    return replace(series, **arrays)
