"""wing.yaml of a data set: the wing, its pods, markers, motion capture and nominal camera."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from avionics.config.load import explain
from avionics.errors import DataSetError
from avionics.records import FloatArray

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]


class _Part(BaseModel):
    # Sets carry notes and keys of their own; what is read is checked, the rest is theirs.
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class WingPart(_Part):
    """The wing."""

    span_m: float = Field(gt=0)
    psi0_deg: float = 0.0
    side: str = "right"


class PodPart(_Part):
    """One pod."""

    id: int
    s_m: float
    R_sensor_from_drl: Matrix3 = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


class ImuPart(_Part):
    """Scales and quality of the chips."""

    rate_hz: float = Field(default=100.0, gt=0)
    gyro_lsb_per_dps: float = Field(default=16.0, gt=0)
    accel_lsb_per_mps2: float = Field(default=100.0, gt=0)
    mag_lsb_per_ut: float = Field(default=16.0, gt=0, alias="mag_lsb_per_uT")
    gyro_bandwidth_hz: float = Field(default=32.0, gt=0)
    gyro_noise_dps_sqrthz: float = Field(default=0.014, gt=0)
    zero_rate_offset_dps_max: float = Field(default=1.0, gt=0)


class MarkerPart(_Part):
    """One LED or motion-capture marker."""

    id: int
    s: float
    x: float = 0.0
    z: float = 0.0


class MocapPart(_Part):
    """Motion capture and its alignment: m_lab = R m_body + t."""

    markers: tuple[MarkerPart, ...]
    R_lab_from_body_rows: Matrix3 = Field(alias="R_lab_from_body")
    t_lab: Vector3 = Field(alias="t_lab_m")

    @property
    def D_lab_from_body(self) -> FloatArray:  # noqa: N802 (the frames' own notation)
        """Rotation from body to lab, shape (3, 3)."""
        return np.array(self.R_lab_from_body_rows, dtype=np.float64)

    @property
    def t_lab_m(self) -> FloatArray:
        """Body origin in the lab, m, shape (3,)."""
        return np.array(self.t_lab, dtype=np.float64)


class NominalCamera(_Part):
    """The camera by ruler, protractor and data sheet."""

    f_px: float | None = Field(default=None, gt=0)
    f_x_px: float | None = Field(default=None, gt=0)
    f_y_px: float | None = Field(default=None, gt=0)
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    tilt_deg: float = 0.0
    pan_deg: float = 0.0
    roll_deg: float = 0.0
    r_body_m: Vector3

    @property
    def focal_px(self) -> tuple[float, float]:
        """Focal lengths, px."""
        f_x, f_y = self.f_x_px or self.f_px, self.f_y_px or self.f_px
        if f_x is None or f_y is None:
            msg = "camera.nominal needs f_px"
            raise ValueError(msg)
        return f_x, f_y


class Chessboard(_Part):
    """The calibration board."""

    inner_corners: tuple[int, int]
    square_m: float = Field(gt=0)


class CameraPart(_Part):
    """The camera and its calibration board."""

    width: int = Field(gt=0)
    height: int = Field(gt=0)
    fps: float = Field(default=30.0, gt=0)
    exposure_s: float = Field(default=0.006, gt=0)
    nominal: NominalCamera
    chessboard: Chessboard | None = None


class WingDescription(_Part):
    """All of wing.yaml that is read."""

    wing: WingPart
    pods: tuple[PodPart, ...] = Field(min_length=1)
    imu: ImuPart = ImuPart()
    markers: tuple[MarkerPart, ...] = ()
    mocap: MocapPart | None = None
    camera: CameraPart | None = None


def read_wing_yaml(path: Path) -> WingDescription:
    """Read wing.yaml.

    Raises
    ------
    DataSetError
        If it is missing, is not YAML, or lacks what is needed; the message names the key.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror}); a data set needs it"
        raise DataSetError(msg) from error
    except UnicodeDecodeError as error:
        msg = f"{path}: is not text in UTF-8"
        raise DataSetError(msg) from error
    try:
        content: Any = yaml.safe_load(text)
    except yaml.YAMLError as error:
        what = str(error).splitlines()[0]
        where = getattr(error, "problem_mark", None)
        line = f" in line {where.line + 1}" if where is not None else ""
        msg = f"{path}: is not YAML{line}: {what}"
        raise DataSetError(msg) from error
    if not isinstance(content, dict):
        msg = f"{path}: is empty or no mapping; expected the keys wing, pods, imu, markers, camera"
        raise DataSetError(msg)
    try:
        described = WingDescription.model_validate(content)
        if described.camera is not None:
            _ = described.camera.nominal.focal_px
    except ValidationError as error:
        raise DataSetError(explain(str(path), error.errors()[0])) from None
    except ValueError as error:
        msg = f"{path}: {error}"
        raise DataSetError(msg) from None
    return described
