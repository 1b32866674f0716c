"""Semi-physical study: a real car drive as carrier, flexure and misalignment added.

The drive's smooth motion is taken as true, as Gong et al. took their van's; master and slave
sensors are simulated on it. The recorded accelerometers are not used: see ``LIMITS``.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, sosfiltfilt

from avionics.errors import DataSetError
from avionics.pos.compiled import Array
from avionics.pos.earth import EQUATOR_RADIUS
from avionics.pos.motion import Start
from avionics.pos.recorded import motion_from_samples
from avionics.pos.study.spec import Spec, load_spec
from avionics.pos.study.tables import LegTable, SegmentTable
from avionics.pos.trajectory import Trajectory, trajectory_from_motion

COLUMNS = (
    "millis", "rollrate", "pitchrate", "yawrate", "speed", "course",
    "latitude", "longitude", "altitude",
)  # fmt: skip
RATE_HZ = 50.0
COURSE_LAG_S = 1.0
"""By how much the receiver's course trails the integrated yaw rate: least squares on the drive."""
COURSE_WINDOW_S = 10.0
MOVING_M_S = 2.0
ATTITUDE_HZ = 5.0
DRIFT_HZ = 0.05
SPEED_HZ = 0.5
HEIGHT_HZ = 0.02
LIMITS = (
    "The gyros are a phone's: 50 Hz, a few hundred deg/h of noise per root hertz, against "
    "0.01 deg/h of the master that is assumed. They show how the car moved, not what a master's "
    "sensors would have put out, so the sensors are simulated on the recorded motion.",
    "Above 5 Hz the record is engine, mount and noise; it is cut off, so vibration is missing.",
    "Roll and pitch in the file are accelerometer tilts, wrong while the car accelerates. Only "
    "the gyros' motion above 0.05 Hz is kept: the road's own slope and bank are missing.",
    "Velocity is the receiver's speed, 10 Hz at best and smoothed to 0.5 Hz, along the heading: no "
    "side slip. The drive lasts 216 s; the paper's 1500 s, so that slow states hardly settle.",
)


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A recorded drive.

    Attributes
    ----------
    trajectory : Trajectory
        The motion that is taken as true.
    track_error_m : float
        Rms distance between it and the receiver's positions, m.
    """

    trajectory: Trajectory
    track_error_m: float


def read_drive(path: Path, step_s: float = 0.01) -> Drive:
    """Return the carrier's motion from a recording of balzer82/Kalman's format.

    Parameters
    ----------
    path : Path
        CSV with at least ``COLUMNS``: millis, rates in deg/s (yaw anticlockwise), speed in km/h,
        course, latitude, longitude in deg, altitude in m.
    step_s : float
        Step of the trajectory, s.

    Raises
    ------
    DataSetError
        If the file is missing, empty or lacks a column.
    """
    column = _read_columns(path)
    t, keep = np.unique((column["millis"] - column["millis"][0]) * 1e-3, return_index=True)
    grid = np.arange(0.0, t[-1], 1.0 / RATE_HZ)

    def on_grid(name: str, scale: float = 1.0, lag_s: float = 0.0) -> Array:
        values = column[name][keep] * scale
        if name == "course":
            values = np.unwrap(values)
        return np.interp(grid + lag_s, t, values)

    speed = _low_pass(on_grid("speed", 1.0 / 3.6), SPEED_HZ)
    turned = -np.cumsum(on_grid("yawrate", np.pi / 180.0)) / RATE_HZ
    off = on_grid("course", np.pi / 180.0, COURSE_LAG_S) - turned
    moving = (on_grid("speed", 1.0 / 3.6) > MOVING_M_S).astype(np.float64)
    width = COURSE_WINDOW_S * RATE_HZ
    weight = gaussian_filter1d(moving, width) + 1e-6
    heading = turned + gaussian_filter1d(moving * off, width) / weight
    angles = [heading]
    for name in ("pitchrate", "rollrate"):
        swung = np.cumsum(on_grid(name, np.pi / 180.0)) / RATE_HZ
        angles.append(_high_pass(swung, DRIFT_HZ))
    euler = np.stack([_low_pass(angle, ATTITUDE_HZ) for angle in angles], axis=-1)
    climb = np.gradient(_low_pass(on_grid("altitude"), HEIGHT_HZ), 1.0 / RATE_HZ)
    along = _low_pass(heading, SPEED_HZ)
    velocity = np.stack([speed * np.sin(along), speed * np.cos(along), climb], axis=-1)
    start = Start(
        float(np.deg2rad(column["latitude"][0])), float(np.deg2rad(column["longitude"][0])),
        float(column["altitude"][0]), float(heading[0]), float(speed[0]),
    )  # fmt: skip
    trajectory = trajectory_from_motion(motion_from_samples(grid, euler, velocity, step_s), start)
    north = np.interp(grid, trajectory.t, trajectory.latitude) - on_grid("latitude", np.pi / 180.0)
    east = np.interp(grid, trajectory.t, trajectory.longitude) - on_grid("longitude", np.pi / 180)
    distance = EQUATOR_RADIUS * np.hypot(north, east * np.cos(start.latitude))
    return Drive(trajectory, float(np.sqrt(np.mean(distance**2))))


def drive_spec(duration_s: float) -> Spec:
    """Return the road study's specification with its segments laid on a drive of this length."""
    road = load_spec("gong-table4")
    third = duration_s / 3.0
    segments = (
        SegmentTable(name="middle", from_s=third, to_s=2.0 * third),
        SegmentTable(name="last", from_s=2.0 * third, to_s=duration_s),
    )
    changes = {
        name: profile.model_copy(update={"changes": ()}) for name, profile in road.profiles.items()
    }
    return road.model_copy(
        update={
            "title": "Semi-physical study on a real car drive",
            "source": "carrier: balzer82/Kalman, 2014-03-26-000-Data.csv (CC-BY-SA 2.0)",
            "about": "Flexure, misalignment and sensors of Gong et al. added to a recorded drive.",
            "segments": segments,
            "legs": (LegTable(duration_s=duration_s),),
            "published": (),
            "profiles": changes,
        }
    )


def _read_columns(path: Path) -> dict[str, Array]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as error:
        msg = f"{path}: cannot be read as CSV ({error})"
        raise DataSetError(msg) from error
    if len(rows) < 10 * RATE_HZ:
        msg = f"{path}: holds {len(rows)} samples, wants at least {10 * RATE_HZ:.0f}"
        raise DataSetError(msg)
    missing = [name for name in COLUMNS if name not in rows[0]]
    if missing:
        msg = f"{path}: column '{missing[0]}' is missing; wants {', '.join(COLUMNS)}"
        raise DataSetError(msg)
    try:
        return {name: np.array([float(row[name]) for row in rows]) for name in COLUMNS}
    except (TypeError, ValueError) as error:
        msg = f"{path}: holds a value that is not a number ({error})"
        raise DataSetError(msg) from error


def _low_pass(values: Array, cut_hz: float) -> Array:
    result: Array = sosfiltfilt(butter(2, cut_hz, fs=RATE_HZ, output="sos"), values)
    return result


def _high_pass(values: Array, cut_hz: float) -> Array:
    result: Array = sosfiltfilt(butter(2, cut_hz, "high", fs=RATE_HZ, output="sos"), values)
    return result
