"""Commands that fly: `run` on hardware, `sim` on the simulated wing, `doctor` before either.

What a command needs is imported when it runs, and only after the configuration and the output are
accepted: a mistake is answered at once.
"""

from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated

import typer

from avionics.cli.options import ConfigArgument, ConfigOrPackaged, Force, Overrides, Seed
from avionics.cli.output import progress_bar
from avionics.cli.signals import stopping
from avionics.output_paths import claim_file
from drivers.clock import SteadyClock, boot_id, utc_offset_ns

PANEL = "Fly"


def register(app: typer.Typer) -> None:
    """Add this module's commands to the command line."""
    for command in (doctor, run, sim):
        app.command(rich_help_panel=PANEL)(command)


def run(
    config_path: ConfigArgument,
    duration: Annotated[
        float | None,
        typer.Option(min=0.1, metavar="S", help="Stop after S seconds; default: at Ctrl-C."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="Log to write; default: flight-<time>.mcap."
        ),
    ] = None,
    overrides: Overrides = None,
    *,
    force: Force = False,
) -> None:
    """Fly on hardware: read the sensors, track, estimate and record until Ctrl-C.

    Example: avionics run wing.toml --duration 60 -o flight.mcap
    """
    from avionics.config.load import load_config  # noqa: PLC0415 (start-up)

    config = load_config(config_path, tuple(overrides or ()))
    stamp = datetime.now(tz=timezone.utc).strftime("%Y%m%d-%H%M%SZ")
    path = claim_file(output or Path(f"flight-{stamp}.mcap"), force=force)

    from avionics.flight.hardware import open_rig  # noqa: PLC0415 (after what may be refused)
    from avionics.flight.runner import run_live  # noqa: PLC0415
    from avionics.recording import Recorder  # noqa: PLC0415

    clock = SteadyClock()
    with open_rig(config, clock) as rig:
        names = [one.wing.name for one in config.wing_configs]
        wings = f"{' and '.join(names)} {'wing' if len(names) == 1 else 'wings'}"
        print(f"flying {wings}: {path} (Ctrl-C ends the flight)", flush=True)
        with (
            Recorder(
                path,
                config,
                utc_offset_ns=utc_offset_ns(),
                clock=clock,
                metadata={"command": "run", "boot_id": boot_id()},
                force=force,
            ) as recorder,
            stopping() as stop,
            progress_bar("flying", duration) as progress,
        ):
            run_live(rig, config, recorder, stop=stop, duration_s=duration, progress=progress)
    _print_flight(path, f"avionics info {path}")


def sim(
    config_path: ConfigOrPackaged = None,
    *,
    scenario: Annotated[
        str,
        typer.Option(metavar="NAME|FILE", help="Packaged scenario, e.g. gust, or a TOML file."),
    ] = "default",
    duration: Annotated[
        float | None,
        typer.Option(min=0.1, metavar="S", help="Length of the flight; default: the scenario's."),
    ] = None,
    seed: Seed = 0,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Log to write; default: sim-<scenario>-<seed>.mcap.",
        ),
    ] = None,
    overrides: Overrides = None,
    realtime: Annotated[
        bool,
        typer.Option("--realtime", help="Fly at the pace of the wall clock, with threads."),
    ] = False,
    force: Force = False,
) -> None:
    """Fly the simulated wing through the real drivers; the same seed gives the same log.

    Example: avionics sim --scenario oblique --duration 30 --seed 1 -o sim.mcap
    """
    from avionics.cli.configuration import given_or_packaged  # noqa: PLC0415 (start-up)

    config = given_or_packaged(config_path, tuple(overrides or ()))
    path = claim_file(output or Path(f"sim-{Path(scenario).stem}-{seed}.mcap"), force=force)

    from sim_bus.wing.scenario import load_scenario  # noqa: PLC0415 (after what may be refused)

    flown = load_scenario(scenario)
    length_s = duration if duration is not None else flown.duration_s

    from avionics.analysis.comparison import SETTLE_S  # noqa: PLC0415
    from avionics.flight.runner import run_live, run_lockstep  # noqa: PLC0415
    from avionics.recording import LogWriter, Recorder  # noqa: PLC0415
    from sim_bus.rig import open_sim_rig  # noqa: PLC0415

    metadata = {"command": "sim", "scenario": flown.name, "seed": str(seed)}
    with open_sim_rig(config, flown, seed=seed, realtime=realtime) as rig:
        if realtime:
            with (
                Recorder(
                    path,
                    config,
                    utc_offset_ns=utc_offset_ns(),
                    clock=rig.clock,
                    metadata=metadata,
                    force=force,
                ) as recorder,
                stopping() as stop,
                progress_bar("flying", length_s) as progress,
            ):
                run_live(rig, config, recorder, stop=stop, duration_s=length_s, progress=progress)
        else:
            with (
                LogWriter(path, config, utc_offset_ns=0, metadata=metadata, force=force) as writer,
                progress_bar("flying", length_s) as progress,
            ):
                run_lockstep(rig, config, writer, duration_s=length_s, progress=progress)
    is_scored = length_s > SETTLE_S
    _print_flight(path, f"avionics {'evaluate' if is_scored else 'info'} {path}")


def _print_flight(path: Path, following: str) -> None:
    print(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")
    print(f"next: {following}; avionics report {path} -o report.html")


def doctor(config_path: ConfigArgument) -> None:
    """Check which devices of a configuration answer, and how to mend what is missing.

    Example: avionics doctor wing.toml
    """
    from avionics.config.load import load_config  # noqa: PLC0415 (start-up)

    config = load_config(config_path)

    from rich.console import Console  # noqa: PLC0415 (after what may be refused)
    from rich.markup import escape  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    from avionics.flight.doctor import probe  # noqa: PLC0415

    findings = probe(config)
    table = Table.grid(padding=(0, 2))
    for finding in findings:
        mark = "[green]ok[/]" if finding.ok else "[red]missing[/]"
        table.add_row(mark, escape(f"{finding.what}: {finding.found}"))
        if finding.remedy:
            table.add_row("", escape(f"-> {finding.remedy}"))
    Console().print(table)
    if not all(finding.ok for finding in findings):
        raise typer.Exit(1)
