"""The hardware-in-the-loop bench: the simulated wing in real time on real or virtual interfaces.

Whatever flies (an unmodified ``avionics run`` in another process, or on the computer at the other
end of the cable) sees chips, pods and a camera. The truth stays on this side. ``build.py`` makes
one.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from avionics.config import Config
from drivers.clock import Clock
from sim_bus.bench.camera import FrameSink
from sim_bus.bench.places import Offer
from sim_bus.bench.served_can import ServedCan
from sim_bus.buses.factory import generator
from sim_bus.buses.faults import FaultPlan
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.rig import make_faults
from sim_bus.wing.build import make_wing
from sim_bus.wing.motion import PodMotion
from sim_bus.wing.scenario import Scenario
from sim_bus.wing.sim_wing import SimWing

# Until the scenario begins, the wing rests: its time zero lies out of reach.
NEVER_NS = 1 << 61
# A chip computes its data a second ahead.
LEAST_LEAD_S = 1.5
AHEAD_NS = 2_200_000_000
CameraOut = Literal["pipe", "v4l2", "window"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchOptions:
    """What the bench offers.

    Attributes
    ----------
    offer : Offer
        The buses.
    camera : str or None
        "pipe" serves frames on a Unix socket, "v4l2" writes them to an output device, "window"
        shows them on a page for a real camera to look at.
    camera_device : str
        V4L2 output device, or ``host:port`` of the page.
    folder : Path
        Where the frame socket is made.
    seed : int
        Of every random draw.
    """

    offer: Offer
    camera: CameraOut | None = None
    camera_device: str = ""
    folder: Path = Path()
    seed: int = 0


@dataclass(slots=True)
class Bench:
    """The parts that run; made by ``open_bench``.

    Attributes
    ----------
    config : Config
        The flying side's configuration: the served one, with the links of this bench.
    clock : Clock
        The steady clock of everything that is served.
    faults : FaultPlan
        What goes wrong; may be changed while it runs.
    scenario, seed : Scenario, int
        What the wing flies, and the seed of every random draw.
    chips : dict of str to SimBno055
        The simulated chips by pod name.
    motions : dict of str to PodMotion
        What they feel, without errors.
    stations : list of ServedCan
        The CAN buses with their simulated pods.
    page : str or None
        Address of the window.
    has_camera : bool
        Whether a camera is served.
    pictures : FrameSink or None
        Where its frames go.
    wing : SimWing
        The truth.
    """

    config: Config
    clock: Clock
    faults: FaultPlan
    scenario: Scenario
    seed: int
    chips: dict[str, SimBno055] = field(default_factory=dict)
    motions: dict[str, PodMotion] = field(default_factory=dict)
    stations: list[ServedCan] = field(default_factory=list)
    page: str | None = None
    has_camera: bool = False
    pictures: FrameSink | None = None
    wing: SimWing = field(init=False)
    _closers: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)

    def __post_init__(self) -> None:
        self.wing = make_wing(
            self.config, self.scenario, rng=generator(self.seed, "wing"), epoch_ns=NEVER_NS
        )

    @property
    def elapsed_s(self) -> float | None:
        """Seconds since the scenario began, None before it was started."""
        if self.wing.epoch_ns == NEVER_NS:
            return None
        return (self.clock.now_ns() - self.wing.epoch_ns) * 1e-9

    def start(self, lead_s: float) -> int:
        """Let the scenario begin ``lead_s`` (at least 1.5) from now; returns its time zero, ns."""
        if self.wing.epoch_ns == NEVER_NS:
            lead_ns = round(max(lead_s, LEAST_LEAD_S) * 1e9)
            epoch_ns = self.clock.now_ns() + lead_ns
            plan = make_faults(self.scenario, epoch_ns, generator(self.seed, "faults"))
            self.faults.faults.extend(plan.faults)
            self.wing.epoch_ns = epoch_ns
        return self.wing.epoch_ns

    def march_ahead(self) -> None:
        """Compute the wing's motion before a chip, which looks a second ahead, needs it."""
        if self.wing.epoch_ns != NEVER_NS:
            self.wing.truth(self.clock.now_ns() + AHEAD_NS)

    def counters(self) -> dict[str, dict[str, int]]:
        """Return what the bench counted, by part."""
        counted = {station.name: dict(station.counters) for station in self.stations}
        if self.pictures is not None:
            counted["camera"] = self.pictures.counters
        return counted

    def close(self) -> None:
        """Take every interface away; may be called twice."""
        self._closers.close()

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def keep(self, close: Callable[[], None]) -> None:
        """Close this with the bench, last first."""
        self._closers.callback(close)
