"""The design question's answer as table, picture, Parquet and page."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from avionics.pos.study.design import METHODS, Cell, Design, cheapest_sensors
from avionics.pos.study.figures import colour_of
from avionics.pos.study.results import AXES, digits, write_rows
from avionics.report.page import Page
from avionics.report.plots import STYLE, WIDTH_IN

HEAD = ("node", "grade", "method", "sigma x", "y", "z", "smoothed x", "y", "z")
AS_ON_Z = (
    "As, z: accelerometers in level flight do not observe this angle, and in flight the filter "
    "is overconfident (gong-table2: its error is 3.4 of its own sigmas). Do not count on the z "
    "sigmas of As."
)


def required(design: Design) -> str:
    """Return the requirement as text."""
    values = ", ".join(f"{value:g}" for value in design.required_arcmin)
    return f"Required, one-sigma about x, y, z: {values} arcmin."


def rows(cells: Sequence[Cell]) -> list[list[str]]:
    """Return the rows of the table, arcmin, cells in the order of ``HEAD``."""
    return [
        [
            cell.node, cell.grade, cell.method,
            *(digits(float(value)) for value in cell.sigma),
            *(digits(float(value)) for value in cell.smoothed_sigma),
        ]
        for cell in cells
    ]  # fmt: skip


def answers(design: Design, cells: list[Cell]) -> list[list[str]]:
    """Return (node, grade, what it needs) rows."""
    return [
        [node.name, grade.name, cheapest_sensors(design, cells, node.name, grade.name)]
        for node in design.nodes
        for grade in design.grades
    ]


def design_figure(design: Design, cells: Sequence[Cell]) -> Figure:
    """Draw predicted sigma by node and method, one row of panels per grade, one column per axis.

    Parameters
    ----------
    design : Design
        The question; its requirement is the dashed line.
    cells : sequence of Cell
        The analysis.
    """
    names = [node.name for node in design.nodes]
    figure = Figure(figsize=(WIDTH_IN, 0.9 + 2.3 * len(design.grades)), layout="constrained")
    panels = figure.subplots(len(design.grades), 3, sharex=True, sharey="col", squeeze=False)
    width = 0.8 / len(METHODS)
    for row, grade in enumerate(design.grades):
        for axis, name in enumerate(AXES):
            axes = panels[row][axis]
            for place, method in enumerate(METHODS):
                mine = [c for c in cells if (c.grade, c.method) == (grade.name, method)]
                x = np.arange(len(mine)) + (place - 0.5 * (len(METHODS) - 1)) * width
                sigma = [cell.sigma[axis] for cell in mine]
                smoothed = [cell.smoothed_sigma[axis] for cell in mine]
                axes.vlines(x, smoothed, sigma, color=colour_of(method), lw=2, alpha=0.4)
                axes.plot(x, sigma, "o", color=colour_of(method), ms=6, label=method)
                axes.plot(x, smoothed, "o", color=colour_of(method), ms=5, mfc="white")
            limit = design.required_arcmin[axis]
            axes.axhline(limit, color="#1c2430", lw=1, ls="--")
            axes.axhspan(1e-9, limit, color="#1a7f37", alpha=0.06, lw=0)
            axes.set_yscale("log")
            axes.set_xlim(-0.6, len(names) - 0.4)
            axes.set_xticks(range(len(names)), names)
            if row == 0:
                axes.set_title(f"{name}, arcmin", loc="left")
        panels[row][0].set_ylabel(grade.name)
    for axis in range(3):
        values = [v[axis] for cell in cells for v in (cell.sigma, cell.smoothed_sigma)]
        panels[0][axis].set_ylim(0.5 * min(values), 2.0 * max(values))
    handles, labels = panels[0][0].get_legend_handles_labels()
    handles.append(panels[0][0].plot([], [], "o", color="#6b7785", ms=5, mfc="white")[0])
    handles.append(panels[0][0].plot([], [], "--", color="#1c2430", lw=1)[0])
    figure.legend(
        handles, [*labels, "smoothed", "required"],
        loc="outside upper right", ncols=6, frameon=False,
    )  # fmt: skip
    return figure


def write_design(design: Design, name: str, cells: list[Cell], folder: Path) -> Path:
    """Write ``design.parquet``, ``design.png`` and ``index.html``; return the page's path.

    Parameters
    ----------
    design, name : Design, str
        The question.
    cells : list of Cell
        The analysis.
    folder : Path
        Exists.
    """
    table: list[dict[str, object]] = [
        {
            "node": cell.node,
            "grade": cell.grade,
            "method": cell.method,
            "axis": axis,
            "sigma_arcmin": float(cell.sigma[i]),
            "smoothed_sigma_arcmin": float(cell.smoothed_sigma[i]),
        }
        for cell in cells
        for i, axis in enumerate(AXES)
    ]
    write_rows(table, folder / "design.parquet")
    page = Page(design.title, f"{name}: covariance analysis, no random draws")
    page.paragraph(design.about)
    page.heading("What each node needs")
    page.paragraph(
        f"{required(design)} The answer is the smallest set of sensors whose filter meets it on "
        "every axis."
    )
    page.table(("node", "grade", "needs"), answers(design, cells), numbers=3)
    page.heading("Predicted one-sigma of the angle between master and node, arcmin")
    with rc_context(STYLE):
        figure = design_figure(design, cells)
        figure.savefig(folder / "design.png", dpi=130)
        page.figure(
            figure, "Predicted error by node, method and grade",
            "Full: filter in flight. Open: smoothed afterwards. Shaded: meets the requirement. "
            "The arm flexes with the wing and the filters of As and GA model it.",
        )  # fmt: skip
        page.paragraph(AS_ON_Z, is_warning=True)
        page.table(HEAD, rows(cells), numbers=3)
    path = folder / "index.html"
    path.write_text(page.html(), encoding="utf-8")
    return path
