"""The validated configuration: what every key means. An unknown key is an error.

Degrees are for people; what leaves through a property is SI and radians. How files become a
``Config`` is in ``config_file``.
"""

import hashlib
import math
from typing import Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from avionics.config.links import CameraSource, ImuChip, Link, Section
from avionics.records import FloatArray

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]
IDENTITY: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
Auto = Literal["auto"]


class Pod(Section):
    """One station with an IMU."""

    id: int = Field(ge=0)
    """Number of the pod."""
    s_m: float = Field(ge=0, description="arc length from the root on the reference line, m")
    R_sensor_from_local: Matrix3 = Field(
        default=IDENTITY, description="takes local (line) components to sensor components"
    )
    link: Link | None = None
    """How the pod is connected; not needed for recorded data."""
    chip: ImuChip = ImuChip()
    """Settings of its IMU."""

    @field_validator("R_sensor_from_local")
    @classmethod
    def _is_rotation(cls, value: Matrix3) -> Matrix3:
        matrix = np.array(value)
        if np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-3 or np.linalg.det(matrix) < 0:
            msg = "is not a rotation matrix (orthonormal rows, determinant +1)"
            raise ValueError(msg)
        return value

    @property
    def name(self) -> str:
        """The identifier that samples carry."""
        return str(self.id)


class Marker(Section):
    """One LED, or one motion-capture marker, at a station."""

    id: int = Field(ge=0)
    """Number of the marker."""
    s_m: float = Field(ge=0)
    """Arc length of its station, m."""
    x_m: float = 0.0
    """Chordwise forward of the line, local frame, m."""
    z_m: float = 0.0
    """Down from the line, local frame, m."""


class Wing(Section):
    """The flexible wing. A left wing is the mirrored right one (y to the left tip)."""

    name: str = "right"
    """Name in topics and records."""
    side: Literal["right", "left"] = "right"
    """Side of the aircraft."""
    span_m: float = Field(gt=0)
    """Length of the reference line, m."""
    psi0_deg: float = Field(default=0.0, gt=-90, lt=90, description="sweep at the root")

    @property
    def psi0_rad(self) -> float:
        """Sweep at the root, rad."""
        return math.radians(self.psi0_deg)


class Camera(Section):
    """The camera at the root: where it looks, its lens, and where its pictures come from.

    Lens and pose follow OpenCV's model and the frames of the specification: at zero angles the
    camera looks along +y of the body and image right is aft; negative tilt looks down.
    """

    name: str = "root"
    """Name in topics and records."""
    width_px: int = Field(default=640, gt=0)
    """Picture width, px."""
    height_px: int = Field(default=480, gt=0)
    """Picture height, px."""
    fps: float = Field(default=30.0, gt=0)
    """Frame rate, 1/s."""
    exposure_s: float = Field(default=0.006, gt=0)
    """Exposure, s."""
    f_x_px: float = Field(gt=0)
    """Focal length, px."""
    f_y_px: float = Field(gt=0)
    """Focal length, px."""
    c_x_px: float
    """Principal point; integers are pixel centres, px."""
    c_y_px: float
    """Principal point, px."""
    k1: float = 0.0
    """Radial distortion."""
    k2: float = 0.0
    """Radial distortion."""
    p1: float = 0.0
    """Tangential distortion."""
    p2: float = 0.0
    """Tangential distortion."""
    k3: float = 0.0
    """Radial distortion."""
    tilt_deg: float = 0.0
    """Up positive, deg."""
    pan_deg: float = 0.0
    """About the vertical, deg."""
    roll_deg: float = 0.0
    """About the optical axis, deg."""
    r_in_body_m: Vector3 = (0.0, 0.0, 0.0)
    """Position of the camera, body axes from the root, m."""
    row_time_s: float = Field(default=0.0, description="rolling shutter: time from row to row")
    time_offset_s: float = Field(
        default=0.0, description="added to frame times to bring them onto the gyro clock"
    )
    calibrated: bool = Field(default=False, description="False: nominal, ruler and data sheet")
    source: CameraSource | None = None
    """Where pictures come from; not needed for recorded data."""


class Estimator(Section):
    """Which filter runs, and its noises. "auto" follows from pods and markers."""

    form: Literal["general", "paper"] = "general"
    """"general" is the best general filter, "paper" exactly the published one."""
    bending_modes: int | Auto = "auto"
    """Number; auto follows from pods and markers."""
    twist_modes: int | Auto = "auto"
    """Number; auto likewise."""
    inplane_modes: int | Auto = "auto"
    """Number of in-plane modes; auto likewise."""
    basis: Literal["quarter-sine", "linear"] = "quarter-sine"
    """Mode shapes: quarter sines, or one line phi = slope * s."""
    linear_slope_per_m: float = Field(default=0.3776, description="basis 'linear': phi = slope*s")
    bias_states: bool | Auto = "auto"
    """Whether gyro biases are estimated."""
    gyro_lag_s: float | Literal["auto", "filter"] = Field(
        default="auto",
        description="age of a rate when it is read; filter = sqrt(2)/(2 pi bandwidth) for the "
        "chip's low-pass, auto = half the period of its registers as well; the paper's form has "
        "none unless a number is given",
    )
    sample_clock: bool | Auto = Field(
        default="auto",
        description="recover each pod's clock from jittered stamps; auto = in the general form, "
        "of pods without a link: our drivers know when a chip measured, a data set may not",
    )
    gyro_noise_dps_sqrthz: float = Field(default=0.014, gt=0)
    """Noise density of the gyros, deg/s/sqrt(Hz)."""
    bias_sigma_dps: float = Field(default=1.0, gt=0, description="initial one-sigma")
    bias_walk_rad_s_sqrts: float = Field(default=1e-5, ge=0)
    """Random walk of the biases, rad/s/sqrt(s)."""
    truncation_rad_sqrts: float | Auto = "auto"
    """Noise that stands for the modes left out, rad/sqrt(s)."""
    time_offset: bool | Auto = Field(
        default="auto", description="estimate what camera.time_offset_s leaves"
    )
    time_offset_sigma_s: float = Field(default=0.02, gt=0, description="initial one-sigma")
    start_sigma_deg: float = Field(default=15.0, gt=0)
    """Initial one-sigma of every amplitude, deg."""
    pixel_sigma_px: float | Auto = Field(default="auto", description="auto = the tracks' own sigma")
    gate_sigma: float = Field(default=5.0, gt=0, description="per-marker gate, two-dimensional")
    late_frames: Literal["rewind", "arrival"] = "rewind"
    """Fuse a late frame at its exposure (rewind) or as if it were new (arrival)."""
    history_s: float = Field(default=0.6, gt=0, description="oldest frame that can still be used")
    row_period_s: float = Field(default=0.01, gt=0, description="grid of steps and rows, s")
    rows_at_once: int = Field(
        default=10, ge=1, le=50, description="ticks whose rows are made, and written, together"
    )


class Tracker(Section):
    """How markers are found in the image."""

    name: Literal["led", "csrt", "kcf"] = "led"
    """Which tracker."""
    box_px: int = Field(default=24, gt=4, description="side of a correlation tracker's box")


class Recorder(Section):
    """What the log holds and how soon it is on disk."""

    chunk_s: float = Field(default=0.2, gt=0, le=0.3, description="longest time held in memory")
    chunk_bytes: int = Field(default=262144, gt=0)
    """Largest chunk, bytes."""
    fsync_s: float = Field(default=1.0, ge=0, description="0 = never")
    queue_records: int = Field(default=4096, gt=0)
    """Records that may wait for the disk."""
    images: bool = True
    """Whether pictures are recorded."""
    image_format: Literal["png", "jpeg"] = "jpeg"
    """png loses nothing; jpeg is small and quick."""
    jpeg_quality: int = Field(default=95, ge=1, le=100)
    """Quality of jpeg."""


class DistributedPos(Section):
    """The Gs filter of the estimator "gs": how the wing flexes about x, y, z of the line."""

    correlation_s: Vector3 = (1.0, 1.0, 1.0)
    """Correlation times of the second-order Markov flexure, s."""
    flexure_sigma_deg: Vector3 = (12.0, 6.0, 3.0)
    """One-sigma of the flexure angles, deg."""
    misalignment_sigma_deg: float = Field(default=5.0, gt=0)
    """Initial one-sigma of the constant part of the angles, deg."""


class Config(Section):
    """Everything that decides what flies."""

    wing: Wing
    """The wing."""
    pods: tuple[Pod, ...] = ()
    """Stations with an IMU."""
    markers: tuple[Marker, ...] = ()
    """The LEDs that the camera tracks."""
    truth_markers: tuple[Marker, ...] = ()
    """Motion-capture markers, for evaluation only."""
    camera: Camera | None = None
    """The camera; absent, only RG-WSE flies."""
    estimator: Estimator = Estimator()
    """The filter."""
    tracker: Tracker = Tracker()
    """The tracker."""
    recorder: Recorder = Recorder()
    """The log."""
    estimators: tuple[Literal["crg", "gs"], ...] = ("crg",)
    """Estimators that fly side by side."""
    gs: DistributedPos = DistributedPos()
    """The distributed POS beside the camera-aided filter."""

    @model_validator(mode="after")
    def _is_consistent(self) -> "Config":
        for what, items in (("pods", self.pods), ("markers", self.markers)):
            ids = [item.id for item in items]
            if len(set(ids)) != len(ids):
                msg = f"{what}: ids {ids} are not unique"
                raise ValueError(msg)
        placed: tuple[Pod | Marker, ...] = (*self.pods, *self.markers, *self.truth_markers)
        for item in placed:
            if item.s_m > self.wing.span_m * (1 + 1e-9):
                msg = f"s_m = {item.s_m} of id {item.id} lies beyond span_m = {self.wing.span_m}"
                raise ValueError(msg)
        return self

    @property
    def pod_names(self) -> tuple[str, ...]:
        """Identifiers of the pods, in order."""
        return tuple(pod.name for pod in self.pods)

    def digest(self) -> str:
        """Return the SHA-256 of the resolved configuration."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()


def stations(items: tuple[Pod, ...] | tuple[Marker, ...]) -> FloatArray:
    """Return the arc lengths of pods or markers, shape (n,), m."""
    return np.array([item.s_m for item in items], dtype=np.float64)
