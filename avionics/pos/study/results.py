"""The paper's table beside ours, and the same figures as Parquet."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from avionics.desk import desk_imports
from avionics.pos.compiled import Array
from avionics.pos.metrics import QUANTITIES
from avionics.pos.study.runs import Line, Study
from avionics.pos.study.spec import PublishedTable, Spec

ARCMIN = float(np.rad2deg(60.0))
AXES = ("x", "y", "z")
QUANTITY_NAMES = ("system error angle", "rigid misalignment", "flexure angle")
HEAD = (
    "scenario", "method", "segment", "of", "figure", "paper x", "y", "z",
    "ours x", "y", "z", "spread x", "y", "z",
)  # fmt: skip


def digits(value: float) -> str:
    """Return an angle in arcmin as text, four significant figures; a dash where there is none."""
    if not np.isfinite(value):
        return "-"
    if value >= 1e5:
        return f"{value:.2g}"
    places = 4 if value < 1.0 else 3 if value < 10.0 else 2 if value < 100.0 else 1
    return f"{value:.{places}f}"


def segments_of(spec: Spec) -> list[tuple[str, int]]:
    """Return (name, index) of the segments a table shows; -1 is the mean over all."""
    names = {published.segment for published in spec.published}
    if "mean" in names or not spec.published:
        return [("mean", -1)]
    return [(table.name, i) for i, table in enumerate(spec.segments)]


def quantities_of(spec: Spec) -> list[int]:
    """Return the indices of the quantities that the paper's table shows."""
    shown = {published.quantity for published in spec.published} or {"system"}
    return [i for i, name in enumerate(QUANTITIES) if name in shown]


def published_for(spec: Spec, line: Line, segment: str, quantity: int) -> PublishedTable | None:
    """Return the paper's figures for a line, or None."""
    for published in spec.published:
        if (published.scenario, published.method, published.segment) == (
            line.scenario,
            line.method,
            segment,
        ) and published.quantity == QUANTITIES[quantity]:
            return published
    return None


def figure_of(line: Line, what: str, segment: int, quantity: int) -> Array:
    """Return a figure of merit in arcmin, shape (3,); NaN on an axis that is not estimated."""
    estimated = line.mean("sigma", quantity) > 0.0
    values = line.mean(what, quantity) if segment < 0 else line.segment(what, segment, quantity)
    return np.where(estimated, values * ARCMIN, np.nan)


def table_rows(spec: Spec, lines: tuple[Line, ...]) -> Iterator[list[str]]:
    """Yield the rows of the comparison, cells as text in the order of ``HEAD``."""
    for line in lines:
        for quantity in quantities_of(spec):
            for name, segment in segments_of(spec):
                published = published_for(spec, line, name, quantity)
                for what in ("std", "rmse"):
                    paper = [-1.0] * 3 if published is None else list(getattr(published, what))
                    ours = figure_of(line, what, segment, quantity)
                    spread = np.where(
                        np.isfinite(ours), line.spread(what, quantity, segment) * ARCMIN, np.nan
                    )
                    yield [
                        line.scenario, line.method, name, QUANTITIES[quantity], what.upper(),
                        *(digits(value if value >= 0.0 else np.nan) for value in paper),
                        *(digits(float(value)) for value in ours),
                        *(digits(float(value)) for value in spread),
                    ]  # fmt: skip


def write_parquet(study: Study, path: Path) -> int:
    """Write every figure of every run, arcmin; return the number of rows; see ``write_rows``."""
    rows: list[dict[str, object]] = []
    for change, lines in [("", study.lines), *study.changes.items()]:
        for line in lines:
            rows += _rows_of(study, change, line)
    write_rows(rows, path)
    return len(rows)


def write_rows(rows: list[dict[str, object]], path: Path) -> None:
    """Write rows of named values as one Parquet file.

    Raises
    ------
    AvionicsError
        If pyarrow is not installed.
    """
    with desk_imports("Parquet"):
        import pyarrow as pa  # noqa: PLC0415
        import pyarrow.parquet as pq  # noqa: PLC0415
    pq.write_table(pa.Table.from_pylist(rows), path)


def _rows_of(study: Study, change: str, line: Line) -> Iterator[dict[str, object]]:
    for seed, run in zip(line.seeds, line.runs, strict=True):
        for q, quantity in enumerate(QUANTITIES):
            for s, segment in enumerate(study.spec.segments):
                for axis, name in enumerate(AXES):
                    yield {
                        "study": study.name,
                        "profile": study.profile,
                        "change": change,
                        "scenario": line.scenario,
                        "method": line.method,
                        "seed": seed,
                        "quantity": quantity,
                        "segment": segment.name,
                        "axis": name,
                        "std_arcmin": float(run.std[q, s, axis]) * ARCMIN,
                        "rmse_arcmin": float(run.rmse[q, s, axis]) * ARCMIN,
                        "predicted_sigma_arcmin": float(run.sigma[q, s, axis]) * ARCMIN,
                        "nees": run.nees,
                    }
