"""Switches the faults of a running bench; whatever would do nothing is refused."""

import math
from typing import Final, get_args

from avionics.config.links import CanLink, UartLink
from sim_bus.bench.bench import Bench
from sim_bus.bench.client import Answer
from sim_bus.buses.faults import CameraFault, CanFault, ChipFault, Fault, I2cFault, UartFault

LONGEST_S: Final = 1e6
CAMERA: Final = "camera"
EVERYWHERE: Final = "*"
# The pod's firmware polls its chip by I2C; these are what its simulated board can show it.
ON_CAN: Final = (*get_args(ChipFault), *get_args(CanFault), "nak", "io_error", "stuck_bus", "spike")
ON_I2C: Final = (*get_args(ChipFault), *get_args(I2cFault))
ON_UART: Final = (*get_args(ChipFault), *get_args(UartFault))
# Done to the chip once and over: these have no end.
AT_ONCE: Final = frozenset({"brown_out", "config_reset", "page_left"})


def effective_faults(bench: Bench) -> dict[str, tuple[str, ...]]:
    """Return which kinds of fault have an effect, by target."""
    kinds: dict[str, tuple[str, ...]] = {}
    for pod in bench.config.pods:
        if pod.name in bench.chips:
            on_bus = ON_CAN if isinstance(pod.link, CanLink) else ON_I2C
            kinds[f"pod {pod.name}"] = ON_UART if isinstance(pod.link, UartLink) else on_bus
    if bench.has_camera:
        kinds[CAMERA] = get_args(CameraFault)
    return kinds


class FaultSwitch:
    """Faults of a bench by command. What cannot be done raises ValueError in words."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def active(self) -> list[Fault]:
        """Return the faults that are on now."""
        now_ns = self._bench.clock.now_ns()
        return [f for f in self._bench.faults.faults if f.start_ns <= now_ns < f.stop_ns]

    def switch_on(self, kind: str, target: str, request: Answer) -> None:
        """Switch a fault on, for ``for_s`` seconds or until it is switched off."""
        self._check_target(kind, target)
        now_ns = self._bench.clock.now_ns()
        for_s = _number(request, "for_s", LONGEST_S)
        if for_s <= 0:
            msg = f"--for {for_s:g}: wants more than 0 s; without it the fault stays on"
            raise ValueError(msg)
        for_s = 0.0 if kind in AT_ONCE else min(for_s, LONGEST_S)
        probability = _number(request, "probability", 1.0)
        if not 0 < probability <= 1:
            msg = f"--probability {probability:g}: wants more than 0, up to 1"
            raise ValueError(msg)
        markers = self._markers(kind, request)
        for other in self.active():
            if other.kind == kind and _share(other, target, markers):
                msg = (
                    f"fault '{kind}' is on already for {_quoted(other.target)}; end it first: "
                    f"avionics rig fault off {kind} {_quoted(other.target)}"
                )
                raise ValueError(msg)
        self._bench.faults.switch_on(
            Fault(
                kind, target, now_ns, now_ns + round(for_s * 1e9), probability,
                _number(request, "value", 1.0), markers,
            )
        )  # fmt: skip

    def switch_off(self, kind: str, target: str) -> None:
        """Switch a fault off; ``*`` ends it wherever it is on."""
        self._check_target(kind, target)
        if kind in AT_ONCE:
            msg = f"fault '{kind}' happens once and is over; there is nothing to switch off"
            raise ValueError(msg)
        on = {fault.target for fault in self.active() if fault.kind == kind}
        ended = on if target == EVERYWHERE else on & {target}
        if not ended and EVERYWHERE in on:
            msg = (
                f"fault '{kind}' is on for all at once, not for {_quoted(target)} alone; end it "
                f"with: avionics rig fault off {kind} '*'"
            )
            raise ValueError(msg)
        if not ended:
            where = f"; it is on for {', '.join(sorted(map(_quoted, on)))}" if on else ""
            msg = (
                f"fault '{kind}' is not on for {_quoted(target)}{where}; see `avionics rig status`"
            )
            raise ValueError(msg)
        for one in sorted(ended):
            self._end(kind, one)

    def _end(self, kind: str, target: str) -> None:
        now_ns = self._bench.clock.now_ns()
        self._bench.faults.switch_off(kind, target, now_ns)
        for name, chip in self._bench.chips.items():
            if target in {EVERYWHERE, f"pod {name}"}:  # these two were set in the chip at once
                if kind == "freeze":
                    chip.freeze_until_ns = now_ns
                elif kind == "zero":
                    chip.zero_until_ns = now_ns

    def _check_target(self, kind: str, target: str) -> None:
        known = effective_faults(self._bench)
        if target != EVERYWHERE and target not in known:
            msg = f"target '{target}' is not served; wanted {', '.join(known)} or *"
            raise ValueError(msg)
        able = [name for name, kinds in known.items() if kind in kinds]
        if not able or (target != EVERYWHERE and target not in able):
            what = f"takes effect on {', '.join(able)} only" if able else "takes no effect here"
            msg = f"fault '{kind}' {what}; see `avionics rig fault list`"
            raise ValueError(msg)

    def _markers(self, kind: str, request: Answer) -> tuple[int, ...]:
        markers = tuple(sorted({int(m) for m in request.get("markers") or ()}))
        if markers and kind != "marker_hidden":
            msg = f"--markers: means nothing to fault '{kind}', only to marker_hidden"
            raise ValueError(msg)
        known = sorted(marker.id for marker in self._bench.config.markers)
        if absent := [str(marker) for marker in markers if marker not in known]:
            msg = (
                f"--markers: no marker {', '.join(absent)}; served are {', '.join(map(str, known))}"
            )
            raise ValueError(msg)
        return markers


def _number(request: Answer, name: str, otherwise: float) -> float:
    found = request.get(name)
    number = otherwise if found is None else float(found)
    if not math.isfinite(number):
        msg = f"{name} is {number}; wanted a finite number"
        raise ValueError(msg)
    return number


def _share(other: Fault, target: str, markers: tuple[int, ...]) -> bool:
    """Return whether a fault is on already where it is wanted again."""
    if not (EVERYWHERE in {other.target, target} or other.target == target):
        return False
    return not (other.markers and markers and set(other.markers).isdisjoint(markers))


def _quoted(target: str) -> str:
    return target if target.isalpha() else f"'{target}'"
