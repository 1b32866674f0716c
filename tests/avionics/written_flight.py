"""A written flight: a wing that swings at 1 Hz, with all that a log may hold, and no simulator."""

from pathlib import Path

import numpy as np

from avionics.config import Config
from avionics.config.load import default_config_text, parse_config
from avionics.flight.filter_setup import pinhole_from_config
from avionics.recording import LogWriter
from avionics.records import Event, Health, MarkerTracks, Truth, WingShapeEstimate
from avionics.topics import Record
from drivers.samples import Frame, ImuSample

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib

SPAN_M, STATIONS = 1.5, 16
LENGTH_S = 9.0


def make_config() -> Config:
    tables = tomllib.loads(default_config_text())
    tables["truth_markers"] = tables["markers"]
    return parse_config(tables, origin="test")


CONFIG = make_config()


def line_m(t_s: float, drift: float = 0.0) -> np.ndarray:
    """A wing that swings at 1 Hz; ``drift`` bends it further."""
    s = np.linspace(0.0, SPAN_M, STATIONS)
    bend = 0.2 * np.sin(2 * np.pi * t_s) + drift
    return np.column_stack([np.zeros(STATIONS), s, bend * s**2])


def markers_m(t_s: float, drift: float = 0.0) -> np.ndarray:
    line = line_m(t_s, drift)
    s = np.linspace(0.0, SPAN_M, STATIONS)
    return np.array(
        [
            [np.interp(m.s_m, s, line[:, axis]) + (m.x_m, 0.0, m.z_m)[axis] for axis in range(3)]
            for m in CONFIG.markers
        ]
    )


def pixels(t_s: float, drift: float = 0.0) -> np.ndarray:
    assert CONFIG.camera is not None
    return pinhole_from_config(CONFIG.camera).project(markers_m(t_s, drift))


def estimate(t_ns: int, kind: str) -> WingShapeEstimate:
    t_s = t_ns * 1e-9
    drift = 0.01 * t_s if kind == "rg" else 0.001
    one = np.array([0.1])
    return WingShapeEstimate(
        t_ns, "right", kind, "quarter-sine/1+1+1", one, one, one, one, one, one,
        np.full((2, 3), 0.002), np.full((2, 3), 0.001), line_m(t_s, drift), np.full(3, 0.004),
        pixels(t_s, drift), np.full((6, 2), 0.2), 1.1, np.ones(6, bool),
    )  # fmt: skip


def flight_records(
    *, with_camera: bool = True, with_truth: bool = True
) -> list[tuple[int, Record]]:
    rng = np.random.default_rng(5)
    items: list[tuple[int, Record]] = []
    for number in range(round(LENGTH_S * 100)):
        t_ns = number * 10_000_000
        for pod in "01":
            items.append((t_ns, ImuSample(t_ns, pod, number, rng.normal(size=3) * 0.1)))
        items += [(t_ns, estimate(t_ns, kind)) for kind in ("rg", "crg")]
        if with_truth and number % 2 == 0:
            t_s = t_ns * 1e-9
            truth = Truth(t_ns, "right", "sim", markers_m(t_s), line_m(t_s))
            items.append((t_ns, truth))
        if with_camera and number % 10 == 5:
            pixel = pixels(t_ns * 1e-9) + rng.normal(size=(6, 2)) * 0.3
            found = np.array([True] * 5 + [number < 400])
            index = number // 10
            image = np.full((480, 640), index, np.uint8)
            items += [
                (t_ns + 40_000_000, Frame(t_ns, "root", index, image)),
                (
                    t_ns + 40_000_000,
                    MarkerTracks(t_ns, "root", index, pixel, np.full(6, 0.3), found, "led"),
                ),
                (t_ns + 40_000_000, estimate(t_ns, "filtered")),
            ]
    end_ns = round(LENGTH_S * 1e9)
    items.append((end_ns, Health(end_ns, "can0", {"frames": 900, "bus_off": 1})))
    items.append((end_ns, Event(3_000_000_000, "pod 1", "warning", "silent <0.2 s> & back")))
    return items


def write(path: Path, items: list[tuple[int, Record]]) -> Path:
    with LogWriter(path, CONFIG, metadata={"command": "sim"}) as writer:
        for arrival_ns, record in items:
            writer.write(record, arrival_ns)
    return path
