"""`avionics pos`: studies of distributed position and orientation on a flexing wing."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from avionics.cli.options import Force, OutputFolder
from avionics.cli.output import progress_bar
from avionics.desk import desk_imports
from avionics.errors import AvionicsError
from avionics.output_paths import claim_folder

if TYPE_CHECKING:
    from rich.console import Console

    from avionics.pos.study.runs import Study

app = typer.Typer(
    help="Distributed POS: transfer-alignment studies (Gong et al., Guo and Zhu).\n\n"
    "Example: avionics pos run gong-table2 -o gong",
    no_args_is_help=True,
)


@app.command()
def run(
    study: Annotated[
        str,
        typer.Argument(
            metavar="NAME|SPEC.toml", help="gong-table2, gong-table4, guo-table1, or a file."
        ),
    ],
    output: OutputFolder,
    profile: Annotated[
        str, typer.Option("--profile", help="Reading of the paper, or 'all'.")
    ] = "all",
    seeds: Annotated[
        str | None, typer.Option("--seeds", metavar="A:B", help="First and last seed.")
    ] = None,
    scenario: Annotated[
        str, typer.Option("--scenario", help="One of the study's scenarios, or 'all'.")
    ] = "all",
    *,
    explain: Annotated[
        bool, typer.Option(help="Also run every change that explains a difference.")
    ] = True,
    bound: Annotated[
        bool, typer.Option("--bound", help="Also compute the Riccati bounds (a minute more).")
    ] = False,
    force: Force = False,
) -> None:
    """Run a study: the paper's table beside ours, Parquet, figures and one HTML page.

    Example: avionics pos run gong-table2 --profile consistent --seeds 1:10 -o gong
    """
    with desk_imports("a study"):
        from avionics.pos.study.report import write_report  # noqa: PLC0415
        from avionics.pos.study.results import write_parquet  # noqa: PLC0415
        from avionics.pos.study.runs import run_study  # noqa: PLC0415
        from avionics.pos.study.spec import load_spec  # noqa: PLC0415

    spec = load_spec(study)
    profiles = _choice(profile, tuple(spec.profiles), "profile")
    scenarios = _choice(scenario, spec.scenarios, "scenario")
    runs = _seeds(seeds, spec.seeds)
    folder = claim_folder(output, force=force)
    studies = []
    for name in profiles:
        with progress_bar(f"{study} {name}", 1.0) as progress:
            made = run_study(
                study, spec, name, seeds=runs, scenarios=scenarios,
                change_seeds=runs[:CHANGE_SEEDS] if explain else (),
                with_bounds=bound, progress=progress,
            )  # fmt: skip
        studies.append(made)
        _print_study(made)
        write_parquet(made, folder / f"{name}.parquet")
    print(f"report: {write_report(studies, folder)}")


@app.command()
def drive(
    recording: Annotated[Path, typer.Argument(metavar="CSV", help="Recorded car drive.")],
    output: OutputFolder,
    seeds: Annotated[
        str, typer.Option("--seeds", metavar="A:B", help="First and last seed.")
    ] = "1:10",
    force: Force = False,
) -> None:
    """Run all methods on a recorded drive, with simulated flexure and misalignment.

    Example: avionics pos drive DRIVE.csv -o drive
    """
    with desk_imports("a study"):
        from avionics.pos.study.drive import LIMITS, drive_spec, read_drive  # noqa: PLC0415
        from avionics.pos.study.report import write_report  # noqa: PLC0415
        from avionics.pos.study.results import write_parquet  # noqa: PLC0415
        from avionics.pos.study.runs import run_study  # noqa: PLC0415

    runs = _seeds(seeds, (1, 10))
    carrier = read_drive(recording)
    spec = drive_spec(float(carrier.trajectory.t[-1]))
    folder = claim_folder(output, force=force)
    studies = []
    for name in spec.profiles:
        with progress_bar(f"drive {name}", 1.0) as progress:
            made = run_study(
                recording.name, spec, name, seeds=runs, scenarios=spec.scenarios,
                carrier=carrier.trajectory, progress=progress,
            )  # fmt: skip
        studies.append(made)
        _print_study(made)
        write_parquet(made, folder / f"{name}.parquet")
    notes = [
        *LIMITS,
        f"The motion made of it keeps within {carrier.track_error_m:.1f} m (rms) of the "
        "receiver's positions.",
    ]
    print(f"report: {write_report(studies, folder, notes)}")


@app.command()
def design(
    question: Annotated[
        str, typer.Argument(metavar="NAME|DESIGN.toml", help="wing-nodes, or a file.")
    ],
    output: OutputFolder,
    force: Force = False,
) -> None:
    """Find which nodes need an IMU and which can do with gyros, by covariance analysis.

    Example: avionics pos design wing-nodes -o nodes
    """
    from rich.table import Table  # noqa: PLC0415 (start-up)

    with desk_imports("a design"):
        from avionics.pos.study.design import analyse, load_design  # noqa: PLC0415
        from avionics.pos.study.design_page import (  # noqa: PLC0415
            AS_ON_Z,
            answers,
            required,
            rows,
            write_design,
        )

    wanted = load_design(question)
    folder = claim_folder(output, force=force)
    with progress_bar(question, 1.0) as progress:
        cells = analyse(wanted, progress)
    console = _console()
    table = Table(
        "node", "grade", "method", "sigma x, y, z", "smoothed x, y, z",
        title=f"{question}: predicted one-sigma, arcmin",
    )  # fmt: skip
    for row in rows(cells):
        table.add_row(*row[:3], "  ".join(row[3:6]), "  ".join(row[6:]))
    console.print(table)
    console.print(f"[yellow]warning[/yellow] {AS_ON_Z}")
    console.print(required(wanted))
    needs = Table("node", "grade", "needs", title="Cheapest that meets the requirement")
    for row in answers(wanted, cells):
        needs.add_row(*row)
    console.print(needs)
    print(f"report: {write_design(wanted, question, cells, folder)}")


CHANGE_SEEDS = 3
"""Runs of each change: enough to see what it turns on and off."""
WIDE = 150
"""A pipe says it has 80 columns; tables may be wider there."""


def _console() -> "Console":
    from rich.console import Console  # noqa: PLC0415 (start-up)

    console = Console()
    return console if console.is_terminal else Console(width=max(console.width, WIDE))


def _print_study(study: "Study") -> None:
    from rich.table import Table  # noqa: PLC0415 (start-up)

    from avionics.pos.study.results import table_rows  # noqa: PLC0415 (desk)
    from avionics.pos.study.warnings import warnings  # noqa: PLC0415 (desk)

    console, runs = _console(), len(study.seeds)
    head = ("scenario", "method", "segment", "of", "figure")
    table = Table(
        *head, "paper x, y, z", "ours x, y, z", "spread x, y, z",
        title=f"{study.name}, {study.profile}: arcmin, mean of {runs} runs, spread over the runs",
    )  # fmt: skip
    for row in table_rows(study.spec, study.lines):
        table.add_row(*row[:5], *("  ".join(row[i : i + 3]) for i in (5, 8, 11)))
    console.print(table)
    for text in warnings(study):
        console.print(f"[yellow]warning[/yellow] {study.profile}: {text}")
    unexplained = study.spec.profiles[study.profile].unexplained
    if unexplained:
        console.print(f"{study.profile}, unexplained: {unexplained}")


def _choice(wanted: str, known: tuple[str, ...], what: str) -> tuple[str, ...]:
    if wanted == "all":
        return known
    if wanted not in known:
        msg = f"{what} '{wanted}' is not in the study; it has {', '.join(known)}, or say all"
        raise AvionicsError(msg)
    return (wanted,)


def _seeds(text: str | None, default: tuple[int, int]) -> range:
    first, last = default
    if text is not None:
        parts = text.split(":")
        if len(parts) != 2 or not all(part.isdigit() for part in parts):
            msg = f"--seeds {text}: wants FIRST:LAST, for example 1:10"
            raise AvionicsError(msg)
        first, last = int(parts[0]), int(parts[1])
        if last < first:
            msg = f"--seeds {text}: the last seed lies before the first"
            raise AvionicsError(msg)
    return range(first, last + 1)
