"""The figures of merit of a report: those of ``evaluate``, and the errors over time behind them."""

from dataclasses import dataclass, field

import numpy as np

from avionics.analysis.comparison import SETTLE_S
from avionics.analysis.evaluate import Evaluation, compare, evaluate
from avionics.analysis.flight import Flight
from avionics.analysis.series import TimeArray, WingData
from avionics.errors import RecordingError
from avionics.kinds import in_order, style_of
from avionics.records import FloatArray

HEAD = ("estimate", "median, px", "mean, px", "95 %, px", "max, px", "slope, px/min",
        "tip RMS, mm", "tip max, mm", "tip NEES", "NIS per DOF")  # fmt: skip
NOTE = (
    f"After the first {SETTLE_S:.0f} s. Pixels: mean error of the visible markers (Eq. 17). Tip:"
    " distance from the true end of the reference line. NEES and NIS are near 1 where the filter"
    " is consistent: its sigmas are those of its errors."
)


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One quantity over time.

    Attributes
    ----------
    t_ns : ndarray of int64, shape (n,)
        When, ns, increasing.
    values : ndarray, shape (n, ...)
        What.
    """

    t_ns: TimeArray
    values: FloatArray


@dataclass(slots=True, eq=False)
class Scores:
    """What the comparison with the truth gives.

    Attributes
    ----------
    rows : list of tuple of str
        One row per estimate, columns as in ``HEAD``.
    why_none : str
        Why there is no table; empty if there is one.
    errors : dict of str to Curve
        Marker error by kind over the whole flight, px.
    truth_tip : Curve or None
        True position of the tip, (n, 3), m.
    """

    rows: list[tuple[str, ...]] = field(default_factory=list)
    why_none: str = ""
    errors: dict[str, Curve] = field(default_factory=dict)
    truth_tip: Curve | None = None


def score_flight(flight: Flight, wing: WingData) -> Scores:
    """Return the comparison of a wing's estimates with its truth."""
    scores = Scores()
    try:
        scores.rows = _rows(evaluate(flight, wing.name))
    except RecordingError as error:
        scores.why_none = str(error).removeprefix(f"{flight.path}: ")
    if wing.truth is None or not wing.estimates:
        return scores
    comparison = compare(flight, wing, settle_s=0.0)
    known = np.isfinite(comparison.tip_m).all(axis=1)
    if known.sum() > 1:
        scores.truth_tip = Curve(comparison.t_ns[known], comparison.tip_m[known])
    for kind in in_order(wing.estimates):
        t_ns, distance_px = comparison.marker_error_px(wing.estimates[kind])
        if distance_px.size:
            scores.errors[kind] = Curve(t_ns, distance_px)
    return scores


def _rows(evaluation: Evaluation) -> list[tuple[str, ...]]:
    rows = []
    for kind in in_order(evaluation.kinds):
        score = evaluation.kinds[kind]
        pixels = score.eq17_px or {}
        numbers = [pixels.get(key) for key in ("median", "mean", "p95", "max")]
        slope = pixels.get("slope_per_min")
        tip = [score.tip_mm.get(key) for key in ("rmse", "max")]
        rows.append(
            (
                style_of(kind).label,
                *(_text(number, ".2f") for number in numbers),
                _text(slope, "+.2f"),
                *(_text(number, ".1f") for number in tip),
                _text(score.nees_tip, ".3g"),
                _text(score.nis_per_dof, ".2f"),
            )
        )
    return rows


def _text(number: float | None, form: str) -> str:
    return "-" if number is None else format(number, form)
