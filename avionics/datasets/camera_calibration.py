"""The camera of a data set, calibrated from the set's own chessboards, video and motion capture."""

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from avionics.analysis.interpolation import between
from avionics.calibration.extrinsics import (
    LENS,
    NOMINAL_LENS_SIGMA,
    POSE,
    Extrinsics,
    MarkerMeasurements,
    calibrate_pose,
    camera_of,
)
from avionics.calibration.intrinsics import Intrinsics, calibrate_lens
from avionics.config import Camera, Config
from avionics.datasets.data_set import DataSet, MocapTable
from avionics.errors import DataSetError
from avionics.records import FloatArray
from avionics.tracking.assignment import NONE, assign, common_shift
from avionics.tracking.blobs import find_blobs
from avionics.tracking.centroid import refine
from avionics.wse.pinhole import Pinhole

MOST_INSTANTS = 40
BLOCK_NS = 10_000_000_000
REACHES_PX = ((90.0, 14.0), (12.0, 5.0), (6.0, 2.5), (6.0, 2.5))
"""Common shift searched, and deviation from it allowed, pass by pass."""
SPEED_STEP_NS = 4_000_000
SAME_PLACE_M = 2e-3
SURE_SIGMAS = 4.0
LEAST_OFFSET_S = 5e-4
PLAUSIBLE = 8.0


@dataclass(slots=True)
class SetCalibration:
    """What was found, and what it rests on.

    Attributes
    ----------
    camera : Camera
        The calibrated camera.
    lens : Intrinsics or None
    pose : Extrinsics or None
    instants : int
        Pictures used for the pose.
    measurements : int
        Markers measured in them.
    notes : list of str
        What could not be calibrated and why.
    """

    camera: Camera
    lens: Intrinsics | None = None
    pose: Extrinsics | None = None
    instants: int = 0
    measurements: int = 0
    notes: list[str] = field(default_factory=list)

    def to_json_dict(self) -> dict[str, Any]:
        """Return values, one-sigmas and residuals for the log."""
        found: dict[str, Any] = {"camera": self.camera.model_dump(mode="json"), "notes": self.notes}
        if self.lens is not None:
            found["lens"] = {
                "values": self.lens.values, "sigma": self.lens.sigma,
                "rms_px": self.lens.rms_px, "boards": self.lens.boards,
                "refused": list(self.lens.refused),
            }  # fmt: skip
        if self.pose is not None:
            found["pose"] = {
                "values": self.pose.values, "sigma": self.pose.sigma,
                "rms_px": self.pose.rms_px, "instants": self.instants,
                "measurements": self.measurements,
                "marker_offset_mm": self.pose.marker_offset_mm.tolist(),
            }  # fmt: skip
        return found


@dataclass(frozen=True, slots=True, eq=False)
class _Instant:
    row: int
    r_in_body_m: FloatArray
    speed_m_s: FloatArray


def calibrate_set(data: DataSet, config: Config) -> SetCalibration:
    """Calibrate the camera of a data set as far as the set allows.

    Parameters
    ----------
    data : DataSet
        The set.
    config : Config
        Its configuration with the nominal camera.

    Raises
    ------
    DataSetError
        If the set has no camera.
    """
    if config.camera is None or data.wing.camera is None:
        msg = f"{data.directory}: wing.yaml describes no camera; there is nothing to calibrate"
        raise DataSetError(msg)
    result = SetCalibration(config.camera)
    _lens(data, result)
    _pose(data, config, result)
    return result


def _lens(data: DataSet, result: SetCalibration) -> None:
    description = data.wing.camera
    assert description is not None
    if description.chessboard is None or not data.chessboards:
        result.notes.append("no chessboard pictures: lens from motion capture alone")
        return
    pictures: list[tuple[str, NDArray[np.uint8]]] = []
    for path in data.chessboards:
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if picture is None:
            data.skips.add(f"chessboard/{path.name}", "no readable picture")
        else:
            pictures.append((path.name, np.asarray(picture, dtype=np.uint8)))
    try:
        lens = calibrate_lens(
            pictures,
            description.chessboard.inner_corners,
            description.chessboard.square_m,
            (description.width, description.height),
        )
    except DataSetError as error:
        result.notes.append(f"{error}: lens from motion capture alone")
        return
    result.lens = lens
    for why in lens.refused:
        data.skips.add("chessboard", why)
    result.camera = result.camera.model_copy(update=lens.values)


def _pose(data: DataSet, config: Config, result: SetCalibration) -> None:
    if data.mocap is None or data.frames is None:
        what = "motion capture" if data.mocap is None else "video"
        result.notes.append(f"no {what}: the camera's pose stays nominal")
        return
    pairs = _coincident(config)
    if len(pairs) < 2:
        result.notes.append("no LED stands where a motion-capture marker does: pose stays nominal")
        return
    columns = [marker for _, marker in pairs]
    rows = _choose(data.mocap, data.frames.t_exposure_ns, columns)
    spots = _spots_of(data, set(rows.tolist()))
    nominal = _values(result.camera)
    values, offset_s = nominal, 0.0
    sigma = NOMINAL_LENS_SIGMA if result.lens is None else result.lens.sigma
    size = (result.camera.width_px, result.camera.height_px)
    leds = [led for led, _ in pairs]
    try:
        for shift_px, reach_px in REACHES_PX:
            # Positions are taken where the last pass put the camera's clock: markers do not move
            # on straight lines for longer than a few milliseconds.
            instants = _instants(data, rows, columns, offset_s)
            measurements = _associate(
                instants,
                spots,
                leds,
                camera_of(values, *size),
                shift_px=shift_px,
                reach_px=reach_px,
            )
            pose = calibrate_pose(measurements, nominal, sigma, size)
            values = pose.values
            offset_s += values["time_offset_s"]
    except DataSetError as error:
        result.notes.append(f"{error}: the camera's pose stays nominal")
        return
    if pose.rms_px > PLAUSIBLE:
        result.notes.append(f"residual {pose.rms_px:.1f} px: the camera's pose stays nominal")
        return
    result.pose, result.measurements = pose, len(measurements)
    result.instants = len(rows)
    pose.values["time_offset_s"] = offset_s
    is_sure = abs(offset_s) > max(LEAST_OFFSET_S, SURE_SIGMAS * pose.sigma["time_offset_s"])
    if is_sure:
        result.notes.append(f"camera stamps {1e3 * offset_s:+.2f} ms from the clock of the rest")
    result.camera = result.camera.model_copy(
        update={
            **{name: pose.values[name] for name in LENS},
            "r_in_body_m": tuple(pose.values[n] for n in POSE[:3]),
            **{name: pose.values[name] for name in POSE[3:]},
            "time_offset_s": offset_s if is_sure else 0.0,
            "calibrated": True,
        }
    )


def _values(camera: Camera) -> dict[str, float]:
    x_m, y_m, z_m = camera.r_in_body_m
    return {
        **{name: float(getattr(camera, name)) for name in (*LENS, *POSE[3:])},
        "x_m": x_m, "y_m": y_m, "z_m": z_m, "time_offset_s": 0.0,
    }  # fmt: skip


def _coincident(config: Config) -> list[tuple[int, int]]:
    """Return pairs of LED and motion-capture marker (by order) that stand at one place."""
    pairs = []
    for i, led in enumerate(config.markers):
        for j, marker in enumerate(config.truth_markers):
            apart = np.array([led.s_m - marker.s_m, led.x_m - marker.x_m, led.z_m - marker.z_m])
            if np.linalg.norm(apart) < SAME_PLACE_M:
                pairs.append((i, j))
                break
    return pairs


def _choose(
    mocap: MocapTable, frame_ns: NDArray[np.int64], columns: list[int]
) -> NDArray[np.int64]:
    """Return at most forty pictures of even 10 s blocks, evenly over the range of deflection."""
    position = between(mocap.t_ns, mocap.marker_m[:, columns], frame_ns)
    block = (frame_ns - frame_ns[0]) // BLOCK_NS
    known = np.isfinite(position[..., 0]).sum(axis=1) >= 2
    rows = np.flatnonzero(known & (block % 2 == 0))
    if not rows.size:
        return rows
    height = np.nanmean(position[rows][..., 2], axis=1)
    ordered = rows[np.argsort(height, kind="stable")]
    bins = np.linspace(height.min(), height.max() + 1e-9, MOST_INSTANTS + 1)
    number = np.digitize(np.sort(height), bins)
    chosen = [ordered[number == b][(number == b).sum() // 2] for b in np.unique(number)]
    return np.array(chosen, dtype=np.int64)


def _instants(
    data: DataSet, rows: NDArray[np.int64], columns: list[int], offset_s: float
) -> list[_Instant]:
    """Return where the markers were, and how fast, in some pictures."""
    assert data.mocap is not None
    assert data.frames is not None
    mocap = data.mocap
    t_ns = data.frames.t_exposure_ns[rows] + round(offset_s * 1e9)
    there, ahead, behind = (
        between(mocap.t_ns, mocap.marker_m[:, columns], t_ns + step)
        for step in (0, SPEED_STEP_NS, -SPEED_STEP_NS)
    )
    speed = np.nan_to_num((ahead - behind) / (2e-9 * SPEED_STEP_NS))
    return [_Instant(int(row), there[i], speed[i]) for i, row in enumerate(rows)]


def _spots_of(data: DataSet, rows: set[int]) -> dict[int, FloatArray]:
    """Return the spots (N, 2) of some pictures, to a part of a pixel."""
    found: dict[int, FloatArray] = {}
    for row, image in data.pictures():
        if row in rows:
            blobs = find_blobs(image)
            places = [
                refine(image, float(u), float(v), float(area))
                for (u, v), area in zip(blobs.pixel, blobs.area_px, strict=True)
            ]
            sharp = [(u, v) for u, v, sigma in places if np.isfinite(sigma)]
            found[row] = np.array(sharp, dtype=np.float64).reshape(-1, 2)
        if len(found) == len(rows):
            break
    return found


def _associate(
    instants: list[_Instant],
    spots: dict[int, FloatArray],
    leds: list[int],
    camera: Pinhole,
    *,
    shift_px: float,
    reach_px: float,
) -> MarkerMeasurements:
    marker: list[int] = []
    rows: list[FloatArray] = []
    for instant in instants:
        found = spots.get(instant.row)
        if found is None or not len(found):
            continue
        expected = np.asarray(camera.project(instant.r_in_body_m), dtype=np.float64)
        shift = common_shift(expected, found, np.full(len(expected), shift_px))
        spread = np.broadcast_to((reach_px / 3) ** 2 * np.eye(2), (len(expected), 2, 2))
        chosen = assign(expected + shift, found, spread, gate=3.0)
        for k in np.flatnonzero(chosen != NONE):
            marker.append(leds[k])
            rows.append(
                np.concatenate([instant.r_in_body_m[k], instant.speed_m_s[k], found[chosen[k]]])
            )
    table = np.array(rows, dtype=np.float64).reshape(-1, 8)
    return MarkerMeasurements(
        np.array(marker, dtype=np.int64), table[:, :3], table[:, 3:6], table[:, 6:]
    )
