"""The figures of a report over time: errors, deflection, rates, innovations, markers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from avionics.analysis.bounds import mean_square_bounds
from avionics.analysis.series import EstimateSeries, FlagArray, TrackSeries
from avionics.kinds import CRG, PAPER, RG, TRACKS, TRUTH, style_of
from avionics.records import ROOT, FloatArray
from avionics.report.scores import Curve
from avionics.report.subject import Subject

AXIS_COLOURS = {"x": "#c8102e", "y": "#1a7f37", "z": "#1f6feb"}
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.xmargin": 0.005,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.0,
    "savefig.dpi": 170,
    "svg.hashsalt": "wing-avionics",
}
WIDTH_IN = 11.0
VECTOR_POINTS = 2000
"""Lines with more points are drawn as pixels inside the vector figure, which stays small."""
ZOOM_S = 4.0
SETTLED_S = 1.0
"""The start is left out where a figure looks for what is typical."""


def _line(axes: Axes, t: FloatArray, y: FloatArray, colour: str, label: str = "") -> None:
    (line,) = axes.plot(t, y, color=colour, rasterized=len(t) > VECTOR_POINTS)
    if label:
        line.set_label(label)


def _legend(axes: Axes, columns: int = 4) -> None:
    legend = axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, borderaxespad=0.2)
    for line in legend.get_lines():
        line.set_linewidth(2.5)


def _panels(rows: int, height_in: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False)
    axes = list(grid[:, 0])
    axes[-1].set_xlabel("time, s")
    return figure, axes


def error_figure(subject: Subject, errors: Mapping[str, Curve]) -> Figure:
    """Draw the marker error over time, all estimates above, the camera-aided ones below.

    Parameters
    ----------
    subject : Subject
        The flight.
    errors : mapping of str to Curve
        Mean pixel error of the visible markers by kind of estimate (Srikanth et al., Eq. 17).
    """
    aided = {kind: series for kind, series in errors.items() if kind != RG}
    both = RG in errors and bool(aided)
    figure, axes = _panels(2 if both else 1, 5.6 if both else 3.2)
    for panel, shown in zip(axes, (errors, aided), strict=False):
        for kind, series in shown.items():
            style = style_of(kind)
            _line(panel, subject.seconds(series.t_ns), series.values, style.colour, style.label)
        panel.set_ylabel("marker error, px")
        panel.set_ylim(bottom=0)
    _legend(axes[0])
    if both:
        axes[1].set_title("camera-aided alone, own scale", loc="left", fontsize=9)
        high = max(np.nanpercentile(series.values, 99) for series in aided.values())
        axes[1].set_ylim(0, 1.3 * high)
    return figure


def tip_figure(subject: Subject, truth_tip: Curve | None) -> Figure:
    """Draw the height of the tip with its two-sigma band: whole flight, its liveliest moment.

    Parameters
    ----------
    subject : Subject
        The flight.
    truth_tip : Curve or None
        True position of the tip, (n, 3), body axes, m; a third panel shows the error if given.
    """
    figure = Figure(figsize=(WIDTH_IN, 8.0 if truth_tip else 5.6), layout="constrained")
    axes = list(figure.subplots(3 if truth_tip else 2, 1, squeeze=False)[:, 0])
    for panel in axes[:2]:
        if truth_tip is not None:
            t = subject.seconds(truth_tip.t_ns)
            _line(panel, t, -1e3 * truth_tip.values[:, 2], TRUTH.colour, TRUTH.label)
        for kind in PAPER:
            if kind in subject.estimates:
                _tip(panel, subject, kind)
        panel.set_ylabel("tip above root, mm")
    _legend(axes[0])
    middle_s = _liveliest_s(subject)
    axes[1].set_xlim(middle_s - ZOOM_S / 2, middle_s + ZOOM_S / 2)
    axes[0].set_ylim(*_height_limits(subject, -np.inf, np.inf))
    axes[1].set_ylim(*_height_limits(subject, middle_s - ZOOM_S / 2, middle_s + ZOOM_S / 2))
    axes[1].set_title(f"{ZOOM_S:.0f} s around the fastest motion", loc="left", fontsize=9)
    if truth_tip is not None:
        _tip_error(axes[2], subject, truth_tip)
    axes[-1].set_xlabel("time, s")
    return figure


def _tip(panel: Axes, subject: Subject, kind: str) -> None:
    estimates = subject.estimates[kind]
    t, height = estimates.t_s, -1e3 * estimates.line_in_body_m[:, -1, 2]
    style = style_of(kind)
    _line(panel, t, height, style.colour, style.label)
    if kind == CRG:
        band = 2e3 * estimates.tip_sigma_m[:, 2]
        panel.fill_between(
            t, height - band, height + band, color=style.colour, alpha=0.2, lw=0, rasterized=True
        )


def _tip_error(panel: Axes, subject: Subject, truth_tip: Curve) -> None:
    estimates = subject.main_estimate
    inside = (estimates.t_ns >= truth_tip.t_ns[0]) & (estimates.t_ns <= truth_tip.t_ns[-1])
    t = estimates.t_s[inside]
    true = np.interp(t, subject.seconds(truth_tip.t_ns), truth_tip.values[:, 2])
    error = 1e3 * (true - estimates.line_in_body_m[inside, -1, 2])
    band = 2e3 * estimates.tip_sigma_m[inside, 2]
    panel.fill_between(t, -band, band, color="#999999", alpha=0.35, lw=0, rasterized=True)
    _line(panel, t, error, style_of(CRG).colour)
    panel.set_ylabel("tip error, mm")
    panel.set_title(f"error of {style_of(CRG).label} and its ± 2 σ", loc="left", fontsize=9)
    settled = t >= t[0] + min(SETTLED_S, (t[-1] - t[0]) / 2)
    high = float(np.nanpercentile(np.abs(error[settled]), 99.5))
    limit = 1.3 * max(high, float(np.nanmedian(band)), 0.1)
    panel.set_ylim(-limit, limit)


def _height_limits(subject: Subject, begin_s: float, end_s: float) -> tuple[float, float]:
    """Return the range of the drawn heights, mm, without the first second's wide guesses."""
    heights = []
    for kind in PAPER:
        estimates = subject.estimates.get(kind)
        if estimates is None:
            continue
        t = estimates.t_s
        shown = (t >= max(begin_s, t[0] + SETTLED_S)) & (t <= end_s)
        heights.append(
            -1e3 * estimates.line_in_body_m[shown if shown.any() else slice(None), -1, 2]
        )
    both = np.concatenate(heights) if heights else np.zeros(1)
    low, high = float(np.nanmin(both)), float(np.nanmax(both))
    margin = 0.08 * (high - low) + 2.0
    return low - margin, high + margin


def _liveliest_s(subject: Subject) -> float:
    estimates = subject.main_estimate
    t, height = estimates.t_s, estimates.line_in_body_m[:, -1, 2]
    if len(t) < 3:
        return float(t[0])
    speed = np.where(t < t[0] + min(SETTLED_S, t[-1] - t[0]), 0.0, np.abs(np.gradient(height, t)))
    middle = float(t[int(np.nanargmax(speed))])
    return max(min(middle, float(t[-1]) - ZOOM_S / 2), float(t[0]) + ZOOM_S / 2)


def rates_figure(subject: Subject) -> Figure:
    """Draw the angular rates of every pod, sensor axes, deg/s."""
    figure, axes = _panels(len(subject.imu), 1.0 + 2.0 * len(subject.imu))
    for panel, (pod, samples) in zip(axes, subject.imu.items(), strict=True):
        for axis, column in zip("xyz", np.degrees(samples.rate_rad_s).T, strict=True):
            _line(panel, samples.t_s, column, AXIS_COLOURS[axis], axis)
        panel.set_ylabel(f"{_pod(pod)}, °/s")
    _legend(axes[0])
    return figure


def _pod(name: str) -> str:
    return name if name == ROOT else f"pod {name}"


def bias_figure(subject: Subject, estimates: EstimateSeries) -> Figure:
    """Draw the estimated gyro biases with their two-sigma bands, deg/s."""
    pods = estimates.bias_rad_s.shape[1]
    figure, axes = _panels(pods, 1.0 + 1.8 * pods)
    t = estimates.t_s
    names = subject.config.pod_names
    for number, panel in enumerate(axes):
        bias = np.degrees(estimates.bias_rad_s[:, number])
        band = 2 * np.degrees(estimates.bias_sigma_rad_s[:, number])
        for axis, column, width in zip("xyz", bias.T, band.T, strict=True):
            _line(panel, t, column, AXIS_COLOURS[axis], axis)
            panel.fill_between(
                t, column - width, column + width, color=AXIS_COLOURS[axis], alpha=0.15, lw=0,
                rasterized=True,
            )  # fmt: skip
        low, high = np.nanmin(bias), np.nanmax(bias)
        margin = 0.2 * (high - low) + 0.05
        panel.set_ylim(low - margin, high + margin)
        panel.set_ylabel(f"{_pod(names[number])}, °/s" if number < len(names) else "°/s")
    _legend(axes[0])
    return figure


def innovation_figure(subject: Subject, filtered: EstimateSeries) -> Figure:
    """Draw the normalised innovation squared of every frame, and how many markers it used."""
    figure, axes = _panels(2, 4.6)
    used = filtered.used.sum(axis=1)
    known = np.isfinite(filtered.nis) & (used > 0)
    t, nis = filtered.t_s[known], filtered.nis[known]
    freedom = 2 * used[known]
    low, high = mean_square_bounds(freedom)
    axes[0].fill_between(t, low, high, step="mid", color="#1a7f37", alpha=0.15, lw=0)
    dot: dict[str, Any] = {"marker": ".", "ms": 3, "ls": "none", "rasterized": True}
    axes[0].plot(t, np.maximum(nis, 1e-3), color=style_of(CRG).colour, **dot)
    axes[0].axhline(1.0, color="#333333", lw=0.8)
    axes[0].set_yscale("log")
    axes[0].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes[0].set_ylabel("NIS per degree of freedom")
    axes[1].step(
        filtered.t_s, used, where="mid", color=style_of(CRG).colour,
        label="used by the update", rasterized=True,
    )  # fmt: skip
    if (tracks := subject.tracks) is not None:
        axes[1].step(
            tracks.t_s, tracks.found.sum(axis=1), where="mid",
            color=TRACKS.colour, label="found in the frame", rasterized=True, zorder=0,
        )  # fmt: skip
    axes[1].set_ylabel("markers")
    axes[1].set_ylim(bottom=0)
    axes[1].legend(loc="lower left", ncols=2)
    return figure


def found_figure(subject: Subject, tracks: TrackSeries) -> Figure:
    """Draw for every marker when it was found (blue) and when it was not (red)."""
    count = tracks.found.shape[1]
    figure, (panel,) = _panels(1, 1.2 + 0.32 * count)
    t = tracks.t_s
    ends = np.append(t[1:], t[-1] + (np.median(np.diff(t)) if len(t) > 1 else 0.03))
    for row in range(count):
        for value, colour in ((True, TRACKS.colour), (False, style_of(CRG).colour)):
            spans = _spans(tracks.found[:, row] == value, t, ends)
            panel.broken_barh(spans, (row - 0.35, 0.7), color=colour, lw=0)
    panel.set_yticks(range(count), [f"marker {subject.marker_ids[row]}" for row in range(count)])
    panel.set_ylim(count - 0.4, -0.6)
    panel.grid(visible=False)
    return figure


def _spans(flags: FlagArray, t: FloatArray, ends: FloatArray) -> Sequence[tuple[float, float]]:
    """Return (start, length) of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(t[a], ends[b - 1] - t[a]) for a, b in edges.reshape(-1, 2)]
