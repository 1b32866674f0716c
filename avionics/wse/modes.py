"""Mode shapes of bending, twist and in-plane bending: how many, and how large beforehand."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Family = Literal["quarter-sine", "linear"]

# Static loads bend mostly in the first mode; amplitudes fall off about so with the mode number.
PRIOR_DECAY = 1.0
# A wing is stiff in its own plane: a fifth of the angles that it reaches out of it.
INPLANE_PRIOR = 0.2


def quarter_sine(s: Array, span: float, count: int) -> Array:
    """Return the shapes sin((2i-1) pi s / 2L), i = 1..count.

    Parameters
    ----------
    s : ndarray, shape (S,)
        Arc lengths, m.
    span : float
        Length L of the reference line, m.
    count : int
        Number of shapes.

    Returns
    -------
    ndarray, shape (S, count)
        Clamped at the root, without curvature at the free tip.
    """
    shapes: Array = np.sin(np.outer(s, _wave_numbers(span, count)))
    return shapes


def quarter_sine_slope(s: Array, span: float, count: int) -> Array:
    """Return the derivatives by s of ``quarter_sine``, 1/m, shape (S, count)."""
    k = _wave_numbers(span, count)
    slopes: Array = k * np.cos(np.outer(s, k))
    return slopes


def _wave_numbers(span: float, count: int) -> Array:
    return (2 * np.arange(1, count + 1) - 1) * np.pi / (2 * span)


def powers(s: Array, span: float, slope: float, count: int) -> Array:
    """Return slope * s * (s/L)^(i-1); the first is the paper's snapshot shape, 0.3776 s."""
    return slope * s[:, None] * (s[:, None] / span) ** np.arange(count)


def powers_slope(s: Array, span: float, slope: float, count: int) -> Array:
    """Return the derivatives by s of ``powers``, 1/m, shape (S, count)."""
    order = np.arange(1, count + 1)
    return slope * order * (s[:, None] / span) ** (order - 1)


@dataclass(frozen=True, slots=True)
class ModeBasis:
    """The shapes that stand for the wing: Eq. 1 of Srikanth et al.

    Attributes
    ----------
    family : str
        "quarter-sine" or "linear" (powers of s; the first is the paper's).
    span_m : float
        Length of the reference line, m.
    bending, twist, inplane : int
        Number of modes of each family of angles.
    linear_slope_per_m : float
        Slope of the linear shape, 1/m.
    """

    family: Family
    span_m: float
    bending: int
    twist: int
    inplane: int
    linear_slope_per_m: float = 0.3776

    @property
    def count(self) -> int:
        """Number of amplitudes."""
        return self.bending + self.twist + self.inplane

    @property
    def name(self) -> str:
        """Identifier in records, e.g. ``quarter-sine/3+2+1``."""
        return f"{self.family}/{self.bending}+{self.twist}+{self.inplane}"

    @property
    def phi(self) -> slice:
        """Where the bending amplitudes stand among the amplitudes."""
        return slice(0, self.bending)

    @property
    def theta(self) -> slice:
        """Where the twist amplitudes stand."""
        return slice(self.bending, self.bending + self.twist)

    @property
    def psi(self) -> slice:
        """Where the in-plane amplitudes stand."""
        return slice(self.bending + self.twist, self.count)

    @property
    def labels(self) -> list[str]:
        """Name of every amplitude, e.g. ``phi 1``."""
        counts = (("phi", self.bending), ("theta", self.twist), ("psi", self.inplane))
        return [f"{family} {n}" for family, count in counts for n in range(1, count + 1)]

    @property
    def order(self) -> Array:
        """Number of each amplitude within its family, from 1, shape (count,)."""
        return np.concatenate(
            [np.arange(1, n + 1) for n in (self.bending, self.twist, self.inplane)]
        )

    def shape(self, s: Array, count: int) -> Array:
        """Return the first ``count`` shapes at arc lengths ``s``, shape (S, count)."""
        if self.family == "linear":
            return powers(np.asarray(s), self.span_m, self.linear_slope_per_m, count)
        return quarter_sine(s, self.span_m, count)

    def slope(self, s: Array, count: int) -> Array:
        """Return their derivatives by s, 1/m, shape (S, count)."""
        if self.family == "linear":
            return powers_slope(np.asarray(s), self.span_m, self.linear_slope_per_m, count)
        return quarter_sine_slope(s, self.span_m, count)

    def holds(self, other: "ModeBasis") -> bool:
        """Return whether every shape of another basis is one of this."""
        return (
            self.family == other.family
            and self.bending >= other.bending
            and self.twist >= other.twist
            and self.inplane >= other.inplane
        )

    def embed(self, other: "ModeBasis") -> Array:
        """Return the matrix that writes amplitudes of a smaller basis as amplitudes of this one.

        Parameters
        ----------
        other : ModeBasis
            Same family, no more modes of any kind.

        Returns
        -------
        ndarray, shape (other.count, count)
            ``q_other @ matrix`` is the same shape in this basis.
        """
        matrix = np.zeros((other.count, self.count))
        for mine, theirs in ((self.phi, other.phi), (self.theta, other.theta)):
            n = theirs.stop - theirs.start
            matrix[theirs, mine.start : mine.start + n] = np.eye(n)
        n = other.inplane
        matrix[other.psi, self.psi.start : self.psi.start + n] = np.eye(n)
        return matrix


def basis_from_name(name: str, span_m: float, linear_slope_per_m: float) -> ModeBasis:
    """Return the basis that a record names, e.g. ``quarter-sine/3+2+1``, on a wing.

    Raises
    ------
    ValueError
        If the name is none of ours.
    """
    family, _, counts = name.partition("/")
    numbers = counts.split("+")
    if family not in ("quarter-sine", "linear") or len(numbers) != 3:
        msg = f"mode basis '{name}', expected for example quarter-sine/3+2+1"
        raise ValueError(msg)
    bending, twist, inplane = (int(number) for number in numbers)
    known: Family = "linear" if family == "linear" else "quarter-sine"
    return ModeBasis(known, span_m, bending, twist, inplane, linear_slope_per_m)


def observable_modes(pods_s: Array, markers_s: Array, span: float) -> tuple[int, int, int]:
    """Return how many bending, twist and in-plane modes pods and markers tell apart.

    Parameters
    ----------
    pods_s, markers_s : ndarray, shapes (M,), (K,)
        Stations, m.
    span : float
        Length of the reference line, m.

    Notes
    -----
    One rule for every wing: the camera tells apart as many shapes as there are stations with
    markers, the gyros as many as there are pods. Bending takes the larger of the two numbers, at
    most four; twist one mode, and two from two stations or pods on; in-plane bending one wherever
    there are markers, two from three stations on.
    """
    pods, marked = _distinct(pods_s, 0.02 * span), _distinct(markers_s, 0.02 * span)
    many = max(pods, marked)
    return max(1, min(4, many)), max(1, min(2, many)), min(2, (marked + 1) // 2)


def _distinct(s: Array, tolerance: float) -> int:
    """Count stations off the root that lie apart."""
    ordered = sorted(value for value in s if value > tolerance)
    return sum(1 for i, value in enumerate(ordered) if i == 0 or value - ordered[i - 1] > tolerance)


def prior_variance(basis: ModeBasis, sigma: float) -> Array:
    """Return the prior variances of the amplitudes, rad^2, shape (count,).

    Parameters
    ----------
    basis : ModeBasis
        Mode shapes.
    sigma : float
        One-sigma of the first bending and twist amplitude, rad; of the tip angle where the shapes
        are linear.
    """
    falloff = (2.0 * basis.order - 1.0) ** -PRIOR_DECAY
    scale = np.ones(basis.count)
    scale[basis.psi] = INPLANE_PRIOR
    if basis.family == "linear":
        # Amplitude times slope times span is the tip angle.
        scale = scale / (basis.linear_slope_per_m * basis.span_m)
    variance: Array = (sigma * falloff * scale) ** 2
    return variance
