"""Estimates of one wing against its truth: Eq. 17 in pixels, tip and markers in millimetres."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from avionics.analysis.bounds import mean_square_bounds
from avionics.analysis.interpolation import between
from avionics.analysis.mocap_tip import tip_from_markers
from avionics.analysis.series import EstimateSeries, TimeArray, WingData, in_time_order
from avionics.config import Config
from avionics.flight.filter_setup import marker_model, pinhole_from_config, recorded_basis
from avionics.records import FloatArray
from avionics.wse.geometry import WingGeometry
from avionics.wse.modes import ModeBasis

SETTLE_S = 6.0
BLOCK_S = 10.0
ROW_GAP_NS = 200_000_000
ANGLES = ("phi", "theta", "psi")


@dataclass(slots=True)
class KindScore:
    """Figures of one kind of estimate; null where the log does not give them.

    Attributes
    ----------
    eq17_px : dict of str to float, or None
        Statistics of the mean error of the visible markers (Srikanth et al., Eq. 17), px.
    tip_mm : dict of str to float or None
        Distance from the true tip, RMS and largest, mm.
    nees_tip : float or None
        Normalised estimation error squared of the tip's height, mean; 1 if sigma is right.
    nis_per_dof : float or None
        Normalised innovation squared per degree of freedom, mean; 1 if sigma is right.
    more : dict
        Further figures by name.
    """

    eq17_px: dict[str, float] | None
    tip_mm: dict[str, float | None]
    nees_tip: float | None
    nis_per_dof: float | None
    more: dict[str, Any] = field(default_factory=dict)


class Comparison:
    """The truth of one wing at the instants of comparison, against which every kind is scored.

    Instants are the exposures of the frames on the clock of the gyros; without a camera, those of
    the estimates.

    Parameters
    ----------
    config : Config
        The wing.
    wing : WingData
        Its estimates, one kind at least, and its truth.
    frame_ns : ndarray of int64, shape (n,)
        Exposures by the camera's own stamps, increasing, ns.
    settle_s : float
        Left out after the first common instant, s.

    Attributes
    ----------
    t_ns : ndarray of int64, shape (n,)
        Instants of comparison with a known truth, ns.
    tip_m : ndarray, shape (n, 3)
        The true end of the reference line, body axes, m.
    """

    def __init__(
        self, config: Config, wing: WingData, frame_ns: TimeArray, *, settle_s: float = SETTLE_S
    ) -> None:
        if wing.truth is None:
            msg = f"wing {wing.name}: no truth to compare with"
            raise ValueError(msg)
        truth = in_time_order(wing.truth)
        self._config, self._truth = config, truth
        self._camera = pinhole_from_config(config.camera) if config.camera else None
        self._markers = config.truth_markers or config.markers
        offset_ns = round(config.camera.time_offset_s * 1e9) if config.camera else 0
        instants = frame_ns + offset_ns
        rows = in_time_order(wing.estimates[min(wing.estimates)]).t_ns
        if not instants.size:
            instants = rows
        first_ns = max(int(truth.t_ns[0]), int(min(rows[0], instants[0])))
        instants = instants[instants >= first_ns + round(settle_s * 1e9)]
        marker_m = between(truth.t_ns, truth.marker_in_body_m, instants)
        tip_m = self._true_tip(marker_m, instants)
        is_known = np.isfinite(marker_m[..., 0]).any(axis=1)
        self.t_ns = instants[is_known]
        self._start_ns = first_ns
        self._marker_m, self.tip_m = marker_m[is_known], tip_m[is_known]

    def _true_tip(self, marker_m: FloatArray, t_ns: Any) -> FloatArray:
        tip_m = self._truth.tip_in_body_m
        if tip_m is not None and np.isfinite(tip_m).all():
            return between(self._truth.t_ns, tip_m, t_ns)
        return tip_from_markers(self._config, self._markers, marker_m)

    def score(self, rows: EstimateSeries) -> KindScore:
        """Return the figures of one kind."""
        rows = in_time_order(rows)
        basis, q, known, points = self._shape(rows)
        tip = between(rows.t_ns, rows.tip_in_body_m, self.t_ns, max_gap_ns=ROW_GAP_NS)
        sigma = between(rows.t_ns, rows.tip_sigma_m, self.t_ns, max_gap_ns=ROW_GAP_NS)
        error_m = np.linalg.norm(points - self._marker_m, axis=2)
        per_marker = np.sqrt(np.nanmean(error_m**2, axis=0)) if known.any() else []
        tip_error = tip - self.tip_m
        distance = np.linalg.norm(tip_error, axis=1)
        tip_mm: dict[str, float | None] = {
            "rmse": _number(1e3 * np.sqrt(np.nanmean(distance**2))),
            "max": _number(1e3 * np.nanmax(distance)),
        } if np.isfinite(distance).any() else {"rmse": None, "max": None}  # fmt: skip
        with np.errstate(invalid="ignore", divide="ignore"):
            nees = tip_error[:, 2] ** 2 / sigma[:, 2] ** 2
        finite = np.isfinite(nees)
        count = int(finite.sum())
        after = rows.t_ns >= self.t_ns[0]
        nis = rows.nis[after & np.isfinite(rows.nis)]
        more: dict[str, Any] = {
            "marker_mm_rmse": {
                str(marker.id): _number(1e3 * value)
                for marker, value in zip(self._markers, per_marker, strict=False)
            },
            "nees_tip_bounds_95": _bounds(count),
            "nis_bounds_95": _bounds(2 * len(self._config.markers) * len(nis)),
            "instants": int(known.sum()),
            "basis": rows.basis,
            **self._angles(basis, q, known),
        }
        eq17 = self._eq17(points, more)
        return KindScore(
            eq17,
            tip_mm,
            _number(np.mean(nees[finite])) if count else None,
            _number(np.mean(nis)) if nis.size else None,
            more,
        )

    def _shape(self, rows: EstimateSeries) -> tuple[ModeBasis, FloatArray, Any, FloatArray]:
        """Return basis, amplitudes, where they are known, and the marker positions."""
        q = between(rows.t_ns, rows.amplitude_rad, self.t_ns, max_gap_ns=ROW_GAP_NS)
        known = np.isfinite(q).all(axis=1)
        basis = recorded_basis(self._config, rows.basis)
        points = np.full((len(q), len(self._markers), 3), np.nan)
        if known.any():
            points[known] = self._points(basis, q[known])
        return basis, q, known, points

    def marker_error_px(self, rows: EstimateSeries) -> tuple[TimeArray, FloatArray]:
        """Return instants, ns, and Eq. 17 of Srikanth et al., px, at each."""
        return self._error_px(self._shape(in_time_order(rows))[3])

    def _points(self, basis: ModeBasis, q: FloatArray) -> FloatArray:
        model = marker_model(self._config, basis, markers=self._markers)
        return np.asarray(model.points(q), dtype=np.float64)

    def _error_px(self, points: FloatArray) -> tuple[TimeArray, FloatArray]:
        """Return instants and the mean error of the visible markers; empty without camera."""
        if self._camera is None:
            return self.t_ns[:0], np.empty(0)
        true_px = self._camera.project(self._marker_m)
        with np.errstate(invalid="ignore"):
            visible = self._camera.can_see(self._marker_m) & self._camera.in_image(true_px)
        distance = np.linalg.norm(self._camera.project(points) - true_px, axis=2)
        visible &= np.isfinite(distance)
        count = visible.sum(axis=1)
        use = count > 0
        total = np.where(visible, distance, 0.0).sum(axis=1)
        return self.t_ns[use], np.asarray(total[use] / count[use], dtype=np.float64)

    def _eq17(self, points: FloatArray, more: dict[str, Any]) -> dict[str, float] | None:
        """Return the statistics of Eq. 17 of Srikanth et al., px."""
        t_ns, error = self._error_px(points)
        if not error.size:
            return None
        t_s = np.asarray((t_ns - self._start_ns) * 1e-9, dtype=np.float64)
        block = (t_s // BLOCK_S).astype(int)
        more["eq17_px_windows"] = [
            {"from_s": b * BLOCK_S, **_statistics(error[block == b], t_s[block == b])}
            for b in np.unique(block)
        ]
        for name, odd in (("even", 0), ("odd", 1)):
            chosen = block % 2 == odd
            if chosen.any():
                more[f"eq17_px_{name}_blocks"] = _statistics(error[chosen], t_s[chosen])
        return _statistics(error, t_s)

    def _angles(self, basis: ModeBasis, q: FloatArray, known: Any) -> dict[str, Any]:
        angles = [getattr(self._truth, f"{name}_rad") for name in ANGLES]
        if not known.any() or any(a is None or not np.isfinite(a).all() for a in angles):
            return {}
        angle_rad = np.stack(angles, axis=1)
        count = angle_rad.shape[2]
        span = self._config.wing.span_m
        places_m = np.linspace(0.0, span, count)
        at = WingGeometry(basis, places_m, psi0=self._config.wing.psi0_rad).at(q[known])
        shape = (at.phi, at.theta, at.psi)
        true = between(self._truth.t_ns, angle_rad, self.t_ns[known])
        error = np.degrees(np.stack(shape, axis=1) - true)
        rmse = np.sqrt(np.nanmean(error**2, axis=(0, 2)))
        return {"angle_deg_rmse": {n: _number(v) for n, v in zip(ANGLES, rmse, strict=True)}}


def _statistics(error: FloatArray, t_s: FloatArray) -> dict[str, float]:
    slope = float(np.polyfit(t_s / 60.0, error, 1)[0]) if len(error) > 2 else 0.0
    return {
        "median": float(np.median(error)),
        "mean": float(np.mean(error)),
        "rms": float(np.sqrt(np.mean(error**2))),
        "p95": float(np.percentile(error, 95)),
        "max": float(np.max(error)),
        "slope_per_min": slope,
    }


def _bounds(degrees: int) -> list[float] | None:
    """Return the 95 % bounds of a mean of squares of ``degrees`` independent unit normals."""
    if degrees <= 0:
        return None
    return [float(bound) for bound in mean_square_bounds(degrees)]


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None
