"""Commands of the kernel rig: run a command in a guest kernel, say which tiers are here."""

import shutil
import sys
import tempfile
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from avionics.cli import bench
from avionics.errors import AvionicsError

app = typer.Typer(
    help="A simulated wing on real buses, and kernels with CAN, I2C and ttys to test in.\n\n"
    "Example: avionics rig serve default --can vcan0 --write-config fly.toml",
    no_args_is_help=True,
)
bench.register(app)


class GuestKernel(str, Enum):
    """What a command can be run in."""

    UML = "uml"
    VM = "vm"


@app.command(
    options_metavar="[OPTIONS] -- COMMAND",
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
)
def run(
    context: typer.Context,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Folder shared with the guest (RIG_OUT); default: a temporary one, removed if "
            "the command succeeds.",
        ),
    ] = None,
    kernel: Annotated[
        GuestKernel,
        typer.Option("--kernel", help="User Mode Linux, or a virtual machine with V4L2."),
    ] = GuestKernel.UML,
    limit: Annotated[
        float,
        typer.Option("--limit", min=1.0, metavar="S", help="Longest time the command may take."),
    ] = 600.0,
    memory: Annotated[
        int, typer.Option("--memory", min=64, metavar="MIB", help="Memory of the guest.")
    ] = 768,
) -> None:
    """Run a command in a guest kernel that sees this machine's files, read-only.

    Example: avionics rig run -- pytest tests/drivers/can
    """
    from sim_bus.guests.guest import STATUS_DIED  # noqa: PLC0415
    from sim_bus.guests.kinds import RUNNERS  # noqa: PLC0415

    if not context.args:
        msg = "give a command after --, for example: avionics rig run -- ip link"
        raise AvionicsError(msg)
    folder = out or Path(tempfile.mkdtemp(prefix="rig-"))
    if any(letter.isspace() for letter in str(folder.resolve())):
        msg = (
            f"--out '{folder.resolve()}': has a space in it, which cannot pass the guest's kernel; "
            "give a path without"
        )
        raise AvionicsError(msg)
    if out is None:
        print(f"avionics: RIG_OUT is {folder}; --out FOLDER keeps it", file=sys.stderr)
    runner = RUNNERS[kernel.value]
    result = runner(context.args, folder, limit_s=limit, memory_mib=memory, echo=True)
    if result.missing or result.status == STATUS_DIED:
        print(f"avionics: {result.failure()}", file=sys.stderr)
    if out is None and result.status == 0:
        shutil.rmtree(folder, ignore_errors=True)
    raise typer.Exit(result.status)


@app.command("fetch-kernel")
def fetch() -> None:
    """Fetch and unpack the kernel of `rig run --kernel vm` (Debian's; 70 MB, unpacked 400 MB).

    Example: avionics rig fetch-kernel
    """
    from sim_bus.guests.vm_kernel import KernelError, fetch_kernel  # noqa: PLC0415

    try:
        kernel = fetch_kernel()
    except KernelError as error:
        raise AvionicsError(str(error)) from error
    print(f"{kernel.version} in {kernel.root}")


@app.command()
def doctor() -> None:
    """Check which tests this machine can run, and what installs each missing piece.

    Example: avionics rig doctor
    """
    from rich.console import Console  # noqa: PLC0415 (start-up)
    from rich.markup import escape  # noqa: PLC0415 (start-up)
    from rich.table import Table  # noqa: PLC0415 (start-up)

    from sim_bus.guests.tiers import TIERS, extras  # noqa: PLC0415

    table = Table(box=None, pad_edge=False)
    for heading in ("tier", "", "what", "remedy"):
        table.add_column(heading, overflow="fold")
    is_complete = True
    for tier in TIERS:
        absent = tier.absent()
        mark = "[yellow]missing[/]" if absent else "[green]here[/]"
        table.add_row(tier.name, mark, escape(tier.content), "")
        for piece in absent:
            table.add_row("", "", f"- {escape(piece.name)}", escape(piece.remedy))
        is_complete &= not absent
    for piece in extras():
        mark = "[green]here[/]" if piece.is_here() else "absent"
        remedy = "" if piece.is_here() else piece.remedy
        table.add_row("(bench)", mark, escape(piece.name), escape(remedy))
    Console().print(table)
    if not is_complete:
        raise typer.Exit(1)
