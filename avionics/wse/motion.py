"""How the amplitudes move around one instant."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """How the amplitudes move at an exposure: they were seen a little earlier or later.

    Attributes
    ----------
    rate : ndarray, shape (n,)
        As the gyros tell it, rad/s.
    acceleration : ndarray, shape (n,)
        rad/s^2.
    live : tuple of bool
        Which pods delivered.
    """

    rate: Array
    acceleration: Array
    live: tuple[bool, ...] = ()
