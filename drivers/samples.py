"""What the drivers return: the records that the pipeline takes and the log stores."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class ImuSample:
    """One sample of one inertial measurement unit, in the sensor's own frame.

    Attributes
    ----------
    t_ns : int
        When the chip's registers were read, ns of the steady clock: where the data begin in a
        burst, or the pod's synchronised clock. How old a rate is by then (the chip's low-pass
        and the period of its registers) is subtracted in the pipeline, not here.
    pod : str
        Identifier of the pod as in the configuration, or ``"root"``.
    seq : int
        Sequence number of the source; a step above one is a loss.
    rate_rad_s : ndarray, shape (3,)
        Angular rate, rad/s, sensor axes.
    specific_force_m_s2 : ndarray, shape (3,), or None
        Specific force, m/s^2, sensor axes.
    magnetic_flux_t : ndarray, shape (3,), or None
        Magnetic flux density, T, sensor axes.
    """

    t_ns: int
    pod: str
    seq: int
    rate_rad_s: NDArray[np.float64]
    specific_force_m_s2: NDArray[np.float64] | None = None
    magnetic_flux_t: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One image.

    Attributes
    ----------
    t_ns : int
        Middle of the exposure, ns of the steady clock.
    camera : str
        Name of the camera as in the configuration.
    index : int
        Frame number of the source; a step above one is a loss.
    image : ndarray, shape (H, W) or (H, W, 3), uint8
        Gray or BGR picture.
    """

    t_ns: int
    camera: str
    index: int
    image: NDArray[np.uint8]
