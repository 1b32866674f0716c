"""`avionics rig serve`: the simulated wing in real time, for another process to fly."""

import json
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from avionics.cli.faults import numbers
from avionics.cli.options import AsJson, ConfigOrPackaged, Control, Force, Overrides, Seed
from avionics.cli.signals import stopping
from avionics.errors import AvionicsError
from avionics.output_paths import claim_file
from drivers.prompt_threads import prompt_threads

if TYPE_CHECKING:
    from avionics.config import Config, FlightConfig

WRITE_EVERY_S = 0.05


def serve(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="Packaged scenario, e.g. gust, or TOML.")
    ],
    config_path: ConfigOrPackaged = None,
    *,
    can: Annotated[
        str | None, typer.Option(metavar="CHANNEL", help="Serve CAN pods on it.")
    ] = None,
    interface: Annotated[
        str, typer.Option(metavar="NAME", help="python-can interface of --can, e.g. slcan.")
    ] = "socketcan",
    bitrate: Annotated[
        int | None, typer.Option(metavar="N", help="Bit rate of --can, where it sets it.")
    ] = None,
    i2c_dev: Annotated[
        int | None, typer.Option(metavar="N", help="Serve I2C as /dev/i2c-N and up (root, CUSE).")
    ] = None,
    uart: Annotated[bool, typer.Option("--uart", help="Serve serial chips on ptys.")] = False,
    uart_device: Annotated[
        list[str] | None,
        typer.Option(metavar="TTY", help="Real serial port instead of a pty; repeat."),
    ] = None,
    camera: Annotated[
        Literal["pipe", "v4l2", "window"] | None,
        typer.Option(help="Serve pictures: local socket, V4L2, web page."),
    ] = None,
    camera_device: Annotated[
        str,
        typer.Option(
            metavar="DEV|HOST:PORT", help="V4L2 output device, or address of the web page."
        ),
    ] = "",
    pods: Annotated[
        str | None, typer.Option(metavar="0,1", help="Pods to simulate; default: all.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="TRUTH.mcap",
            help="Log of the truth; default: truth-<scenario>-<seed>.mcap.",
        ),
    ] = None,
    write_config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the configuration to fly it with.")
    ] = None,
    overrides: Overrides = None,
    wing: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which wing to serve, of several.")
    ] = None,
    lead: Annotated[
        float, typer.Option(min=1.5, metavar="S", help="Rest before the scenario begins.")
    ] = 10.0,
    hold: Annotated[bool, typer.Option("--hold", help="Rest until `avionics rig start`.")] = False,
    duration: Annotated[
        float | None, typer.Option(min=0.1, metavar="S", help="End S seconds into the scenario.")
    ] = None,
    prepare: Annotated[
        float | None,
        typer.Option(
            min=0,
            metavar="S",
            help="Seconds of the flight to compute before it is served, and to keep for the next "
            "time; what follows is computed as it flies, and so is all of it with 0. Default: "
            "--duration, or the scenario's own; at most 600.",
        ),
    ] = None,
    seed: Seed = 0,
    control: Control = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Serve the simulated wing in real time, for `avionics run` elsewhere to fly.

    Example: avionics rig serve default --can vcan0 --camera pipe --write-config fly.toml -o t.mcap
    """
    from avionics.cli.configuration import given_or_packaged  # noqa: PLC0415 (start-up)

    given = given_or_packaged(config_path, tuple(overrides or ()))
    config = _served_wing(given, wing)
    if camera_device and camera in {None, "pipe"}:
        msg = "--camera-device: is the place of --camera v4l2 or --camera window; give one of them"
        raise AvionicsError(msg)
    simulated = None if pods is None else numbers(pods)
    truth = claim_file(output or Path(f"truth-{Path(scenario).stem}-{seed}.mcap"), force=force)
    if write_config is not None:
        claim_file(write_config, force=force)

    from sim_bus.bench.client import default_socket  # noqa: PLC0415 (after what may be refused)
    from sim_bus.wing.scenario import load_scenario  # noqa: PLC0415

    flown = load_scenario(scenario)

    from sim_bus.bench.bench import BenchOptions  # noqa: PLC0415
    from sim_bus.bench.build import open_bench  # noqa: PLC0415
    from sim_bus.bench.control import BenchControl, ControlServer  # noqa: PLC0415
    from sim_bus.bench.places import Offer  # noqa: PLC0415
    from sim_bus.bench.prepare import LONGEST_S  # noqa: PLC0415
    from sim_bus.bench.prepare import prepare as prepare_flight  # noqa: PLC0415
    from sim_bus.bench.truth_log import TruthLog  # noqa: PLC0415

    socket = control or default_socket()
    offer = Offer(
        can=can, interface=interface, bitrate=bitrate, i2c_dev=i2c_dev, uart=uart,
        uart_devices=tuple(uart_device or ()), pods=simulated,
    )  # fmt: skip
    options = BenchOptions(
        offer=offer, camera=camera, camera_device=camera_device, folder=socket.parent, seed=seed
    )
    # The control socket is claimed first: a bench that is refused has touched nothing. It goes
    # last: `rig stop` sees by it that the truth is on disk.
    with (
        stopping() as stop,
        prompt_threads(),
        ControlServer(socket) as server,
        open_bench(config, flown, options) as bench,
    ):
        seconds = min(prepare if prepare is not None else duration or flown.duration_s, LONGEST_S)
        if seconds > 0:
            prepare_flight(bench, seconds, _Preparing(stop))
        if write_config is not None:
            _write(write_config, _toml(bench.config))
        with TruthLog(truth, bench, force=force) as log:
            server.answer_with(BenchControl(bench, stop, log.say))
            _announce(_description(bench, socket, truth, write_config), as_json=as_json)
            note = _over(seconds) if seconds > 0 else None
            if not hold:
                bench.start(lead)
            while not stop.wait(WRITE_EVERY_S):
                bench.compute_ahead()
                log.write_due()
                elapsed_s = bench.elapsed_s
                if note is not None and elapsed_s is not None and elapsed_s >= seconds:
                    log.say(note)
                    print(note, file=sys.stderr, flush=True)
                    note = None
                if duration is not None and elapsed_s is not None and elapsed_s >= duration:
                    break
    if not as_json:
        print(f"wrote {truth} ({truth.stat().st_size / 1e6:.1f} MB)")
        print(f"next: avionics rig join FLIGHT.mcap {truth} -o joined.mcap")


def _over(seconds: float) -> str:
    return f"the prepared {seconds:g} s are over: the wing is now computed as it flies"


class _Preparing:
    """Says once that a flight is being computed; a stop request ends that too."""

    def __init__(self, stop: threading.Event) -> None:
        self._stop, self._has_begun = stop, False

    def __call__(self, done_s: float, wanted_s: float) -> None:
        if not self._has_begun:
            self._has_begun = True
            print(f"computing {wanted_s:g} s of flight before it is served", file=sys.stderr)
        if self._stop.is_set():
            raise KeyboardInterrupt


def _served_wing(config: "FlightConfig", name: str | None) -> "Config":
    from avionics.config import one_wing  # noqa: PLC0415

    if name is not None:
        return config.for_wing(name)
    return one_wing(config, "rig serve", remedy="choose one with --wing NAME")


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        msg = f"{path}: cannot be written ({error.strerror})"
        raise AvionicsError(msg) from error


def _toml(config: "Config") -> str:
    from avionics.recording.attached import config_toml  # noqa: PLC0415

    head = "# Made by `avionics rig serve`: the served wing, with the links of that bench.\n"
    return head + config_toml(config)


def _description(bench: Any, socket: Path, truth: Path, config: Path | None) -> dict[str, Any]:
    camera = bench.config.camera
    source = None if camera is None or camera.source is None else camera.source
    return {
        "pods": {
            pod.name: None if pod.link is None else pod.link.model_dump(mode="json")
            for pod in bench.config.pods
        },
        "simulated": sorted(bench.chips),
        "camera": None if source is None else source.model_dump(mode="json"),
        "page": bench.page,
        "prepared_s": 0.0 if bench.prepared is None else bench.prepared.end_ns * 1e-9,
        "control": str(socket),
        "truth": str(truth),
        "config": None if config is None else str(config),
    }


def _announce(found: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print(json.dumps(found), flush=True)
        return
    from rich.console import Console  # noqa: PLC0415 (start-up)
    from rich.markup import escape  # noqa: PLC0415 (start-up)
    from rich.table import Table  # noqa: PLC0415 (start-up)

    table = Table(box=None, pad_edge=False, title="serving", title_justify="left")
    for heading in ("part", "by", "for the flying side's configuration"):
        table.add_column(heading, overflow="fold")
    for name, link in found["pods"].items():
        by = "simulation" if name in found["simulated"] else "hardware"
        table.add_row(f"pod {escape(name)}", by, escape(_inline(link)))
    if found["camera"] is not None:
        table.add_row("camera", "simulation", escape(_inline(found["camera"])))
    if found["page"] is not None:
        table.add_row("page", "simulation", f"open {found['page']} full screen")
    table.add_row("control", "", escape(found["control"]))
    if found["prepared_s"]:
        table.add_row("flight", f"prepared, {found['prepared_s']:g} s", "then computed as it flies")
    Console().print(table)
    print("Ctrl-C ends the bench", flush=True)


def _inline(link: dict[str, Any] | None) -> str:
    if link is None:
        return "no link"
    pairs = ", ".join(f"{k} = {json.dumps(v)}" for k, v in link.items() if v is not None)
    return f"{{ {pairs} }}"
