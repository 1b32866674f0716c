"""Computes a bench's flight before its clock starts, or takes it from the user's cache."""

import contextlib
import hashlib
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

import sim_bus.bench
import sim_bus.camera
import sim_bus.wing
from avionics.cache import cache_folder
from avionics.records import Truth
from sim_bus.bench.bench import Bench
from sim_bus.bench.prepared import ROW_NS, Prepared
from sim_bus.buses.factory import generator
from sim_bus.buses.faults import FaultPlan
from sim_bus.camera.strip import Still, Strip
from sim_bus.wing.build import make_wing
from sim_bus.wing.motion import PodMotion
from sim_bus.wing.sim_wing import BLOCK_S

# Half a gigabyte of memory with two pods and a camera of 30 frames/s.
LONGEST_S: Final = 600.0
# A flight of a minute takes about 40 MB.
KEPT_FLIGHTS: Final = 8
Progress = Callable[[float, float], None]


def prepare(bench: Bench, seconds: float, progress: Progress) -> Prepared:
    """Let the bench play the first seconds of its scenario back; what follows it computes.

    Parameters
    ----------
    bench : Bench
        The bench, at rest.
    seconds : float
        How much; at most ``LONGEST_S``.
    progress : callable
        Called with the seconds that are done and those that are wanted; not at all if the flight
        is in the cache. What it raises ends the preparation.

    Returns
    -------
    Prepared
        What is played.
    """
    blocks = max(2, int(np.ceil(round(min(seconds, LONGEST_S) / BLOCK_S, 6))))
    path = _path(bench, blocks)
    found = _load(path)
    if found is None:
        found = _compute(bench, blocks, progress)
        _save(found, path)
    bench.play(found)
    return found


def _compute(bench: Bench, blocks: int, progress: Progress) -> Prepared:
    scenario = bench.scenario
    wing = make_wing(bench.config, scenario, rng=generator(bench.seed, "wing"))
    eye = None if bench.shown is None else bench.make_camera(wing, FaultPlan(), start_ns=0)
    frame_ns = 0.0 if bench.shown is None else 1e9 / bench.shown.fps
    pods = {pod.name: PodMotion(wing, pod) for pod in bench.config.pods if pod.name in bench.chips}
    truth_ns = round(1e9 / scenario.truth_hz)
    tables: dict[str, list[NDArray[np.float32]]] = {name: [] for name in pods}
    truths: list[Truth] = []
    stills: list[Still] = []
    for block in range(blocks):
        stop_ns = round((block + 1) * BLOCK_S * 1e9)
        times = np.arange(round(block * BLOCK_S * 1e9), stop_ns, ROW_NS, dtype=np.int64)
        if block == blocks - 1:
            times = np.append(times, stop_ns)
        for name, motion in pods.items():
            attitudes = motion.attitudes(times).reshape(-1, 9)
            tables[name].append(np.hstack([*motion.sense(times), attitudes]).astype(np.float32))
        while len(truths) * truth_ns <= stop_ns:
            truths.append(wing.truth(len(truths) * truth_ns))
        while eye is not None and round(len(stills) * frame_ns) < stop_ns:
            stills.append(eye.still(len(stills)))
        progress((block + 1) * BLOCK_S, blocks * BLOCK_S)
    wing.compute_until(round(blocks * BLOCK_S * 1e9))
    tail_number, tail = wing.last_blocks()
    return Prepared(
        end_ns=round(blocks * BLOCK_S * 1e9),
        motion={name: np.concatenate(parts) for name, parts in tables.items()},
        truth_ns=truth_ns,
        markers_m=np.stack([truth.marker_in_body_m for truth in truths]),
        line_m=np.stack([_known(truth.line_in_body_m) for truth in truths]),
        angles_rad=np.stack([_angles(truth) for truth in truths]),
        tail_number=tail_number,
        tail=tail,
        strip=Strip.of(stills) if stills else None,
    )


def _angles(truth: Truth) -> NDArray[np.float64]:
    return np.stack([_known(angle) for angle in (truth.phi_rad, truth.theta_rad, truth.psi_rad)])


def _known(array: NDArray[np.float64] | None) -> NDArray[np.float64]:
    assert array is not None  # motion capture may lack it, the simulated wing never does
    return array


def _path(bench: Bench, blocks: int) -> Path | None:
    """Name the flight's file by all that it depends on, the code included; None: no cache."""
    folder = cache_folder("flights")
    if folder is None:
        return None
    config, scenario = bench.config, bench.scenario
    used = {
        "blocks": blocks,
        "seed": bench.seed,
        "numpy": np.__version__,
        "scenario": scenario.model_dump(
            mode="json", exclude={"name", "duration_s", "faults", "imu", "picture"}
        ),
        "wing": config.wing.model_dump(mode="json"),
        "pods": [
            pod.model_dump(mode="json", exclude={"link", "chip"})
            for pod in config.pods
            if pod.name in bench.chips
        ],
        "markers": [m.model_dump(mode="json") for m in (*config.markers, *config.truth_markers)],
        "camera": bench.shown and bench.shown.model_dump(mode="json", exclude={"source"}),
        "look": bench.shown and bench.look.model_dump(mode="json"),
    }
    digest = hashlib.sha256(json.dumps(used, sort_keys=True).encode())
    for package in (sim_bus.wing, sim_bus.camera, sim_bus.bench):
        for file in sorted(Path(package.__path__[0]).glob("*.py")):
            digest.update(file.read_bytes())
    return folder / f"{scenario.name}-{digest.hexdigest()[:16]}.npz"


def _load(path: Path | None) -> Prepared | None:
    if path is None:
        return None
    try:
        found = Prepared.load(path)
        os.utime(path)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None
    return found


def _save(prepared: Prepared, path: Path | None) -> None:
    """Keep a flight for the next time; without room or leave it is computed again then."""
    if path is None:
        return
    with contextlib.suppress(OSError):
        prepared.save(path)
        by_age = sorted(path.parent.glob("*.npz"), key=lambda file: file.stat().st_mtime)
        for file in by_age[:-KEPT_FLIGHTS]:
            file.unlink(missing_ok=True)
