"""Run times of the distributed-POS loops beside plain Python's, and of Gong's Table 2.

    python benchmarks/pos.py            loops only
    python benchmarks/pos.py --table    also Table 2, both profiles, ten runs

Processor time (all threads of the process) and wall-clock time; on two free cores the second is
about half of the first for the table.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from avionics.pos.flexure import markov_flexure
from avionics.pos.methods import Method, estimate
from avionics.pos.online import GsBank, GyroNoise
from avionics.pos.simulate import simulate
from avionics.pos.study.runs import run_study
from avionics.pos.study.spec import load_spec

METHODS = {
    "IMU": Method("imu"),
    "Gs": Method("gs"),
    "As": Method("as", nonlinear=False, arm_model=True),
    "GA": Method("ga", arm_model=True),
}
PLAIN_STEPS = 400


def loops(*, steps: int | None = None) -> dict[str, float]:
    """Microseconds of processor time per step, by method, filter alone and with smoother."""
    spec = load_spec("gong-table2")
    truth = spec.profiles["consistent"].truth
    node = spec.slave(truth)
    if steps is not None:
        leg = spec.legs[0].model_copy(update={"duration_s": steps * spec.step_s})
        spec = spec.model_copy(update={"legs": (leg,)})
    trajectory = spec.trajectory("no variation", truth)
    _, measured = simulate(trajectory, node, np.random.default_rng(1))
    found = {}
    for smooth in (False, True):
        for name, method in METHODS.items():
            if steps is None:
                estimate(method, measured, node, trajectory, smooth=smooth)  # compiles
            start = time.process_time()
            estimate(method, measured, node, trajectory, smooth=smooth)
            used = time.process_time() - start
            found[name + " + smoother" * smooth] = 1e6 * used / (len(trajectory.t) - 1)
    return found


def plain() -> dict[str, float]:
    """The same loops uncompiled, in a process of their own."""
    code = (
        "import json; from benchmarks.pos import loops, PLAIN_STEPS; "
        "print(json.dumps(loops(steps=PLAIN_STEPS)))"
    )
    root = str(Path(__file__).resolve().parents[1])
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": root}
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, env=env, capture_output=True, text=True, cwd=root
    )
    return dict(json.loads(done.stdout))


def bank(pods: int = 2, steps: int = 2000) -> float:
    """Microseconds per step of the filter that flies."""
    law = markov_flexure(np.ones(3), np.deg2rad(np.array([12.0, 6.0, 3.0])))
    filters = GsBank(pods, 0.01, law, GyroNoise(2e-3, 2e-3, 0.02, 0.02), 0.1)
    rates, heard = 0.1 * np.ones((pods, 3)), np.ones(pods, dtype=bool)
    start = time.process_time()
    for _ in range(steps):
        filters.step(np.zeros(3), rates, heard)
    return 1e6 * (time.process_time() - start) / steps


def table() -> None:
    """Gong's Table 2: both profiles, the three methods, ten runs."""
    for scenarios in (("no variation",), ("no variation", "with variation")):
        wall, used = time.monotonic(), time.process_time()
        for profile in ("as_published", "consistent"):
            spec = load_spec("gong-table2")
            shown = spec.profiles[profile]
            methods = tuple(
                m.model_copy(update={"smooth": False}) for m in shown.methods if m.name != "GA"
            )
            shown = shown.model_copy(update={"methods": methods})
            spec = spec.model_copy(update={"profiles": {profile: shown}})
            run_study("b", spec, profile, seeds=range(1, 11), scenarios=scenarios)
        wall, used = time.monotonic() - wall, time.process_time() - used
        print(f"Table 2, {' and '.join(scenarios)}: {wall:.0f} s wall, {used:.0f} s processor")


if __name__ == "__main__":
    fast, slow = loops(), plain()
    print(f"{'us per step (130 000 steps)':28s}{'compiled':>10s}{'plain':>10s}{'ratio':>8s}")
    for name, value in fast.items():
        print(f"{name:28s}{value:10.1f}{slow[name]:10.0f}{slow[name] / value:8.0f}")
    print(f"Gs online, two pods: {bank():.0f} us per step of 10 ms")
    if "--table" in sys.argv:
        table()
