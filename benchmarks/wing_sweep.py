"""The recorded sweep against its targets: accuracy, trackers, speed.

    python benchmarks/wing_sweep.py [--csrt] [--kcf] [--keep DIR]

Imports and calibrates ../shared/data/wing-sweep, replays it in the general and the paper's form
from the video, and scores. CSRT takes about a quarter of an hour.
"""

import argparse
import csv
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from avionics.analysis.evaluate import evaluate
from avionics.analysis.flight import read_flight
from avionics.analysis.replay import replay
from avionics.config.load import apply_overrides, parse_config
from avionics.datasets.importer import import_set
from avionics.flight.pipelines import Pipelines
from avionics.recording import LogReader
from drivers.samples import ImuSample

SOURCE = Path(__file__).resolve().parents[2] / "shared/data/wing-sweep"
FLIGHT_S, FRAMES, MARKERS = 131.0, 3914, 6
TARGETS = {
    ("general", "rg"): "slope >= +3",
    ("general", "crg"): "median <= 1.0, p95 <= 1.8",
    ("general", "filtered"): "median <= 0.9, p95 <= 1.6, max <= 5, tip <= 3 mm",
    ("paper", "crg"): "median <= 4.5, p95 <= 8, |slope| <= 1",
    ("csrt", "filtered"): "median <= 1.2",
    ("kcf", "filtered"): "median <= 1.2",
}


def cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def show(form: str, log: Path) -> None:
    figures = evaluate(read_flight(log)).to_json_dict()
    for kind in ("rg", "crg", "filtered"):
        eq17, odd = figures[kind]["eq17_px"], figures[kind]["eq17_px_odd_blocks"]
        print(
            f"{form:8s}{kind:9s} median {eq17['median']:6.2f}  p95 {eq17['p95']:6.2f}  "
            f"max {eq17['max']:6.2f}  slope {eq17['slope_per_min']:+6.2f} px/min  "
            f"tip {figures[kind]['tip_mm']['rmse']:7.2f} mm  "
            f"odd blocks {odd['median']:5.2f} / {odd['p95']:5.2f}"
            f"   target {TARGETS.get((form, kind), '-')}"
        )


def tell_per_marker(name: str, busy_s: float) -> None:
    per_marker_ms = 1e3 * busy_s / (FRAMES * MARKERS)
    print(f"{name}: {per_marker_ms:.2f} ms of CPU per marker, filter included")


class Nowhere:
    """A sink that keeps nothing."""

    def write(self, record: object, arrival_ns: int) -> None:
        """Drop a record."""


def fuse(log: Path, overrides: tuple[str, ...]) -> None:
    """Read a log and fuse it; nothing is written."""
    reader = LogReader(log)
    described = apply_overrides(reader.config.model_dump(mode="json"), overrides)
    pipeline = Pipelines(parse_config(described, origin="benchmark"), Nowhere())
    for message in reader.messages(("/imu/*", "/camera/*/tracks")):
        if isinstance(message.record, ImuSample):
            pipeline.on_imu(message.record, message.arrival_ns)
        else:
            pipeline.on_tracks(message.record, message.arrival_ns)
    pipeline.close()


def score_tracks(name: str, log: Path) -> None:
    truth = {}
    with (SOURCE / "markers_px.csv").open() as stream:
        for row in csv.DictReader(stream):
            if row["visible"] == "1":
                place = (float(row["u"]), float(row["v"]))
                truth[int(row["frame"]), int(row["marker"])] = place
    found = wrong = 0
    squares = []
    tracks = read_flight(log, ["/camera/*/tracks"]).tracks
    for row, k in np.argwhere(tracks.found):
        place = truth.get((int(tracks.frame_index[row]), int(k)))
        if place is None or np.hypot(*(tracks.pixel[row, k] - place)) > 5:
            wrong += 1
            continue
        found += 1
        squares.append(float(((tracks.pixel[row, k] - place) ** 2).sum()))
    rms = np.sqrt(np.mean(squares) / 2)
    print(
        f"{name}: RMS {rms:.3f} px per axis (target <= 0.3), found {found} of {len(truth)} "
        f"visible, {wrong} found where no visible marker is"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("csrt", "kcf"):
        parser.add_argument(f"--{name}", action="store_true")
    parser.add_argument("--keep", type=Path, help="folder for the logs")
    arguments = parser.parse_args()
    if not SOURCE.is_dir():
        print("skipped: ../shared/data/wing-sweep is not beside the project")
        return
    with tempfile.TemporaryDirectory() as made:
        folder = arguments.keep or Path(made)
        folder.mkdir(exist_ok=True, parents=True)
        log = folder / "imported.mcap"
        summary = import_set(SOURCE, log, calibrate=True, force=True)
        pose = summary.calibration.pose
        print(
            f"calibration: {pose.rms_px:.2f} px per axis, "
            f"{summary.calibration.measurements} measurements"
        )
        flown = folder / "general.mcap"
        start_s = cpu_s()
        replay(log, flown, images=False, force=True)
        tell_per_marker("led", cpu_s() - start_s)
        show("general", flown)
        score_tracks("led", flown)
        paper = folder / "paper.mcap"
        for form, output, target in (("general", folder / "fused.mcap", 8), ("paper", paper, 25)):
            choice = (f"estimator.form={form}",)
            start_s = time.perf_counter()
            replay(flown, output, overrides=choice, images=False, force=True)
            whole_s, start_s = time.perf_counter() - start_s, cpu_s()
            fuse(flown, choice)
            print(
                f"{form}: read and fused {FLIGHT_S / (cpu_s() - start_s):.1f}x real time (CPU), "
                f"written too, on two cores {FLIGHT_S / whole_s:.1f}x (wall) (target >= {target}x)"
            )
        show("paper", paper)
        for name in ("kcf", "csrt"):
            if getattr(arguments, name):
                start_s = cpu_s()
                other = folder / f"{name}.mcap"
                replay(log, other, tracker=name, retrack=True, images=False, force=True)
                tell_per_marker(name, cpu_s() - start_s)
                show(name, other)
                score_tracks(name, other)


if __name__ == "__main__":
    main()
