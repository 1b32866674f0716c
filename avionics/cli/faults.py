"""Commands that switch the faults of a running bench."""

from pathlib import Path
from typing import Annotated, Any

import typer

from avionics.cli.options import Control
from avionics.errors import AvionicsError

app = typer.Typer(
    help="Switch faults of a running bench on and off.\n\n"
    "Example: avionics rig fault on pod_silent 'pod 0' --for 2",
    no_args_is_help=True,
)


def ask_bench(control: Path | None, request: dict[str, Any]) -> dict[str, Any]:
    """Return the answer of the bench behind a control socket, or behind the usual one."""
    from sim_bus.bench.client import ask, default_socket  # noqa: PLC0415

    return ask(control or default_socket(), request)


def numbers(text: str) -> frozenset[int]:
    """Return the numbers in a list with commas.

    Raises
    ------
    AvionicsError
        If something in it is no number.
    """
    try:
        return frozenset(int(word) for word in text.split(",") if word.strip())
    except ValueError:
        msg = f"'{text}': wants numbers with commas between, for example 0,1"
        raise AvionicsError(msg) from None


Kind = Annotated[
    str, typer.Argument(metavar="KIND", help="What fails; see `avionics rig fault list`.")
]
Target = Annotated[str, typer.Argument(metavar="TARGET", help="Where: 'pod 0', 'camera' or '*'.")]


@app.command("on")
def fault_on(
    kind: Kind,
    target: Target,
    *,
    value: Annotated[
        float, typer.Option(metavar="X", help="Strength, where the kind has one.")
    ] = 1.0,
    probability: Annotated[
        float, typer.Option(min=0, max=1, metavar="P", help="Chance each time, 0 to 1.")
    ] = 1.0,
    duration: Annotated[
        float | None,
        typer.Option("--for", metavar="S", help="How long; default: until switched off."),
    ] = None,
    markers: Annotated[
        str, typer.Option(metavar="0,1", help="Which markers; for marker_hidden.")
    ] = "",
    control: Control = None,
) -> None:
    """Switch a fault on.

    Example: avionics rig fault on nak "pod 0" --for 2
    """
    ask_bench(control, {
        "do": "fault", "on": True, "kind": kind, "target": target, "value": value,
        "probability": probability, "for_s": duration, "markers": sorted(numbers(markers)),
    })  # fmt: skip
    print(f"{kind} on for {target}")


@app.command("off")
def fault_off(kind: Kind, target: Target, control: Control = None) -> None:
    """Switch a fault off.

    Example: avionics rig fault off nak "pod 0"
    """
    ask_bench(control, {"do": "fault", "on": False, "kind": kind, "target": target})
    print(f"{kind} off for {target}")


@app.command("list")
def fault_list(control: Control = None) -> None:
    """List the faults that take effect on what the bench serves.

    Example: avionics rig fault list
    """
    for target, kinds in ask_bench(control, {"do": "faults"})["faults"].items():
        print(f"{target}: {', '.join(kinds)}")
