"""Estimates against the truth inside a log: Eq. 17 in pixels, tip and markers in millimetres."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from avionics.analysis.bounds import mean_square_bounds
from avionics.analysis.history import (
    EstimateHistory,
    LogHistory,
    TimeArray,
    TruthHistory,
    between,
    read_history,
)
from avionics.analysis.mocap_tip import tip_from_markers
from avionics.config import Config, one_wing
from avionics.errors import RecordingError
from avionics.flight.filter_setup import marker_model, pinhole_from_config, recorded_basis
from avionics.recording import LogReader
from avionics.records import FloatArray
from avionics.wse.geometry import WingGeometry
from avionics.wse.modes import ModeBasis

SETTLE_S = 6.0
BLOCK_S = 10.0
ROW_GAP_NS = 200_000_000


@dataclass(slots=True)
class KindScore:
    """Figures of one kind of estimate; see ``Evaluation``."""

    eq17_px: dict[str, float] | None
    tip_mm: dict[str, float | None]
    nees_tip: float | None
    nis_per_dof: float | None
    more: dict[str, Any] = field(default_factory=dict)


@dataclass(slots=True)
class Evaluation:
    """How good the estimates of a log are.

    Attributes
    ----------
    truth : str
        "sim" or "mocap".
    kinds : dict of str to KindScore
        By kind of estimate.
    tracks : dict
        Markers found and lost.
    """

    truth: str
    kinds: dict[str, KindScore]
    tracks: dict[str, Any]

    def to_json_dict(self) -> dict[str, Any]:
        """Return the figures for ``json.dumps``; what is not available is null."""
        result: dict[str, Any] = {}
        for kind, score in self.kinds.items():
            result[kind] = {
                "eq17_px": score.eq17_px,
                "tip_mm": score.tip_mm,
                "nees_tip": score.nees_tip,
                "nis_per_dof": score.nis_per_dof,
                **score.more,
            }
        result["truth"] = self.truth
        result["tracks"] = self.tracks
        return result

    def table(self) -> Table:
        """Return the figures for a person."""
        # Fits a terminal of 80 columns: units stand in a second line of the heads.
        title = (
            f"against {self.truth}, after the first {SETTLE_S:.0f} s; marker error (Eq. 17), tip"
        )
        table = Table(title=title, title_justify="left", box=None, pad_edge=False)
        table.add_column("estimate")
        heads = ("median\npx", "mean\npx", "95 %\npx", "max\npx", "slope\npx/min")
        for head in (*heads, "tip\nmm", "max\nmm", "NEES\ntip", "NIS\n/dof"):
            table.add_column(head, justify="right")
        for kind, score in self.kinds.items():
            eq17 = score.eq17_px or {}
            keys = ("median", "mean", "p95", "max", "slope_per_min")
            values = [eq17.get(key) for key in keys]
            values += [score.tip_mm.get("rmse"), score.tip_mm.get("max")]
            values += [score.nees_tip, score.nis_per_dof]
            table.add_row(kind, *("-" if v is None else f"{v:.2f}" for v in values))
        return table


def evaluate(log: Path) -> Evaluation:
    """Compare the estimates of a log with its truth.

    Parameters
    ----------
    log : Path
        A log with estimates, and truth from the simulator or motion capture.

    Raises
    ------
    RecordingError
        If the log cannot be read, holds no estimates, no truth, or no instant common to both.
    """
    reader = LogReader(log)
    history = read_history(reader)
    if not history.estimates:
        msg = f"{log}: holds no estimates; make them with: avionics replay {log} -o replayed.mcap"
        raise RecordingError(msg)
    if history.truth is None:
        msg = f"{log}: holds no truth and no motion capture; there is nothing to compare with"
        raise RecordingError(msg)
    config = one_wing(reader.config, f"{log}: evaluate")
    comparison = Comparison(config, history, history.truth)
    if not comparison.t_ns.size:
        msg = (
            f"{log}: estimates and truth have no instant in common after the first "
            f"{SETTLE_S:.0f} s, which are not scored"
        )
        raise RecordingError(msg)
    kinds = {kind: comparison.score(rows) for kind, rows in history.estimates.items()}
    return Evaluation(history.truth.source, kinds, _track_figures(history))


def _track_figures(history: LogHistory) -> dict[str, Any]:
    found = history.found
    if not found.size:
        return {"frames": len(found), "found": None, "lost": None}
    lost = int((found[:-1] & ~found[1:]).sum())
    return {"frames": len(found), "found": float(found.mean()), "lost": lost}


class Comparison:
    """Truth at the instants of comparison ``t_ns``, against which every kind is scored.

    ``tip_m`` (n, 3) is the true end of the reference line there; ``settle_s`` after the first
    common instant is left out.
    """

    def __init__(
        self,
        config: Config,
        history: LogHistory,
        truth: TruthHistory,
        *,
        settle_s: float = SETTLE_S,
    ) -> None:
        self._config, self._truth = config, truth
        self._camera = pinhole_from_config(config.camera) if config.camera else None
        self._markers = config.truth_markers or config.markers
        offset_ns = round(config.camera.time_offset_s * 1e9) if config.camera else 0
        instants = history.frame_ns + offset_ns
        rows = next(iter(history.estimates.values())).t_ns
        if not instants.size:
            instants = rows
        first_ns = max(int(truth.t_ns[0]), int(min(rows[0], instants[0])))
        instants = instants[instants >= first_ns + round(settle_s * 1e9)]
        marker_m = between(truth.t_ns, truth.marker_m, instants)
        tip_m = self._true_tip(marker_m, instants)
        is_known = np.isfinite(marker_m[..., 0]).any(axis=1)
        self.t_ns = instants[is_known]
        self._start_ns = first_ns
        self._marker_m, self.tip_m = marker_m[is_known], tip_m[is_known]

    def _true_tip(self, marker_m: FloatArray, t_ns: Any) -> FloatArray:
        if self._truth.tip_m is not None:
            return between(self._truth.t_ns, self._truth.tip_m, t_ns)
        return tip_from_markers(self._config, self._markers, marker_m)

    def score(self, rows: EstimateHistory) -> KindScore:
        """Return the figures of one kind."""
        basis, q, known, points = self._shape(rows)
        tip = between(rows.t_ns, rows.tip_m, self.t_ns, max_gap_ns=ROW_GAP_NS)
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

    def _shape(self, rows: EstimateHistory) -> tuple[ModeBasis, FloatArray, Any, FloatArray]:
        """Return basis, amplitudes, where they are known, and the marker positions."""
        q = between(rows.t_ns, rows.amplitude_rad, self.t_ns, max_gap_ns=ROW_GAP_NS)
        known = np.isfinite(q).all(axis=1)
        basis = recorded_basis(self._config, rows.basis)
        points = np.full((len(q), len(self._markers), 3), np.nan)
        if known.any():
            points[known] = self._points(basis, q[known])
        return basis, q, known, points

    def marker_error_px(self, rows: EstimateHistory) -> tuple[TimeArray, FloatArray]:
        """Return instants, ns, and Eq. 17 of Srikanth et al., px, at each."""
        return self._error_px(self._shape(rows)[3])

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
        if self._truth.angles_rad is None or not known.any():
            return {}
        count = self._truth.angles_rad.shape[2]
        span = self._config.wing.span_m
        places_m = np.linspace(0.0, span, count)
        at = WingGeometry(basis, places_m, psi0=self._config.wing.psi0_rad).at(q[known])
        shape = (at.phi, at.theta, at.psi)
        true = between(self._truth.t_ns, self._truth.angles_rad, self.t_ns[known])
        error = np.degrees(np.stack(shape, axis=1) - true)
        rmse = np.sqrt(np.nanmean(error**2, axis=(0, 2)))
        names = ("phi", "theta", "psi")
        return {"angle_deg_rmse": {n: _number(v) for n, v in zip(names, rmse, strict=True)}}


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
