"""What all wings of a flight share: how shapes are estimated, tracked and recorded."""

from typing import Literal

from pydantic import Field

from avionics.config.links import Section

Vector3 = tuple[float, float, float]
Auto = Literal["auto"]


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
