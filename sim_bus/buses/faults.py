"""Timed faults: what fails, where, when and for how long; can be switched while the rig runs.

The plan only says what is active. Each simulated part asks it at its own place: the I2C bus for
``nak``, the camera for ``marker_hidden``, and so on. ``apply_to_chip`` does the chip's own faults.
"""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from sim_bus.chip.sim_chip import SimChip

ChipFault = Literal["brown_out", "config_reset", "page_left", "freeze", "zero"]
I2cFault = Literal["nak", "stuck_bus", "io_error", "arbitration_lost", "spike", "wrong_chip"]
SpiFault = Literal["spi_low", "spi_high"]
UartFault = Literal["uart_overrun", "uart_silence", "uart_garbage", "uart_late", "uart_truncate"]
CanFault = Literal["pod_silent", "frame_drop", "frame_duplicate", "bus_off"]
CameraFault = Literal[
    "camera_drop", "camera_late", "camera_freeze", "camera_dead",
    "marker_hidden", "false_light", "illumination",
]  # fmt: skip
Kind = ChipFault | I2cFault | SpiFault | UartFault | CanFault | CameraFault
KINDS: tuple[str, ...] = tuple(
    kind
    for group in (ChipFault, I2cFault, SpiFault, UartFault, CanFault, CameraFault)
    for kind in get_args(group)
)


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault.

    Attributes
    ----------
    kind : str
        One of ``KINDS``.
    target : str
        ``"pod 0"``, ``"camera"`` (with several wings each of them, or one: ``"camera left"``, by
        its name), or ``"*"`` for every part that knows the kind.
    start_ns, stop_ns : int
        From when to when it is active, ns.
    probability : float
        Chance per transaction, frame or image while active.
    value : float
        Strength where the kind has one: brightness of ``illumination``, delay in seconds of
        ``camera_late`` and ``uart_late``, page of ``page_left``.
    markers : tuple of int
        Ids of ``marker_hidden``; empty means all.
    """

    kind: str
    target: str
    start_ns: int
    stop_ns: int
    probability: float = 1.0
    value: float = 1.0
    markers: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            msg = f"fault kind '{self.kind}' is unknown; wanted one of {', '.join(KINDS)}"
            raise ValueError(msg)

    def is_for(self, target: str) -> bool:
        """Return whether a part is meant."""
        return self.target in {"*", target} or target.startswith(f"{self.target} ")


@dataclass(slots=True)
class FaultPlan:
    """The faults of a flight, and the dice that those with a probability roll."""

    faults: list[Fault] = field(default_factory=list)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    _started: set[tuple[int, str]] = field(default_factory=set)

    def switch_on(self, fault: Fault) -> None:
        """Add a fault while the rig runs."""
        self.faults.append(fault)

    def switch_off(self, kind: str, target: str, t_ns: int) -> None:
        """End every active fault of a kind on a target."""
        self.faults = [
            Fault(f.kind, f.target, f.start_ns, t_ns, f.probability, f.value, f.markers)
            if f.kind == kind and f.target == target and f.start_ns <= t_ns < f.stop_ns
            else f
            for f in self.faults
        ]

    def active(self, kind: str, target: str, t_ns: int) -> Fault | None:
        """Return the fault that is active now, without rolling its dice."""
        for fault in self.faults:
            if (
                fault.kind == kind
                and fault.start_ns <= t_ns < fault.stop_ns
                and fault.is_for(target)
            ):
                return fault
        return None

    def strikes(self, kind: str, target: str, t_ns: int) -> bool:
        """Return whether a fault is active and, by its probability, hits this time."""
        fault = self.active(kind, target, t_ns)
        if fault is None:
            return False
        return fault.probability >= 1 or bool(self.rng.random() < fault.probability)

    def apply_to_chip(self, chip: SimChip, target: str, t_ns: int) -> None:
        """Do once what begins: brown-out, reset to CONFIG, page left, frozen or zero data."""
        for index, fault in enumerate(self.faults):
            if (
                fault.start_ns > t_ns
                or not fault.is_for(target)
                or (index, target) in self._started
            ):
                continue
            self._started.add((index, target))
            match fault.kind:
                case "brown_out":
                    chip.brown_out(fault.start_ns)
                case "config_reset":
                    chip.brown_out(fault.start_ns, silent_ns=0)
                case "page_left":
                    chip.select_page(int(fault.value))
                case "freeze":
                    chip.freeze_until_ns = fault.stop_ns
                case "zero":
                    chip.zero_until_ns = fault.stop_ns
                case _:
                    pass


def flip_bit_7(data: bytes, rng: np.random.Generator) -> bytes:
    """Return ``data`` with bit 7 of one byte reading 1, as under early sampling of SDA."""
    if not data:
        return data
    position = int(rng.integers(len(data)))
    return data[:position] + bytes([data[position] | 0x80]) + data[position + 1 :]


def seconds_to_ns(seconds: float) -> int:
    """Return whole nanoseconds; an infinite time becomes the largest."""
    return (1 << 62) if math.isinf(seconds) else round(seconds * 1e9)
