"""Commands of a running hardware-in-the-loop bench: start it, break it, join its truth."""

import json
import time
from pathlib import Path
from typing import Annotated, Literal

import typer

from avionics.cli import faults
from avionics.cli.faults import ask_bench
from avionics.cli.options import AsJson, Control, Force, LogArgument, OutputFile
from avionics.cli.output import read_log_path
from avionics.cli.serve import serve
from avionics.errors import AvionicsError
from avionics.output_paths import claim_file


def register(app: typer.Typer) -> None:
    """Add this module's commands to the command group ``rig``."""
    for command in (serve, start, status, stop, join):
        app.command()(command)
    app.add_typer(faults.app, name="fault")


def start(
    lead: Annotated[
        float, typer.Option(min=1.5, metavar="S", help="Rest before the scenario begins.")
    ] = 2.0,
    control: Control = None,
) -> None:
    """Start the scenario of a bench that was served with --hold.

    Example: avionics rig start
    """
    answer = ask_bench(control, {"do": "start", "lead_s": lead})
    elapsed_s = answer["elapsed_s"]
    when = f"began {elapsed_s:.1f} s ago" if elapsed_s >= 0 else f"begins in {-elapsed_s:.1f} s"
    already = "the bench was started already; " if answer["was_started"] else ""
    print(f"{already}the scenario {when}")


def status(control: Control = None) -> None:
    """Print what a running bench counts and which faults are on, as JSON.

    Example: avionics rig status
    """
    print(json.dumps(ask_bench(control, {"do": "status"}), indent=2))


def stop(
    control: Control = None,
    *,
    wait_s: Annotated[
        float,
        typer.Option(min=0, metavar="S", help="Longest wait for the truth to be on disk."),
    ] = 10.0,
) -> None:
    """Stop a running bench and wait until its truth is on disk.

    Example: avionics rig stop
    """
    from sim_bus.bench.client import default_socket  # noqa: PLC0415

    ask_bench(control, {"do": "stop"})
    path, give_up = control or default_socket(), time.monotonic() + wait_s
    while path.exists() and time.monotonic() < give_up:
        time.sleep(0.05)
    if path.exists():
        msg = (
            f"{path}: the bench was asked to stop, but did not in {wait_s:g} s; its truth is not "
            "whole yet. Wait longer with --wait-s"
        )
        raise AvionicsError(msg)
    print("the bench has ended; its truth is on disk")


def join(
    log: LogArgument,
    truth: Annotated[
        Path, typer.Argument(metavar="TRUTH.mcap", help="Truth of `avionics rig serve`.")
    ],
    output: OutputFile,
    clock: Annotated[
        Literal["auto", "shared", "rates"],
        typer.Option(help="Clocks: one machine's (shared), or aligned by the gyro rates."),
    ] = "auto",
    *,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Merge the served truth into a flight's log, clocks aligned, for `avionics evaluate`.

    Example: avionics rig join flight.mcap truth.mcap -o joined.mcap
    """
    from avionics.analysis.join import join as join_logs  # noqa: PLC0415

    claim_file(output, force=force)
    report = join_logs(
        read_log_path(log), read_log_path(truth), output, alignment=clock, force=force
    )
    print(json.dumps(report.to_json_dict()) if as_json else report.text())
    if not as_json:
        print(f"next: avionics evaluate {output}")
