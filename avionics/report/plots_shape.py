"""The figures of a report at chosen instants: markers over the frame, the wing seen from behind."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from avionics.analysis.interpolation import linear_at
from avionics.analysis.series import TrackSeries
from avionics.flight.filter_setup import pinhole_from_config
from avionics.kinds import CRG, PAPER, RG, TRACKS, TRUTH, style_of
from avionics.records import FloatArray
from avionics.report.plots import SETTLED_S, WIDTH_IN
from avionics.report.subject import Subject
from drivers.samples import Frame

INSTANTS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Instant:
    """One chosen instant.

    Attributes
    ----------
    t_ns : int
        The instant on the gyro clock, ns.
    frame_index : int or None
        The frame exposed then.
    label : str
        "t1" and so on.
    """

    t_ns: int
    frame_index: int | None
    label: str


def choose_instants(subject: Subject) -> list[Instant]:
    """Return the start, and the lowest, highest and lowest tip of the flight's three thirds.

    Instants are those of frames where there are frames.
    """
    estimates = subject.main_estimate
    t_ns, height = estimates.t_ns, -estimates.line_in_body_m[:, -1, 2]
    tracks = subject.tracks
    if tracks is not None:
        exposures = tracks.t_ns
        inside = (exposures >= t_ns[0]) & (exposures <= t_ns[-1])
        if inside.any():
            t_ns = exposures[inside]
            height = np.interp(t_ns - t_ns[0], estimates.t_ns - t_ns[0], height)
    settled = np.flatnonzero(t_ns >= t_ns[0] + round(SETTLED_S * 1e9))
    if len(settled) < INSTANTS:
        settled = np.arange(len(t_ns))
    thirds = np.array_split(settled, INSTANTS - 1)
    signed = [sign * height[third] for sign, third in zip((-1, 1, -1), thirds, strict=True)]
    extremes = [
        third[np.nanargmax(value)]
        for third, value in zip(thirds, signed, strict=True)
        if np.isfinite(value).any()
    ]
    index_of = {} if tracks is None else _frame_by_exposure(tracks)
    return [
        Instant(int(t_ns[at]) + subject.offset_ns, index_of.get(int(t_ns[at])), f"t{number + 1}")
        for number, at in enumerate(sorted({int(settled[0]), *map(int, extremes)}))
    ]


def _frame_by_exposure(tracks: TrackSeries) -> dict[int, int]:
    return dict(zip(tracks.t_ns.tolist(), tracks.frame_index.tolist(), strict=True))


def _grid(count: int, row_height_in: float) -> tuple[Figure, list[Axes]]:
    columns = min(2, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(WIDTH_IN, row_height_in * rows), layout="constrained")
    axes = [axes for row in figure.subplots(rows, columns, squeeze=False) for axes in row]
    for unused in axes[count:]:
        unused.set_axis_off()
    return figure, axes[:count]


def frames_figure(
    subject: Subject, instants: Sequence[Instant], frames: dict[int, Frame]
) -> Figure | None:
    """Draw markers as tracked, as estimated and as they truly were over the camera's pictures.

    Returns
    -------
    Figure or None
        None if the log holds none of the frames.
    """
    shown = [
        (instant, frames[instant.frame_index])
        for instant in instants
        if instant.frame_index in frames
    ]
    if not shown:
        return None
    figure, axes = _grid(len(shown), 4.3)
    for panel, (instant, frame) in zip(axes, shown, strict=True):
        height, width = frame.image.shape[:2]
        image = frame.image if frame.image.ndim == 2 else frame.image[..., ::-1]
        # The square root lifts the wing out of the dark that a short exposure leaves.
        panel.imshow(image, cmap="gray", norm=PowerNorm(0.5, 0, 255), interpolation="nearest")
        _overlay(panel, subject, instant)
        panel.set_xlim(-0.5, width - 0.5)
        panel.set_ylim(height - 0.5, -0.5)
        panel.set_xticks([])
        panel.set_yticks([])
        panel.grid(visible=False)
        seconds = float(subject.seconds(instant.t_ns))
        panel.set_title(f"{instant.label} = {seconds:.2f} s, frame {frame.index}", fontsize=10)
    figure.legend(handles=_overlay_legend(subject), loc="outside upper center", ncols=4)
    return figure


def _overlay(panel: Axes, subject: Subject, instant: Instant) -> None:
    tracks, truth = subject.tracks, subject.truth
    if tracks is not None:
        pixel = linear_at(tracks.t_ns, tracks.pixel, instant.t_ns - subject.offset_ns)
        _dots(panel, pixel, marker="s", ms=13, mec=TRACKS.colour, mew=1.4)
    for kind, colour in ((RG, "white"), (CRG, "#ff3030")):
        if kind in subject.estimates:
            estimates = subject.estimates[kind]
            pixel = linear_at(estimates.t_ns, estimates.marker_px, instant.t_ns)
            _dots(panel, pixel, marker="o", ms=9, mec=colour, mew=1.4)
    camera = subject.config.camera
    if truth is not None and camera is not None:
        points = linear_at(truth.t_ns, truth.marker_in_body_m, instant.t_ns)
        pinhole = pinhole_from_config(camera)
        pixel = pinhole.project(points)[np.isfinite(points).all(axis=1) & pinhole.can_see(points)]
        _dots(panel, pixel, marker="+", ms=8, mec="#3ddc63", mew=1.2)


def _dots(panel: Axes, pixel: FloatArray, **style: Any) -> None:
    panel.plot(pixel[:, 0], pixel[:, 1], ls="none", mfc="none", **style)


def _overlay_legend(subject: Subject) -> list[Line2D]:
    entries = [
        ("s", TRACKS.colour, "tracked"),
        ("o", "#999999", f"{style_of(RG).label}, white"),
        ("o", "#ff3030", style_of(CRG).label),
    ]
    if subject.truth is not None:
        entries.append(("+", "#3ddc63", f"truth ({subject.truth.source}), projected"))
    return [
        Line2D([], [], ls="none", marker=marker, mfc="none", mec=colour, mew=1.4, label=label)
        for marker, colour, label in entries
    ]


def side_figure(subject: Subject, instants: Sequence[Instant]) -> Figure:
    """Draw the reference line seen from behind, up is up, at the chosen instants."""
    figure, axes = _grid(len(instants), 2.6)
    truth = subject.truth
    for panel, instant in zip(axes, instants, strict=True):
        if truth is not None:
            if truth.line_in_body_m is not None:
                line = linear_at(truth.t_ns, truth.line_in_body_m, instant.t_ns)
                panel.plot(line[:, 1], -line[:, 2], color=TRUTH.colour, lw=3, alpha=0.5)
            points = linear_at(truth.t_ns, truth.marker_in_body_m, instant.t_ns)
            panel.plot(points[:, 1], -points[:, 2], ls="none", marker="+", color=TRUTH.colour, ms=7)
        for kind in PAPER:
            if kind in subject.estimates:
                estimates = subject.estimates[kind]
                line = linear_at(estimates.t_ns, estimates.line_in_body_m, instant.t_ns)
                panel.plot(line[:, 1], -line[:, 2], color=style_of(kind).colour, lw=1.6)
        panel.set_aspect("equal", adjustable="datalim")
        seconds = float(subject.seconds(instant.t_ns))
        panel.set_title(f"{instant.label} = {seconds:.2f} s", fontsize=10)
        panel.set_xlabel("span y, m")
        panel.set_ylabel("up −z, m")
    handles = [
        Line2D([], [], color=style_of(kind).colour, label=style_of(kind).label)
        for kind in PAPER
        if kind in subject.estimates
    ]
    if truth is not None:
        label = f"truth ({truth.source})"
        handles.append(Line2D([], [], color=TRUTH.colour, marker="+", label=label))
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure
