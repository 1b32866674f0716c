"""What turns each difference from a paper on and off: one thing changed, same seeds."""

from collections.abc import Iterator

import numpy as np

from avionics.pos.study.results import (
    ARCMIN,
    digits,
    published_for,
    quantities_of,
    segments_of,
)
from avionics.pos.study.runs import Line, Study
from avionics.report.page import Page


def explain(page: Page, study: Study) -> None:
    """Add one table: each change's effect on each method, same seeds on both sides."""
    spec = study.spec
    abouts = {change.name: change.about for change in spec.profiles[study.profile].changes}
    any_line = next(iter(study.changes.values()))[0]
    page.heading(f"What turns the differences on and off ({study.profile})")
    page.paragraph(
        f"One thing changed at a time, {len(any_line.seeds)} runs each, scenario "
        f"'{any_line.scenario}'. Factor: figure with the change over figure without, same seeds."
    )
    rows: list[list[str]] = []
    for name, lines in study.changes.items():
        for line in lines:
            before = study.line(line.scenario, line.method)
            if before is None:
                continue
            for quantity in quantities_of(spec):
                rows += _change_rows(study, name, line, before, quantity)
    page.table(
        ("change", "method", "figure", "x", "y", "z", "factor x", "y", "z", "paper x", "y", "z"),
        rows, numbers=3,
    )  # fmt: skip
    for name, about in abouts.items():
        page.paragraph(f"{name}: {about}")


def _change_rows(
    study: Study, name: str, line: Line, before: Line, quantity: int
) -> Iterator[list[str]]:
    count = len(line.seeds)
    segment = segments_of(study.spec)[0][0]
    paper = published_for(study.spec, line, segment, quantity)
    for what in ("std", "rmse"):
        now = line.by_run(what, quantity).mean(axis=0) * ARCMIN
        then = before.by_run(what, quantity)[:count].mean(axis=0) * ARCMIN
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = now / then
        printed = (
            [np.nan] * 3
            if paper is None
            else [v if v >= 0 else np.nan for v in getattr(paper, what)]
        )
        yield [
            name, line.method, what.upper(),
            *(digits(float(v)) for v in now),
            *(f"{v:.2f}" if np.isfinite(v) else "-" for v in factor),
            *(digits(float(v)) for v in printed),
        ]  # fmt: skip
