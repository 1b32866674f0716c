"""Figures of a distributed-POS study: track, flexure, errors over time, tables as pictures."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from avionics.pos.compiled import Array
from avionics.pos.earth import EQUATOR_RADIUS
from avionics.pos.metrics import Segment
from avionics.pos.simulate import SlaveTruth
from avionics.pos.study.results import ARCMIN, AXES
from avionics.pos.study.runs import Line
from avionics.pos.study.spec import PublishedTable
from avionics.pos.trajectory import Trajectory
from avionics.report.plots import AXIS_COLOURS, WIDTH_IN

METHOD_COLOURS = {
    "IMU": "#1f6feb",
    "Gs": "#c8102e",
    "Gs, with variation": "#e08a00",
    "As": "#1a7f37",
    "GA": "#7b3fa0",
    "modal": "#1f6feb",
    "Markov": "#e08a00",
}
PAPER_COLOUR = "#1c2430"
DRAWN_POINTS = 2600
VECTOR_POINTS = 2000
CONSTANT = 1e-6  # arcmin: the STD of a smoothed constant is rounding
FAR = 6.0  # a method whose error is so many times the second best's hides the others


def colour_of(method: str) -> str:
    """Return the colour of a method; a smoothed estimate has its filter's."""
    return METHOD_COLOURS.get(method.removesuffix(" smoothed"), "#6b7785")


def _thin(values: Array) -> Array:
    return values[:: max(1, len(values) // DRAWN_POINTS)]


def _draw(axes: Axes, t: Array, y: Array, colour: str, label: str = "") -> None:
    t, y = _thin(t), _thin(y)
    axes.plot(t, y, color=colour, label=label or None, rasterized=len(t) > VECTOR_POINTS)


def _shade(axes: Axes, segments: Sequence[Segment], *, named: bool = False) -> None:
    for segment in segments:
        axes.axvspan(segment.start, segment.end, color="#dfe6ee", alpha=0.55, lw=0, zorder=0)
        if named:
            middle = 0.5 * (segment.start + segment.end)
            axes.text(
                middle, 0.97, segment.name, transform=axes.get_xaxis_transform(),
                ha="center", va="top", fontsize=9, color="#4a5563",
            )  # fmt: skip


def _legend_above(axes: Axes, columns: int = 5) -> None:
    legend = axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, borderaxespad=0.2)
    for line in legend.get_lines():
        line.set_linewidth(2.5)


def track_figure(trajectories: Mapping[str, Trajectory], segments: Sequence[Segment]) -> Figure:
    """Draw the plane trajectory, counted segments bold, and speed and bank over time.

    Parameters
    ----------
    trajectories : mapping of str to Trajectory
        By scenario.
    segments : sequence of Segment
        Where errors are counted.
    """
    figure = Figure(figsize=(WIDTH_IN, 4.6), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.1))
    plane = figure.add_subplot(grid[:, 0])
    over_time = [figure.add_subplot(grid[row, 1]) for row in range(3)]
    for number, (name, trajectory) in enumerate(trajectories.items()):
        colour = ("#1f6feb", "#e08a00")[number % 2]
        east = (
            (trajectory.longitude - trajectory.longitude[0])
            * EQUATOR_RADIUS
            * np.cos(trajectory.latitude[0])
        )
        north = (trajectory.latitude - trajectory.latitude[0]) * EQUATOR_RADIUS
        plane.plot(_thin(east) / 1e3, _thin(north) / 1e3, color=colour, label=name, lw=1.0)
        for segment in segments:
            mine = (trajectory.t >= segment.start) & (trajectory.t <= segment.end)
            plane.plot(_thin(east[mine]) / 1e3, _thin(north[mine]) / 1e3, color=colour, lw=3.0)
            place = np.flatnonzero(mine)[mine.sum() // 2]
            plane.annotate(
                segment.name, (east[place] / 1e3, north[place] / 1e3),
                textcoords="offset points", xytext=(7, 5), fontsize=9,
            )  # fmt: skip
        plane.plot(0, 0, "o", color=PAPER_COLOUR, ms=4)
        speed = np.linalg.norm(trajectory.velocity, axis=1)
        shown = (speed, np.rad2deg(trajectory.euler[:, 0]), np.rad2deg(trajectory.euler[:, 2]))
        for axes, values in zip(over_time, shown, strict=True):
            _draw(axes, trajectory.t, values, colour)
    plane.set_aspect("equal", adjustable="datalim")
    plane.set_xlabel("east, km")
    plane.set_ylabel("north, km")
    if len(trajectories) > 1:
        _legend_above(plane)
    for axes, label in zip(over_time, ("speed, m/s", "heading, deg", "roll, deg"), strict=True):
        axes.set_ylabel(label)
        _shade(axes, segments, named=label.startswith("speed"))
    for axes in over_time[:-1]:
        axes.tick_params(labelbottom=False)
    over_time[-1].set_xlabel("time, s")
    return figure


def flexure_figure(trajectory: Trajectory, truth: SlaveTruth, *, rate: bool) -> Figure:
    """Draw the true flexure angle, deg, or its rate, deg/s, of one run about the three axes."""
    figure = Figure(figsize=(WIDTH_IN, 4.4), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    values = np.rad2deg(truth.theta_dot if rate else truth.theta)
    for axis, (axes, name) in enumerate(zip(panels, AXES, strict=True)):
        _draw(axes, trajectory.t, values[:, axis], AXIS_COLOURS[name])
        axes.set_ylabel(f"{name}, {'deg/s' if rate else 'deg'}")
    panels[-1].set_xlabel("time, s")
    return figure


def error_figure(
    lines: Sequence[Line], segments: Sequence[Segment], quantity: int, *, with_sigma: bool = False
) -> Figure:
    """Draw errors over time: at full scale, and at the scale of the second best method.

    Parameters
    ----------
    lines : sequence of Line
        Methods; the first seed's run is drawn.
    segments : sequence of Segment
        Shaded.
    quantity : int
        0 system error angle, 1 misalignment, 2 flexure.
    with_sigma : bool
        Add each filter's own two-sigma band, and draw the close scale only.
    """
    sizes = _sizes(lines, segments, quantity)
    close, far = np.sort(sizes, axis=0)[min(1, len(lines) - 1)], sizes.max(axis=0)
    start = np.max([np.abs(line.trace.error[quantity]).max(axis=0) for line in lines], axis=0)
    columns = 1 if with_sigma or np.all(start * ARCMIN < FAR * close) else 2
    figure = Figure(figsize=(WIDTH_IN, 6.2), layout="constrained")
    grid = figure.subplots(3, columns, sharex=True, squeeze=False)
    for column in range(columns):
        is_close = columns > 1 and column == 1
        for axis, name in enumerate(AXES):
            axes = grid[axis][column]
            for i, line in enumerate(lines):
                if is_close and sizes[i, axis] > FAR * close[axis]:
                    continue
                _error_line(
                    axes, line, quantity, axis,
                    with_sigma=with_sigma, above=-float(sizes[i, axis]),
                )  # fmt: skip
            if with_sigma or is_close:
                high = (far if with_sigma else close)[axis]
                axes.set_ylim(-2.2 * high, 2.2 * high)
            axes.set_ylabel(f"{name}, arcmin")
            _shade(axes, segments, named=axis == 0)
        grid[-1][column].set_xlabel("time, s")
    _legend_above(grid[0][0])
    return figure


def _sizes(lines: Sequence[Line], segments: Sequence[Segment], quantity: int) -> Array:
    """Size of the methods' errors inside the segments by axis, arcmin, shape (L, 3)."""
    sizes = np.array(
        [np.percentile(np.abs(_settled(line, segments, quantity)), 99.0, axis=0) for line in lines]
    )
    result: Array = np.maximum(sizes, 1e-6)
    return result


def _error_line(
    axes: Axes, line: Line, quantity: int, axis: int, *, with_sigma: bool, above: float
) -> None:
    colour = colour_of(line.method)
    error = line.trace.error[quantity, :, axis] * ARCMIN
    _draw(axes, line.trace.t, error, colour, line.method)
    axes.lines[-1].set_zorder(2.0 + 0.5 / (1.0 - above))  # small errors over large ones
    if with_sigma:
        t, band = _thin(line.trace.t), 2.0 * _thin(line.trace.sigma[quantity, :, axis]) * ARCMIN
        axes.fill_between(t, -band, band, color=colour, alpha=0.12, lw=0, rasterized=True)


def _settled(line: Line, segments: Sequence[Segment], quantity: int) -> Array:
    """Errors inside the segments, arcmin, shape (K, 3)."""
    t = line.trace.t
    inside = np.any([(t >= s.start) & (t <= s.end) for s in segments], axis=0)
    values: Array = line.trace.error[quantity][inside] * ARCMIN
    return values


def score_figure(
    lines: Sequence[Line], published: Sequence[PublishedTable], quantity: int
) -> Figure:
    """Draw RMSE and STD by method and axis: runs, their mean, own prediction, the paper.

    Parameters
    ----------
    lines : sequence of Line
        Methods in one scenario.
    published : sequence of PublishedTable
        The paper's, by method's name.
    quantity : int
        As in ``error_figure``.
    """
    figure = Figure(figsize=(WIDTH_IN, 5.4), layout="constrained")
    panels = figure.subplots(2, 3, sharex=True, sharey="row")
    for row, what in enumerate(("rmse", "std")):
        panels[row][0].set_yscale("log")
        panels[row][0].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panels[row][0].set_ylabel(f"{what.upper()}, arcmin")
        for axis, name in enumerate(AXES):
            axes = panels[row][axis]
            _score_panel(axes, lines, published, quantity, what=what, axis=axis)
            if row == 0:
                axes.set_title(name, loc="left")
            axes.set_xlim(-0.6, len(lines) - 0.4)
            axes.set_xticks(
                range(len(lines)), [line.method for line in lines],
                rotation=40, ha="right", rotation_mode="anchor",
            )  # fmt: skip
            axes.minorticks_off()
        low, high = panels[row][0].get_ylim()
        subs = (1.0,) if high > 300.0 * low else (1.0, 2.0, 5.0)
        panels[row][0].yaxis.set_major_locator(LogLocator(subs=subs))
    grey = "#6b7785"
    marks = [
        panels[1][2].plot([], [], "o", color=grey, ms=4, alpha=0.6)[0],
        panels[1][2].plot([], [], "_", color=grey, ms=14, mew=2.5)[0],
        panels[1][2].plot([], [], "<", color=grey, ms=6, mfc="white")[0],
        panels[1][2].plot([], [], "D", color=PAPER_COLOUR, ms=5)[0],
    ]
    names = ["runs", "mean", "predicted sigma", "paper"]
    figure.legend(marks, names, loc="outside upper right", ncols=4, frameon=False)
    return figure


def _score_panel(
    axes: Axes,
    lines: Sequence[Line],
    published: Sequence[PublishedTable],
    quantity: int,
    *,
    what: str,
    axis: int,
) -> None:
    shown = [line for line in lines if line.mean("sigma", quantity)[axis] > 0.0]
    if not shown:
        axes.text(0.5, 0.5, "not estimated", transform=axes.transAxes, ha="center")
    for place, line in enumerate(lines):
        if line not in shown:
            continue
        runs = line.by_run(what, quantity)[:, axis] * ARCMIN
        if runs.max() < CONSTANT:
            continue
        colour = colour_of(line.method)
        axes.plot([place] * len(runs), runs, "o", color=colour, ms=4, alpha=0.45, mew=0)
        axes.plot(place, runs.mean(), "_", color=colour, ms=18, mew=2.5)
        if what == "rmse":
            sigma = line.mean("sigma", quantity)[axis] * ARCMIN
            axes.plot(place + 0.28, sigma, "<", color=colour, ms=6, mfc="white")
        for table in published:
            value = getattr(table, what)[axis]
            if table.method == line.method and value > 0.0:
                axes.plot(place - 0.28, value, "D", color=PAPER_COLOUR, ms=5)
