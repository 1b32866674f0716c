"""A recorded data set of a simulated flight, in the format of ``wing-sweep``.

Raw counts, a compressed video, motion capture with its own errors, chessboards, a nominal camera
that is wrong: what a laboratory would hand over, with the truth beside it.
"""

import csv
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from avionics.config import Camera, Config, Pod
from avionics.errors import DataSetError
from sim_bus.buses.factory import generator
from sim_bus.camera.chessboard import chessboards
from sim_bus.camera.sim_camera import SimCamera
from sim_bus.chip.sensing import ImuErrors, Latch, Sensing
from sim_bus.clock import SimClock
from sim_bus.dataset_yaml import LAB_FROM_BODY, LAB_ORIGIN_M, description
from sim_bus.rig import imu_grade, make_faults
from sim_bus.wing.build import make_wing
from sim_bus.wing.motion import PodMotion
from sim_bus.wing.scenario import Scenario
from sim_bus.wing.sim_wing import SimWing

FloatArray = NDArray[np.float64]
EPOCH_NS = 1_700_000_000_000_000_000
GYRO_LSB_PER_DPS, ACC_LSB_PER_M_S2, MAG_LSB_PER_T = 16.0, 100.0, 16e6


@dataclass(frozen=True, slots=True)
class Blemishes:
    """What is imperfect about a recording.

    Attributes
    ----------
    jitter_s : float
        One-sigma of the read times about the sample times.
    late_s : float
        Mean of an exponential lateness on top: a recorder that is always late.
    dropped : float
        Share of IMU rows never recorded.
    gaps : int
        Longer gaps of 0.05 to 0.15 s, in each pod.
    lost : dict of int to (float, float)
        From when to when a pod is silent, s.
    mocap_offset_m, mocap_noise_m : float
        One-sigma of a marker's constant error, and of its noise, per axis.
    mocap_missing : float
        Share of mocap marker samples missing, in bursts.
    chessboards : int
        Number of calibration pictures.
    fourcc : str
        Video codec.
    """

    jitter_s: float = 5e-4
    late_s: float = 0.0
    dropped: float = 0.006
    gaps: int = 2
    lost: dict[int, tuple[float, float]] = field(default_factory=dict)
    mocap_offset_m: float = 4e-4
    mocap_noise_m: float = 1.5e-4
    mocap_missing: float = 0.01
    chessboards: int = 16
    fourcc: str = "mp4v"


def write_data_set(
    folder: Path,
    config: Config,
    scenario: Scenario,
    *,
    nominal: Camera,
    blemishes: Blemishes | None = None,
    seed: int = 0,
) -> None:
    """Fly a scenario and write it as a data set.

    Parameters
    ----------
    folder : Path
        Where to; made if need be.
    config : Config
        The wing as it truly is: pods, markers, truth markers, camera.
    scenario : Scenario
        What happens.
    nominal : Camera
        The camera as ``wing.yaml`` describes it.
    blemishes : Blemishes
        What is imperfect about the recording.
    seed : int
        Of every random draw.

    Raises
    ------
    DataSetError
        If the configuration has no camera, or this OpenCV cannot write the video.
    """
    spoilt = Blemishes() if blemishes is None else blemishes
    if config.camera is None:
        msg = f"{folder}: a data set needs a camera in the configuration"
        raise DataSetError(msg)
    folder.mkdir(parents=True, exist_ok=True)
    faults = make_faults(scenario, EPOCH_NS, generator(seed, "faults"))

    wing = make_wing(
        config, scenario, rng=generator(seed, "wing"), epoch_ns=EPOCH_NS, keep_s=np.inf
    )
    flight = _Flight(config, scenario, wing, spoilt, seed)
    _write_imu(folder / "imu.csv", flight)
    camera = SimCamera(
        config.camera, wing, config.markers, SimClock(EPOCH_NS), look=scenario.picture,
        rng=generator(seed, "camera"), faults=faults,
        start_ns=EPOCH_NS + round(0.5e9 / config.camera.fps),
    )  # fmt: skip
    _write_video(folder, config.camera, camera, _until(scenario), spoilt.fourcc)
    _write_mocap(folder / "mocap.csv", flight)
    _write_truth(folder, scenario, wing)
    boards = folder / "chessboard"
    boards.mkdir(exist_ok=True)
    for number, image in enumerate(
        chessboards(config.camera, spoilt.chessboards, generator(seed, "chessboard"))
    ):
        cv2.imwrite(str(boards / f"{number:02d}.png"), image)
    (folder / "wing.yaml").write_text(
        yaml.safe_dump(description(config, scenario, nominal), sort_keys=False), encoding="utf-8"
    )


@dataclass(frozen=True, slots=True)
class _Flight:
    """What the recorders of one flight share."""

    config: Config
    scenario: Scenario
    wing: SimWing
    spoilt: Blemishes
    seed: int


def _until(scenario: Scenario) -> int:
    return EPOCH_NS + round(scenario.duration_s * 1e9)


def _write_rows(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def _counts(latch: Latch) -> list[int]:
    scaled = np.concatenate([
        np.degrees(latch.rate_rad_s) * GYRO_LSB_PER_DPS,
        latch.specific_force_m_s2 * ACC_LSB_PER_M_S2,
        latch.flux_t * MAG_LSB_PER_T,
    ])  # fmt: skip
    return [int(c) for c in np.clip(np.rint(scaled), -32768, 32767)]


def _write_imu(path: Path, flight: _Flight) -> None:
    recorded = [row for pod in flight.config.pods for row in _imu_rows(pod, flight)]
    recorded.sort(key=lambda row: row[0])
    header = ["t_ns", "pod", *(f"{kind}{axis}" for kind in "gam" for axis in "xyz")]
    _write_rows(path, header, recorded)


def _imu_rows(pod: Pod, flight: _Flight) -> list[list[int]]:
    scenario, spoilt = flight.scenario, flight.spoilt
    rng = generator(flight.seed, f"pod {pod.name}")
    errors = ImuErrors.draw(imu_grade(scenario.imu), rng)
    sensing = Sensing(PodMotion(flight.wing, pod), errors, rng, EPOCH_NS)
    sensing.configure(float(pod.chip.gyro_bandwidth_hz), 62.5)
    until_ns = _until(scenario)
    starts = rng.uniform(0, scenario.duration_s, spoilt.gaps)
    gaps = [(a, a + rng.uniform(0.05, 0.15)) for a in starts]
    gaps += [spoilt.lost[pod.id]] if pod.id in spoilt.lost else []
    rows, last_ns = [], 0
    index = sensing.latch_index(EPOCH_NS) + 1
    while (t_ns := sensing.latch_time_ns(index)) < until_ns:
        latch = sensing.latch(index)
        index += 1
        late_s = spoilt.jitter_s * rng.standard_normal() + spoilt.late_s * rng.exponential()
        read_ns = max(t_ns + round(late_s * 1e9), last_ns + 100_000)
        t_s = (t_ns - EPOCH_NS) * 1e-9
        if rng.random() < spoilt.dropped or any(a <= t_s < b for a, b in gaps):
            continue
        last_ns = read_ns
        rows.append([read_ns, pod.id, *_counts(latch)])
    return rows


def _write_video(
    folder: Path, camera: Camera, source: SimCamera, until_ns: int, fourcc: str
) -> None:
    size = (camera.width_px, camera.height_px)
    path = folder / "camera.mkv"
    writer = cv2.VideoWriter(
        str(path), cv2.VideoWriter.fourcc(*fourcc), camera.fps, size, isColor=False
    )
    if not writer.isOpened():
        msg = f"{path}: this OpenCV cannot write {fourcc} video; try MJPG or FFV1"
        raise DataSetError(msg)
    frames: list[list[int]] = []
    truth: list[list[str]] = []
    for number, exposure in enumerate(source.take_exposures(until_ns)):
        frame = source.frame(exposure)
        writer.write(frame.image)
        frames.append([number, frame.t_ns, exposure.arrival_ns])
        pixel, visible = source.marker_pixels(exposure.t_ns)
        truth += [
            [str(number), str(m), f"{u:.3f}", f"{v:.3f}", str(int(seen))]
            for m, (u, v), seen in zip(source.marker_ids, pixel, visible, strict=True)
        ]
    writer.release()
    _write_rows(folder / "frames.csv", ["frame", "t_exposure_ns", "t_arrival_ns"], frames)
    _write_rows(folder / "markers_px.csv", ["frame", "marker", "u", "v", "visible"], truth)


def _write_mocap(path: Path, flight: _Flight) -> None:
    config, spoilt, rng = flight.config, flight.spoilt, generator(flight.seed, "mocap")
    markers = config.truth_markers or config.markers
    offset = spoilt.mocap_offset_m * rng.standard_normal((len(markers), 3))
    missing_until = np.zeros(len(markers))
    rows: list[list[str]] = []
    for t_s in np.arange(0.0, flight.scenario.duration_s, 0.02):
        t_ns = EPOCH_NS + round((t_s + 1e-4 * rng.standard_normal()) * 1e9)
        points = flight.wing.points(np.array([t_ns], dtype=np.int64), markers)[0] + offset
        points += spoilt.mocap_noise_m * rng.standard_normal(points.shape)
        lab = points @ LAB_FROM_BODY.T + LAB_ORIGIN_M
        # Bursts of a fifth of a second on average.
        starts = rng.random(len(markers)) < spoilt.mocap_missing / 10
        missing_until[starts] = t_s + rng.exponential(0.2, int(starts.sum()))
        row = [str(t_ns)]
        for k, point in enumerate(lab):
            row += [""] * 3 if t_s < missing_until[k] else [f"{c:.4f}" for c in point]
        rows.append(row)
    header = ["t_ns", *(f"m{m.id}_{axis}" for m in markers for axis in "xyz")]
    _write_rows(path, header, rows)


def _write_truth(folder: Path, scenario: Scenario, wing: SimWing) -> None:
    """Write the tip of the reference line at 100 Hz, body axes: for scoring only."""
    tip = np.array([wing.beam.span_m])
    rows = []
    for k in range(round(scenario.duration_s * 100)):
        t_ns = EPOCH_NS + k * 10_000_000
        point = wing.stations(np.array([t_ns], dtype=np.int64), tip).r_in_body_m[0, 0]
        rows.append([str(t_ns), *(f"{c:.6f}" for c in point)])
    _write_rows(folder / "truth_tip.csv", ["t_ns", "x_m", "y_m", "z_m"], rows)
