"""The validated configuration: what every key means. An unknown key is an error.

Degrees are for people; what leaves through a property is SI and radians. How files become a
``Config`` is in ``load``.
"""

import hashlib
import math
from collections.abc import Iterable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    model_serializer,
    model_validator,
)

from avionics.config.chips import Bno055Settings, Chip
from avionics.config.link_checks import Linked, check_links
from avionics.config.links import CameraSource, Link, Section
from avionics.config.shared import DistributedPos, Estimator, Recorder, Tracker, Vector3
from avionics.errors import ConfigError
from avionics.records import ROOT, FloatArray

Matrix3 = tuple[Vector3, Vector3, Vector3]
IDENTITY: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _rotation(value: Matrix3) -> Matrix3:
    matrix = np.array(value)
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-3 or np.linalg.det(matrix) < 0:
        msg = "is not a rotation matrix (orthonormal rows, determinant +1)"
        raise ValueError(msg)
    return value


Rotation = Annotated[Matrix3, AfterValidator(_rotation)]


class Pod(Section):
    """One station with an IMU."""

    id: int = Field(ge=0)
    """Number of the pod."""
    s_m: float = Field(ge=0, description="arc length from the root on the reference line, m")
    R_sensor_from_local: Rotation = Field(
        default=IDENTITY, description="takes local (line) components to sensor components"
    )
    link: Link | None = None
    """How the pod is connected; not needed for recorded data."""
    chip: Chip = Bno055Settings()
    """Which IMU it is and its settings."""

    @model_validator(mode="after")
    def _chip_fits_the_link(self) -> "Pod":
        _check_fit(self)
        return self

    @property
    def name(self) -> str:
        """The identifier that samples carry."""
        return str(self.id)

    @property
    def title(self) -> str:
        """What messages call it."""
        return f"pod {self.id}"


class RootImu(Section):
    """The IMU at the root, where the aircraft moves: its rates are taken off those of every pod."""

    R_sensor_from_body: Rotation = Field(
        default=IDENTITY, description="takes body components to sensor components"
    )
    link: Link | None = None
    """How it is connected, as a pod is."""
    chip: Chip = Bno055Settings()
    """Which IMU it is and its settings."""

    @model_validator(mode="after")
    def _chip_fits_the_link(self) -> "RootImu":
        _check_fit(self)
        return self

    @property
    def name(self) -> str:
        """The identifier that samples carry."""
        return ROOT

    @property
    def title(self) -> str:
        """What messages call it."""
        return ROOT


def _check_fit(imu: Pod | RootImu) -> None:
    misfit = None if imu.link is None else imu.chip.misfit(imu.link)
    if misfit is not None:
        raise ValueError(misfit)


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


class Equipment(Section):
    """What sits on one wing, and the camera that looks at it."""

    pods: tuple[Pod, ...] = ()
    """Stations with an IMU."""
    markers: tuple[Marker, ...] = ()
    """The LEDs that the camera tracks."""
    truth_markers: tuple[Marker, ...] = ()
    """Motion-capture markers, for evaluation only."""
    camera: Camera | None = None
    """The camera; absent, only RG-WSE flies."""

    def check_placed(self, span_m: float) -> None:
        """Raise ``ValueError`` where ids repeat or something sits beyond the span."""
        for what, items in (("pods", self.pods), ("markers", self.markers)):
            ids = [item.id for item in items]
            if len(set(ids)) != len(ids):
                msg = f"{what}: ids {ids} are not unique"
                raise ValueError(msg)
        placed: tuple[Pod | Marker, ...] = (*self.pods, *self.markers, *self.truth_markers)
        for item in placed:
            if item.s_m > span_m * (1 + 1e-9):
                msg = f"s_m = {item.s_m} of id {item.id} lies beyond span_m = {span_m}"
                raise ValueError(msg)


class FlightSettings(Section):
    """The part of a configuration that stands once for all wings."""

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
    root: RootImu | None = None
    """The IMU at the root; absent, the root rests."""

    @model_serializer(mode="wrap")
    def _without_absent_root(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Write no key where there is none: digests stay what they were before it."""
        tables: dict[str, Any] = handler(self)
        if tables.get("root", self) is None:
            del tables["root"]
        return tables

    @property
    def wing_configs(self) -> tuple["Config", ...]:
        """The configuration of each wing, in order: what one pipeline takes."""
        raise NotImplementedError

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The cameras of all wings, in order."""
        found = (config.camera for config in self.wing_configs)
        return tuple(camera for camera in found if camera is not None)

    def for_wing(self, name: str) -> "Config":
        """Return the configuration of one wing.

        Raises
        ------
        ConfigError
            If no wing has this name.
        """
        for config in self.wing_configs:
            if config.wing.name == name:
                return config
        names = ", ".join(config.wing.name for config in self.wing_configs)
        msg = f"wing '{name}': the configuration has none of this name; wanted one of {names}"
        raise ConfigError(msg)

    def digest(self) -> str:
        """Return the SHA-256 of the resolved configuration."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()


FLOWN = {"is_flown": True}
"""Context in which the configuration of a log is validated: what has flown can be read again."""


def check_unless_flown(imus: Iterable[Linked | None], info: ValidationInfo) -> None:
    """Raise ``ConfigError`` where links contradict each other and have not flown all the same."""
    if info.context != FLOWN:
        check_links(imu for imu in imus if imu is not None)


class _OneWing(Section):
    """The table ``[wing]``, which stands first in a file and in a log."""

    wing: Wing
    """The wing."""


class Config(FlightSettings, Equipment, _OneWing):
    """Everything that decides what flies on one wing."""

    @model_validator(mode="after")
    def _is_consistent(self, info: ValidationInfo) -> "Config":
        self.check_placed(self.wing.span_m)
        check_unless_flown((*self.pods, self.root), info)
        return self

    @property
    def wing_configs(self) -> tuple["Config", ...]:
        """A flight of one wing: itself."""
        return (self,)

    @property
    def pod_names(self) -> tuple[str, ...]:
        """Identifiers of the pods, in order."""
        return tuple(pod.name for pod in self.pods)


def stations(items: tuple[Pod, ...] | tuple[Marker, ...]) -> FloatArray:
    """Return the arc lengths of pods or markers, shape (n,), m."""
    return np.array([item.s_m for item in items], dtype=np.float64)
