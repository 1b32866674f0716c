"""What flows inside the application and into the log, beside the drivers' samples.

Time is int64 ns of one monotonic clock. ``t_ns`` is when the quantity was true; when it arrived
travels beside the record, never in it.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from avionics.errors import RecordingError
from avionics.kinds import EstimateKind
from drivers.events import Event
from drivers.samples import Frame

__all__ = [
    "EncodedFrame",
    "Event",
    "FloatArray",
    "Health",
    "MarkerPrediction",
    "MarkerTracks",
    "Truth",
    "WingShapeEstimate",
]

FloatArray = NDArray[np.float64]
ROOT = "root"
"""What samples of the IMU at the root carry as their pod."""


@dataclass(frozen=True, slots=True, eq=False)
class EncodedFrame:
    """One compressed image, as the log holds it; decoded only when someone looks at it.

    Attributes
    ----------
    t_ns : int
        Middle of the exposure, ns of the steady clock.
    camera : str
        Name of the camera.
    index : int
        Frame number of the source.
    format : str
        "png" or "jpeg".
    data : bytes
        The compressed picture.
    """

    t_ns: int
    camera: str
    index: int
    format: str
    data: bytes

    def decode(self) -> Frame:
        """Return the frame with its pixels.

        Raises
        ------
        RecordingError
            If the bytes are no image.
        """
        import cv2  # noqa: PLC0415 (most readers of a log look at no picture)

        packed = np.frombuffer(self.data, dtype=np.uint8)
        image = cv2.imdecode(packed, cv2.IMREAD_UNCHANGED) if packed.size else None
        if image is None:
            msg = f"camera {self.camera}: frame {self.index} holds no readable {self.format} image"
            raise RecordingError(msg)
        return Frame(self.t_ns, self.camera, self.index, np.asarray(image, dtype=np.uint8))


@dataclass(frozen=True, slots=True, eq=False)
class MarkerTracks:
    """Where one frame shows the markers.

    Attributes
    ----------
    t_ns : int
        Middle of the frame's exposure, ns.
    camera : str
        Name of the camera.
    frame_index : int
        Number of the frame.
    pixel : ndarray, shape (K, 2)
        (u, v) in the raw (distorted) image, px; integers are pixel centres. NaN where not found.
        Markers in the order of the configuration.
    sigma_px : ndarray, shape (K,)
        One-sigma of each coordinate, px; NaN where not found.
    found : ndarray of bool, shape (K,)
        Whether the marker was found in this frame.
    tracker : str
        Name of the tracker that made it.
    """

    t_ns: int
    camera: str
    frame_index: int
    pixel: FloatArray
    sigma_px: FloatArray
    found: NDArray[np.bool_]
    tracker: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class WingShapeEstimate:
    """One estimate of the wing's shape.

    Attributes
    ----------
    t_ns : int
        When the shape was this, ns.
    wing : str
        Name of the wing.
    kind : str
        One of ``avionics.kinds``.
    basis : str
        Identifier of the mode basis, e.g. ``quarter-sine/3+1+1``.
    phi_rad, theta_rad, psi_rad : ndarray, shapes (N,), (Nt,), (Np,)
        Amplitudes of bending, twist and in-plane bending, rad.
    phi_sigma_rad, theta_sigma_rad, psi_sigma_rad : ndarray
        Their one-sigmas, rad; NaN where not available.
    bias_rad_s, bias_sigma_rad_s : ndarray, shape (M, 3)
        Gyro bias by pod in the order of the configuration, local axes, rad/s; NaN where not
        estimated.
    line_in_body_m : ndarray, shape (S, 3)
        Points of the deformation reference line, body axes, m; the last one is the tip.
    tip_sigma_m : ndarray, shape (3,)
        One-sigma of the last point, m.
    marker_px, marker_sigma_px : ndarray, shape (K, 2)
        Predicted raw-image pixel of every marker and its one-sigma from the state alone; NaN
        where the marker lies behind the camera.
    nis : float
        Normalised innovation squared of the last update over its degrees of freedom; NaN if none.
    used : ndarray of bool, shape (K,)
        Markers that the last update used.
    covariance : ndarray, shape (n, n), or None
        Full covariance, order phi, theta, psi, then biases by pod and axis; at 10 Hz.
    """

    t_ns: int
    wing: str
    kind: EstimateKind
    basis: str
    phi_rad: FloatArray
    theta_rad: FloatArray
    psi_rad: FloatArray
    phi_sigma_rad: FloatArray
    theta_sigma_rad: FloatArray
    psi_sigma_rad: FloatArray
    bias_rad_s: FloatArray
    bias_sigma_rad_s: FloatArray
    line_in_body_m: FloatArray
    tip_sigma_m: FloatArray
    marker_px: FloatArray
    marker_sigma_px: FloatArray
    nis: float
    used: NDArray[np.bool_]
    covariance: FloatArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MarkerPrediction:
    """Where the filter expects the markers in a frame; never logged.

    Attributes
    ----------
    t_ns : int
        Instant of the prediction, ns.
    pixel : ndarray, shape (K, 2)
        Raw-image pixels, px; NaN behind the camera.
    covariance_px2 : ndarray, shape (K, 2, 2)
        Covariance of each from the state alone, px^2.
    hypotheses_px : ndarray, shape (S, K, 2), or None
        Where the markers would be for shapes spread over what the wing can do: for whoever has
        lost them, or has not found them yet; NaN behind the camera.
    """

    t_ns: int
    pixel: FloatArray
    covariance_px2: FloatArray
    hypotheses_px: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class Health:
    """Counters of one source, by name, since the start of the run."""

    t_ns: int
    source: str
    counters: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The true shape, from the simulated wing or from motion capture. Never read by the estimator.

    Attributes
    ----------
    t_ns : int
        When, ns.
    wing : str
        Name of the wing.
    source : str
        "sim" or "mocap".
    marker_in_body_m : ndarray, shape (K, 3)
        Positions of the truth markers (``[[truth_markers]]`` of the configuration, in order),
        body axes, m; NaN where missing.
    line_in_body_m : ndarray, shape (S, 3), or None
        Reference line at the stations ``linspace(0, span, S)``, body axes, m; the last is the tip.
    phi_rad, theta_rad, psi_rad : ndarray, shape (S,), or None
        Local angles at the same stations, rad.
    """

    t_ns: int
    wing: str
    source: Literal["sim", "mocap"]
    marker_in_body_m: FloatArray
    line_in_body_m: FloatArray | None = None
    phi_rad: FloatArray | None = None
    theta_rad: FloatArray | None = None
    psi_rad: FloatArray | None = None
