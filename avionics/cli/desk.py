"""Commands at the desk: import, replay, evaluate, export, report, info, recover.

What a command needs is imported when it runs, after its arguments and its configuration are
accepted.
"""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from avionics.cli.options import AsJson, Force, LogArgument, OutputFile, Overrides
from avionics.cli.output import progress_bar, read_log_path, warn_of_damage
from avionics.output_paths import claim_file

PANEL = "Work with logs and data sets"


def register(app: typer.Typer) -> None:
    """Add this module's commands to the command line."""
    for command in (info, evaluate, report, export, replay, recover):
        app.command(rich_help_panel=PANEL)(command)
    app.command("import", rich_help_panel=PANEL)(import_)


def import_(
    directory: Annotated[Path, typer.Argument(metavar="FOLDER", help="Data set with a wing.yaml.")],
    output: OutputFile,
    *,
    calibrate: Annotated[
        bool,
        typer.Option("--calibrate", help="Calibrate the camera from the set's own pictures."),
    ] = False,
    force: Force = False,
) -> None:
    """Turn a recorded data set into a log, optionally calibrating its camera.

    Example: avionics import wing-sweep/ -o sweep.mcap --calibrate
    """
    claim_file(output, force=force)

    from rich.console import Console  # noqa: PLC0415

    from avionics.datasets.importer import import_set  # noqa: PLC0415

    with progress_bar("importing", None) as progress:
        summary = import_set(directory, output, calibrate=calibrate, force=force, progress=progress)
    Console().print(summary.text())
    print(f"next: avionics replay {output} -o replayed.mcap")


def replay(
    log: LogArgument,
    output: OutputFile,
    config: Annotated[
        Path | None,
        typer.Option("--config", metavar="FILE", help="Configuration instead of the log's own."),
    ] = None,
    overrides: Overrides = None,
    tracker: Annotated[
        str | None,
        typer.Option("--tracker", metavar="NAME", help="Track the images again, by led, kcf ..."),
    ] = None,
    *,
    retrack: Annotated[
        bool, typer.Option("--retrack", help="Track the images although the log holds tracks.")
    ] = False,
    images: Annotated[
        bool, typer.Option("--images/--no-images", help="Copy the images into the new log.")
    ] = True,
    force: Force = False,
) -> None:
    """Run the pipeline again on a log; the same log gives bit-identical estimates.

    Example: avionics replay sweep.mcap --set estimator.form=paper -o paper.mcap
    """
    read_log_path(log)
    claim_file(output, force=force)
    given = None
    if config is not None:
        from avionics.config.load import load_config  # noqa: PLC0415

        given = load_config(config)

    from avionics.analysis.replay import replay as replay_log  # noqa: PLC0415

    with progress_bar("replaying", None) as progress:
        summary = replay_log(
            log,
            output,
            config=given,
            overrides=tuple(overrides or ()),
            tracker=tracker,
            retrack=retrack or tracker is not None,
            images=images,
            force=force,
            progress=progress,
        )
    warn_of_damage(log, summary.damage)
    print(f"wrote {output} ({output.stat().st_size / 1e6:.1f} MB)")
    print(f"next: avionics evaluate {output}; avionics report {output} -o report.html")


def evaluate(
    log: LogArgument,
    *,
    as_json: AsJson = False,
) -> None:
    """Compare the estimates with the truth or motion capture inside the log.

    Example: avionics evaluate replayed.mcap --json
    """
    from rich.console import Console  # noqa: PLC0415

    from avionics.analysis.evaluate import evaluate_wings, figures  # noqa: PLC0415
    from avionics.analysis.flight import read_flight  # noqa: PLC0415

    flight = read_flight(read_log_path(log))
    evaluations = evaluate_wings(flight)
    warn_of_damage(log, flight.damage)
    if as_json:
        print(json.dumps(figures(evaluations), indent=2))
        return
    for name, evaluation in evaluations.items():
        about = f"wing {name}\n" if len(evaluations) > 1 else ""
        Console().print(evaluation.table(about))


def export(
    log: LogArgument,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Folder for the tables.")
    ],
    table_format: Annotated[
        Literal["csv", "parquet"], typer.Option("--format", help="Format of the tables.")
    ] = "csv",
    *,
    force: Force = False,
) -> None:
    """Write one table per topic, units in the column names.

    Example: avionics export replayed.mcap -o tables --format parquet
    """
    from avionics.analysis.export import export as export_flight  # noqa: PLC0415
    from avionics.analysis.flight import read_flight  # noqa: PLC0415

    flight = read_flight(read_log_path(log))
    with progress_bar("exporting", None) as progress:
        tables = export_flight(flight, directory, table_format, force=force, progress=progress)
    warn_of_damage(log, flight.damage)
    for path, rows in tables.items():
        print(f"{path}: {rows} rows")


def report(log: LogArgument, output: OutputFile, *, force: Force = False) -> None:
    """Write one self-contained HTML page: what flew, errors, shapes, rates, losses.

    Example: avionics report replayed.mcap -o report.html
    """
    from avionics.analysis.flight import read_flight  # noqa: PLC0415
    from avionics.report.build import write_report  # noqa: PLC0415

    flight = read_flight(read_log_path(log))
    claim_file(output, force=force)
    with progress_bar("drawing", None) as progress:
        write_report(flight, output, force=force, progress=progress)
    print(f"wrote {output}")


def info(log: LogArgument) -> None:
    """Summarise a log: topics, counts, rates, losses, configuration.

    Example: avionics info flight.mcap
    """
    from avionics.analysis.flight import read_flight  # noqa: PLC0415
    from avionics.analysis.info import info_text  # noqa: PLC0415

    print(info_text(read_flight(read_log_path(log))))


def recover(
    broken: Annotated[Path, typer.Argument(metavar="BROKEN.mcap", help="Log that was cut off.")],
    output: OutputFile,
    *,
    force: Force = False,
) -> None:
    """Repair a log that was cut off: every whole record is kept, every MCAP reader reads it.

    Example: avionics recover broken.mcap -o fixed.mcap
    """
    from avionics.recording import recover as recover_log  # noqa: PLC0415

    read_log_path(broken)
    claim_file(output, force=force)
    print(recover_log(broken, output, force=force).text())
