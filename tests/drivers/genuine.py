"""Faults of the matrix in real time: the driver behind a genuine node of the kernel."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.clock import SteadyClock
from drivers.polled_imus import PolledImus
from drivers.samples import ImuSample
from sim_bus.buses.faults import Fault, FaultPlan
from sim_bus.chip.bno055.chip import SimBno055
from tests.drivers.fault_matrix import Case
from tests.drivers.wing_bench import GOOD, SECOND, Swing

LONGEST_S = 0.6
RETURN_S = 1.5
RATE_MARGIN_RAD_S = 0.05


class Turning(Swing):
    """A swing about x that turns about z, at a rate by which chips are told apart."""

    def __init__(self, z_rad_s: float) -> None:
        self.z_rad_s = z_rad_s

    def sense(self, t_ns):
        rate, force, flux = super().sense(t_ns)
        rate[:, 2] = self.z_rad_s
        return rate, force, flux


def make_chip(z_rad_s: float, seed: int = 1) -> SimBno055:
    """Return a chip that has booted."""
    power_on_ns = SteadyClock().now_ns() - SECOND
    rng = np.random.default_rng(seed)
    return SimBno055(Turning(z_rad_s), rng, grade=GOOD, power_on_ns=power_on_ns)


@dataclass
class Flight:
    """Chips in real time, and what fails."""

    imus: PolledImus
    plan: FaultPlan

    def read(self, seconds: float) -> list[ImuSample]:
        """Read for so long."""
        samples, end = [], time.monotonic() + seconds
        while time.monotonic() < end:
            if (sample := self.imus.read(0.02)) is not None:
                samples.append(sample)
        return samples

    def wait_for(self, count: int, pod: str = "0", limit_s: float = 5.0) -> list[ImuSample]:
        """Read until a pod has delivered so many samples."""
        samples: list[ImuSample] = []
        end = time.monotonic() + limit_s
        while len(samples) < count and time.monotonic() < end:
            sample = self.imus.read(0.02)
            if sample is not None and sample.pod == pod:
                samples.append(sample)
        return samples

    def fault(self, kind: str, for_s: float, pod: int = 0, **more: float) -> int:
        """Let something fail from now on; returns when it ends, ns."""
        start_ns = SteadyClock().now_ns()
        end_ns = start_ns + round(for_s * SECOND)
        self.plan.switch_on(Fault(kind, f"pod {pod}", start_ns, end_ns, **more))
        return end_ns

    def count(self, name: str, pod: int = 0) -> int:
        """Return a counter of a pod."""
        return self.imus.health()[f"pod {pod}"].get(name, 0)


def z_errors(samples: Sequence[ImuSample], z_rad_s: float) -> np.ndarray:
    """Return how wrong the rates about z are, rad/s, shape (n,)."""
    return np.abs(np.array([s.rate_rad_s[2] for s in samples]) - z_rad_s)


def survive(flight: Flight, case: Case, z_rad_s: float) -> None:
    """Fly one case of the matrix and judge it by wide bounds."""
    assert len(flight.wait_for(10)) == 10, flight.imus.health()
    before = flight.count(case.counter)
    # A fault that comes by chance needs its time.
    for_s = case.for_s if case.probability < 1.0 else min(case.for_s, LONGEST_S)
    end_ns = flight.fault(case.kind, for_s, probability=case.probability, value=case.value)
    during = flight.read(for_s)
    after = [s for s in flight.wait_for(20) if s.t_ns > end_ns]
    assert after, flight.imus.health()
    back_s = (after[0].t_ns - end_ns) / SECOND
    assert back_s < max(RETURN_S, case.recovery_s + 1.0), (back_s, flight.imus.health())
    assert flight.count(case.counter) > before, flight.imus.health()
    wrong = z_errors([*during, *after], z_rad_s) > RATE_MARGIN_RAD_S
    assert wrong.sum() * 0.01 <= case.wrong_s
