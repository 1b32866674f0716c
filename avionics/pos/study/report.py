"""One page about a distributed-POS study: tables beside the paper's, figures, explanations."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from avionics.pos.compiled import Array
from avionics.pos.metrics import QUANTITIES
from avionics.pos.study.explain import explain
from avionics.pos.study.figures import (
    error_figure,
    flexure_figure,
    score_figure,
    track_figure,
)
from avionics.pos.study.results import (
    ARCMIN,
    HEAD,
    QUANTITY_NAMES,
    digits,
    figure_of,
    quantities_of,
    table_rows,
)
from avionics.pos.study.runs import Line, Study
from avionics.pos.study.warnings import warnings
from avionics.report.page import Page
from avionics.report.plots import STYLE


def write_report(studies: Sequence[Study], folder: Path, notes: Sequence[str] = ()) -> Path:
    """Write ``index.html`` and the figures as PNG files; return the page's path.

    Parameters
    ----------
    studies : sequence of Study
        The profiles of one specification.
    folder : Path
        Exists.
    notes : sequence of str
        Printed before the figures.
    """
    with rc_context(STYLE):
        page = _page(studies, folder, notes)
    path = folder / "index.html"
    path.write_text(page.html(), encoding="utf-8")
    return path


def _page(studies: Sequence[Study], folder: Path, notes: Sequence[str]) -> Page:
    spec = studies[0].spec
    page = Page(spec.title, f"{studies[0].name}: {spec.source}")
    pictures = _Pictures(page, folder / "figures")
    page.paragraph(spec.about)
    seeds = studies[0].seeds
    page.paragraph(
        f"Seeds {seeds[0]} to {seeds[-1]}, {len(seeds)} runs. All angles in arcmin. STD and RMSE "
        "of the estimate's error are taken in each segment, then the mean over the segments and "
        "the runs; the spread is the standard deviation over the runs. A mean of ten runs "
        "scatters by 10 to 20 %."
    )
    for note in notes:
        page.paragraph(note)
    page.heading("Trajectory and flexure")
    first = studies[0]
    segments = spec.segment_list()
    pictures.add(
        "track", track_figure(first.trajectories, segments), "Trajectory",
        "Plane track with the segments where errors are counted; speed, heading and roll.",
    )  # fmt: skip
    trajectory = next(iter(first.trajectories.values()))
    if first.truth is not None:
        for rate, name in ((False, "Flexure angle"), (True, "Flexure rate")):
            pictures.add(
                name.lower().replace(" ", "-"), flexure_figure(trajectory, first.truth, rate=rate),
                name, f"True {name.lower()} of the run with seed {seeds[0]}.",
            )  # fmt: skip
    for study in studies:
        _profile(page, pictures, study)
    return page


class _Pictures:
    """Puts each figure into the page and beside it as a file."""

    def __init__(self, page: Page, folder: Path) -> None:
        self._page = page
        self._folder = folder
        folder.mkdir(exist_ok=True)

    def add(self, name: str, figure: Figure, title: str, caption: str) -> None:
        """Add one figure."""
        figure.savefig(self._folder / f"{name}.png", dpi=130)
        figure.set_layout_engine("none")  # laid out; the page draws it again as it is
        self._page.figure(figure, title, caption)


def _profile(page: Page, pictures: _Pictures, study: Study) -> None:
    spec, segments = study.spec, study.spec.segment_list()
    table = spec.profiles[study.profile]
    page.heading(f"Profile {study.profile}")
    page.paragraph(table.about)
    page.table(HEAD, list(table_rows(spec, study.lines)), numbers=5)
    for text in warnings(study):
        page.paragraph(text, is_warning=True)
    _more(page, study)
    for scenario in study.trajectories:
        lines = [line for line in study.lines if line.scenario == scenario]
        published = [p for p in spec.published if p.scenario == scenario and p.segment == "mean"]
        for quantity in quantities_of(spec):
            shown = [p for p in published if p.quantity == QUANTITIES[quantity]]
            pictures.add(
                f"{study.profile}-scores-{QUANTITIES[quantity]}-{scenario.replace(' ', '-')}",
                score_figure(lines, shown, quantity),
                f"RMSE and STD of the {QUANTITY_NAMES[quantity]}, {scenario}",
                "Every run, their mean, the filter's own prediction of its error, the paper.",
            )
    plain = [
        line
        for line in study.lines
        if line.scenario == next(iter(study.trajectories)) and "smoothed" not in line.method
    ]
    for quantity in (2, 1, 0):
        pictures.add(
            f"{study.profile}-error-{QUANTITIES[quantity]}",
            error_figure(plain, segments, quantity),
            f"Error of the {QUANTITY_NAMES[quantity]}",
            f"Estimate minus truth, seed {study.seeds[0]}. Right, where there are two columns: "
            "the scale of the second best method.",
        )
    compared = _compared(study)
    if compared:
        pictures.add(
            f"{study.profile}-error-compared", error_figure(compared, segments, 0, with_sigma=True),
            "Error of the system error angle, IMU and Gs",
            "Bands: two predicted sigmas. Gs with the speed variation too, where it was run.",
        )  # fmt: skip
    if study.changes:
        explain(page, study)
    if table.unexplained:
        page.paragraph(f"Unexplained: {table.unexplained}")


def _compared(study: Study) -> list[Line]:
    """IMU and Gs without variation and Gs with it (the paper's Fig. 8 and 14)."""
    scenarios = list(study.trajectories)
    found = [study.line(scenarios[0], "IMU"), study.line(scenarios[0], "Gs")]
    if len(scenarios) > 1:
        varied = study.line(scenarios[1], "Gs")
        found.append(varied and replace(varied, method=f"Gs, {scenarios[1]}"))
    return [line for line in found if line is not None]


def _more(page: Page, study: Study) -> None:
    """Every segment, all segments pooled, and the error against the filter's own sigma."""
    spec = study.spec
    rows: list[list[str]] = []
    for line in study.lines:
        for quantity in quantities_of(spec):
            head = [line.scenario, line.method, QUANTITIES[quantity]]
            for segment, table in enumerate(spec.segments):
                values = figure_of(line, "rmse", segment, quantity)
                rows.append([*head, table.name, *_digits(values)])
            rows.append([*head, "pooled", *_digits(line.pooled("rmse", quantity) * ARCMIN)])
    page.table(("scenario", "method", "of", "segment", "RMSE x", "y", "z"), rows, numbers=4)
    page.table(
        ("scenario", "method", "of", "own sigma x", "y", "z", "error / sigma x", "y", "z", "NEES"),
        [
            [
                line.scenario, line.method, QUANTITIES[quantity],
                *_digits(figure_of(line, "sigma", -1, quantity)),
                *_ratios(line.consistency(quantity)),
                *_ratios(np.array([np.mean([run.nees for run in line.runs])])),
            ]
            for line in study.lines
            for quantity in quantities_of(spec)
        ],
        numbers=3,
    )  # fmt: skip
    if study.bounds:
        page.paragraph(
            "Riccati bound along the true path of the first run, computed apart from the filters; "
            "own sigma and RMSE over it."
        )
        page.table(
            (
                "method",
                "bound x",
                "y",
                "z",
                "sigma / bound x",
                "y",
                "z",
                "RMSE / bound x",
                "y",
                "z",
            ),
            [_bound_row(study, method, bound) for method, bound in study.bounds.items()],
            numbers=1,
        )


def _bound_row(study: Study, method: str, bound: Array) -> list[str]:
    line = study.line(next(iter(study.trajectories)), method)
    assert line is not None
    return [
        method,
        *_digits(bound * ARCMIN),
        *_ratios(line.mean("sigma") / bound),
        *_ratios(line.mean("rmse") / bound),
    ]


def _digits(values: Array) -> list[str]:
    return [digits(float(value)) for value in values]


def _ratios(values: Array) -> list[str]:
    return [f"{value:.2f}" if np.isfinite(value) else "-" for value in values]
