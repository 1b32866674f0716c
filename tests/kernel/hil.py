"""One flight with the wing served by one process and flown by another, as a person would do it."""

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from avionics.analysis.comparison import SETTLE_S
from avionics.analysis.flight import read_flight

AVIONICS = (sys.executable, "-m", "avionics")
START_S = 150.0

# Moves from the first second on, so that a short flight is one; wing and truth are fine enough
# for 3 Hz, for the guest has one CPU.
SCENARIO = """
name = "hil"
duration_s = 60.0
truth_hz = 25.0

[wing]
elements = 12
step_s = 0.004

[[loads]]
kind = "sweep"
at_s = 0.5
for_s = 50.0
from_hz = 0.4
to_hz = 3.0
amplitude_m = 0.45
torque_nm = 0.6
"""


def avionics(*words: object, timeout: float = START_S) -> str:
    """Run a command to its end; returns what it printed."""
    done = subprocess.run(
        [*AVIONICS, *(str(word) for word in words)],
        capture_output=True, text=True, timeout=timeout, check=False, env=environment(),
    )  # fmt: skip
    assert done.returncode == 0, f"{words}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def environment() -> dict[str, str]:
    """One thread each: two processes share what cores there are."""
    return {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@dataclass
class Bench:
    """A served wing in a process of its own."""

    folder: Path
    process: "subprocess.Popen[str]"
    found: dict[str, Any]
    socket: Path

    @property
    def config(self) -> Path:
        return self.folder / "fly.toml"

    @property
    def truth(self) -> Path:
        return self.folder / "truth.mcap"

    def stop(self) -> None:
        """End it and wait for its truth."""
        if self.process.poll() is None:
            self.process.terminate()
        out, err = self.process.communicate(timeout=60)
        assert self.process.returncode == 0, out + err


def serve(folder: Path, *words: str, fps: int = 15, socket: Path | None = None) -> Bench:
    """Start a bench that rests until it is told to start; returns when its interfaces are there."""
    socket = socket or folder / "c.sock"
    (folder / "hil.toml").write_text(SCENARIO, encoding="utf-8")
    bench = Bench(folder, None, {}, socket)  # type: ignore[arg-type]
    bench.process = subprocess.Popen(
        [
            *AVIONICS, "rig", "serve", str(folder / "hil.toml"), "--hold", "--json",
            "--set", f"camera.fps={fps}", "--control", str(bench.socket),
            "--write-config", str(bench.config), "-o", str(bench.truth), *words,
        ],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(),
    )  # fmt: skip
    assert bench.process.stdout is not None
    line = bench.process.stdout.readline()
    if not line:
        _, error = bench.process.communicate(timeout=30)
        raise AssertionError(error)
    bench.found = json.loads(line)
    return bench


def fly(bench: Bench, flight: Path, duration_s: float) -> str:
    """Fly the bench with `avionics run`; the scenario starts when it flies."""
    flying = subprocess.Popen(
        [*AVIONICS, "run", str(bench.config), "--duration", str(duration_s), "-o", str(flight)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(),
    )  # fmt: skip
    try:
        assert flying.stdout is not None
        first = flying.stdout.readline()
        if "flying" in first:
            avionics("rig", "start", "--lead", "1.5", "--control", bench.socket)
        out, err = flying.communicate(timeout=duration_s + START_S)
    finally:
        flying.kill()
        flying.wait()
    assert flying.returncode == 0, first + out + err
    return first + out


def given(*settings: str) -> list[str]:
    """Return settings as words of a command line."""
    return [word for setting in settings for word in ("--set", setting)]


def figures(log: Path) -> dict[str, Any]:
    """Return what `avionics evaluate` says."""
    return dict(json.loads(avionics("evaluate", log, "--json")))


def kept(log: Path, rates_hz: dict[str, float], flight_s: float) -> dict[str, float]:
    """Return the share of its records that each topic has in the part that is evaluated."""
    flight = read_flight(log, list(rates_hz))
    times = {topic: flight.by_topic[topic].t_ns for topic in rates_hz}
    first_ns = min(t_ns.min() for t_ns in times.values()) + round(SETTLE_S * 1e9)
    return {
        topic: int((times[topic] >= first_ns).sum()) / (rate_hz * (flight_s - SETTLE_S))
        for topic, rate_hz in rates_hz.items()
    }


def counted(log: Path) -> str:
    """Return what the drivers and the runner counted, for whoever has to explain a loss."""
    last = read_flight(log, ["/health"]).health.last
    return "; ".join(
        f"{source}: " + ", ".join(f"{name} {count}" for name, count in counters.items() if count)
        for source, counters in sorted(last.items())
        if source.startswith(("driver ", "runner"))
    )


def tip_motion_m(log: Path) -> float:
    """Return how far the true tip strayed from its mean while gyros were logged, RMS, m."""
    flight = read_flight(log, ["/imu/0", "/wing/*/truth"])
    flown_ns, truth = flight.imu["0"].t_ns, flight.truth
    during = (truth.t_ns >= flown_ns[0]) & (truth.t_ns <= flown_ns[-1])
    tips = truth.line_in_body_m[during, -1]
    return float(np.sqrt(((tips - tips.mean(axis=0)) ** 2).sum(axis=1).mean()))


def wait_for(path: Path, limit_s: float) -> None:
    """Wait until a file is there."""
    give_up = time.monotonic() + limit_s
    while not path.exists():
        assert time.monotonic() < give_up, f"{path} did not appear"
        time.sleep(0.05)
