"""The trackers on pictures of a real wing: what they find, whether they swap LEDs, what they cost.

    python benchmarks/trackers.py [NAME ...]

Pictures: tmkhoyan/autoLabelTool (BSD-3), 70 frames of a wing with seven groups of three LEDs in the
upper row, the innermost 13 px apart and the outermost 8 px. There is no wing model here: the
prediction is where each LED was last found. Places are compared with plain centroids of the spots.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from avionics.config import Camera, Config, Marker, Wing
from avionics.records import MarkerPrediction
from avionics.tracking import make_tracker
from drivers.samples import Frame

PICTURES = Path(__file__).resolve().parents[2] / "shared/data/real/led-images"
COUNT, LABELLED = 70, 8
FRAME_NS = 33_333_333
REACH_PX = 3.0
LEVEL = 128
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """What a tracker did with all pictures."""

    found: int
    of: int
    swapped: int
    rms_px: float
    label_px: float
    ms_per_frame: float


def pictures() -> list[NDArray[np.uint8]]:
    """Return the pictures in their order, BGR."""
    return [np.asarray(cv2.imread(str(PICTURES / f"LE_{i}.jpg"))) for i in range(1, COUNT + 1)]


def labels() -> list[FloatArray]:
    """Return the hand-made pixels of the seven groups in the first frames."""
    store = cv2.FileStorage(str(PICTURES / "labels.yml"), cv2.FILE_STORAGE_READ)
    return [store.getNode(f"p{i}").mat().astype(float) for i in range(LABELLED)]


def spots(picture: NDArray[np.uint8]) -> FloatArray:
    """Return plain centroids of the bright spots, (N, 2), left to right."""
    gray = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    count, label, stats, _ = cv2.connectedComponentsWithStats((gray > LEVEL).astype(np.uint8))
    found = []
    for k in range(1, count):
        if stats[k, cv2.CC_STAT_AREA] >= 4:
            rows, columns = np.nonzero(label == k)
            weight = gray[rows, columns].astype(float)
            found.append((columns @ weight / weight.sum(), rows @ weight / weight.sum()))
    return np.array(sorted(found))


def start(picture: NDArray[np.uint8], groups: FloatArray) -> FloatArray:
    """Return the LEDs of the labelled groups, shape (7, 3, 2), left to right."""
    every, triplets = spots(picture), []
    for group in groups:
        row = every[np.abs(every[:, 1] - group[1]) < 8]
        near = row[np.argsort(np.linalg.norm(row - group, axis=1))[:3]]
        triplets.append(near[np.argsort(near[:, 0])])
    return np.array(triplets)


def config_of(count: int, tracker: str, shape: tuple[int, ...]) -> Config:
    """Return a configuration with so many markers before a camera of that picture."""
    height, width = shape[:2]
    camera = Camera(
        width_px=width,
        height_px=height,
        f_x_px=900,
        f_y_px=900,
        c_x_px=width / 2,
        c_y_px=height / 2,
    )
    return Config.model_validate(
        {
            "wing": Wing(span_m=2.0).model_dump(),
            "markers": [Marker(id=k, s_m=0.05 * (k + 1)).model_dump() for k in range(count)],
            "camera": camera.model_dump(),
            "tracker": {"name": tracker},
        }
    )


def run(name: str, *, middle_only: bool) -> Score:
    """Track all LEDs, or the middle one of each group, through all pictures."""
    shown, marked = pictures(), labels()
    leds = start(shown[0], marked[0])
    last = leds[:, 1] if middle_only else leds.reshape(-1, 2)
    tracker = make_tracker(config_of(len(last), name, shown[0].shape))
    spread = np.broadcast_to(REACH_PX**2 * np.eye(2), (len(last), 2, 2))
    found = swapped = 0
    misses: list[float] = []
    from_label: list[float] = []
    busy_s = 0.0
    for i, picture in enumerate(shown):
        t_ns = i * FRAME_NS
        prediction = MarkerPrediction(t_ns, last.copy(), spread.copy(), last[None].copy())
        began_s = time.process_time()
        tracks = tracker.update(Frame(t_ns, "real", i, picture), prediction)
        busy_s += time.process_time() - began_s
        found += int(tracks.found.sum())
        apart = np.linalg.norm(tracks.pixel[tracks.found][:, None] - spots(picture), axis=-1)
        misses += apart.min(axis=1).tolist()
        last = np.where(tracks.found[:, None], tracks.pixel, last)
        # The LEDs of a row never overtake each other.
        swapped += int((np.diff(last[:, 0]) < 4.0).any())
        if i < LABELLED:
            middles = tracks.pixel if middle_only else tracks.pixel[1::3]
            from_label += np.linalg.norm(middles - marked[i], axis=1).tolist()
    return Score(
        found,
        len(last) * COUNT,
        swapped,
        float(np.sqrt(np.mean(np.square(misses)) / 2)),
        float(np.nanmedian(from_label)),
        1e3 * busy_s / COUNT,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=["led", "kcf", "csrt"])
    if not PICTURES.exists():
        raise SystemExit(f"{PICTURES.name}: the recorded pictures are not here")
    names = parser.parse_args().names
    for middle_only in (False, True):
        base = None
        for name in names:
            score = run(name, middle_only=middle_only)
            base = base or score.ms_per_frame
            print(
                f"{name:5s} {'7 middle' if middle_only else 'all 21'} LEDs: found {score.found} of "
                f"{score.of}, frames with a swap {score.swapped}, {score.rms_px:.2f} px per axis "
                f"from plain centroids, {score.label_px:.1f} px from the labels (median), "
                f"{score.ms_per_frame:.1f} ms of CPU a frame ({score.ms_per_frame / base:.1f} x "
                f"{names[0]})"
            )


if __name__ == "__main__":
    main()
