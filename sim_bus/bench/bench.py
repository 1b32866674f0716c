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

from avionics.config import Camera, Config
from avionics.records import Truth
from drivers.clock import Clock
from sim_bus.bench.camera import FrameSink
from sim_bus.bench.places import Offer
from sim_bus.bench.prepared import PlayedMotion, Prepared
from sim_bus.bench.served_can import ServedCan
from sim_bus.buses.factory import generator
from sim_bus.buses.faults import FaultPlan
from sim_bus.camera.sim_camera import SimCamera
from sim_bus.chip.sim_chip import SimChip
from sim_bus.rig import make_faults
from sim_bus.wing.build import make_wing
from sim_bus.wing.scenario import Picture, Scenario
from sim_bus.wing.sim_wing import SimWing

# Until the scenario begins, the wing rests: its time zero lies out of reach.
NEVER_NS = 1 << 61
# A chip computes its data a second ahead, and begins with it ``CHIP_AHEAD_NS`` before it must.
LEAST_LEAD_S = 1.5
CHIP_AHEAD_NS = 300_000_000
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
    chips : dict of str to SimChip
        The simulated chips by pod name.
    motions : dict of str to PlayedMotion
        What they feel, without errors.
    stations : list of ServedCan
        The CAN buses with their simulated pods.
    page : str or None
        Address of the window.
    shown : Camera or None
        The camera that is served, with the lens that its pictures have.
    look : Picture
        What that camera makes of the wing.
    camera : SimCamera or None
        It.
    pictures : FrameSink or None
        Where its frames go.
    prepared : Prepared or None
        What is played back instead of computed.
    wing : SimWing
        The truth where nothing is prepared.
    """

    config: Config
    clock: Clock
    faults: FaultPlan
    scenario: Scenario
    seed: int
    chips: dict[str, SimChip] = field(default_factory=dict)
    motions: dict[str, PlayedMotion] = field(default_factory=dict)
    stations: list[ServedCan] = field(default_factory=list)
    page: str | None = None
    shown: Camera | None = None
    look: Picture = field(default_factory=Picture)
    camera: SimCamera | None = None
    pictures: FrameSink | None = None
    prepared: Prepared | None = None
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
        """Let the scenario begin ``lead_s`` (at least 1.5) from now; returns its time zero, ns.

        With a camera it begins in the middle of an exposure, up to a frame later.
        """
        if self.wing.epoch_ns == NEVER_NS:
            lead_ns = round(max(lead_s, LEAST_LEAD_S) * 1e9)
            epoch_ns = self.clock.now_ns() + lead_ns
            if self.camera is not None:
                epoch_ns = self.camera.align(epoch_ns)
            plan = make_faults(self.scenario, epoch_ns, generator(self.seed, "faults"))
            self.faults.faults.extend(plan.faults)
            self.wing.epoch_ns = epoch_ns
        return self.wing.epoch_ns

    @property
    def has_camera(self) -> bool:
        """Whether a camera is served."""
        return self.camera is not None

    def make_camera(self, wing: SimWing, faults: FaultPlan, *, start_ns: int) -> SimCamera:
        """Return the camera that is served, looking at a wing."""
        assert self.shown is not None
        return SimCamera(
            self.shown, wing, self.config.markers, self.clock, look=self.look,
            rng=generator(self.seed, "camera"), faults=faults, start_ns=start_ns,
        )  # fmt: skip

    def play(self, prepared: Prepared) -> None:
        """Play a prepared flight back once the scenario begins; to be called before that."""
        self.prepared = prepared
        self.wing.go_on(prepared.tail_number, prepared.tail)
        for name, motion in self.motions.items():
            motion.play(prepared.motion[name])
        if self.camera is not None and prepared.strip is not None:
            self.camera.play(prepared.strip)

    def truth(self, t_ns: int) -> Truth:
        """Return the wing's shape at one instant: of a prepared flight, of those it has only."""
        found = None
        if self.prepared is not None and t_ns >= self.wing.epoch_ns:
            found = self.prepared.truth(t_ns, self.wing.name, epoch_ns=self.wing.epoch_ns)
        return self.wing.truth(t_ns) if found is None else found

    def compute_ahead(self) -> None:
        """Compute before anybody waits for it: what is not prepared, and the chips' next data."""
        now_ns = self.clock.now_ns()
        end_ns = 0 if self.prepared is None else self.prepared.end_ns
        if now_ns + AHEAD_NS > self.wing.epoch_ns + end_ns:
            self.wing.compute_until(now_ns + AHEAD_NS)
        for chip in self.chips.values():
            chip.sensing.compute_ahead(now_ns + CHIP_AHEAD_NS)

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
