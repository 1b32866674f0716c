"""Mode shapes of bending, twist and in-plane bending, and how many of each to fly."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from avionics.config import Config

Array = NDArray[Any]
Family = Literal["quarter-sine", "linear"]


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


def paper_basis(config: Config) -> ModeBasis:
    """Return one bending and one twist mode, as Srikanth et al. fly them."""
    estimator = config.estimator
    return ModeBasis(estimator.basis, config.wing.span_m, 1, 1, 0, estimator.linear_slope_per_m)


def basis_from_name(name: str, config: Config) -> ModeBasis:
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
    slope = config.estimator.linear_slope_per_m
    known: Family = "linear" if family == "linear" else "quarter-sine"
    return ModeBasis(known, config.wing.span_m, bending, twist, inplane, slope)


def choose_basis(config: Config) -> ModeBasis:
    """Return the basis of the camera-aided filter.

    Notes
    -----
    "auto" follows from what can be seen, by one rule for every wing: the camera tells apart as
    many shapes as there are stations with markers, the gyros as many as there are pods. Bending
    takes the larger of the two numbers, at most four; twist one mode, and two from two stations
    or pods on; in-plane bending one wherever there are markers, two from three stations on.
    """
    estimator = config.estimator
    auto = (1, 1, 0) if estimator.form == "paper" else _auto_counts(config)
    wanted = (estimator.bending_modes, estimator.twist_modes, estimator.inplane_modes)
    bending, twist, inplane = (
        a if w == "auto" else int(w) for w, a in zip(wanted, auto, strict=True)
    )
    return ModeBasis(
        estimator.basis,
        config.wing.span_m,
        bending,
        twist,
        inplane,
        estimator.linear_slope_per_m,
    )


def _auto_counts(config: Config) -> tuple[int, int, int]:
    tolerance_m = 0.02 * config.wing.span_m
    pods = _distinct([pod.s_m for pod in config.pods if pod.s_m > tolerance_m], tolerance_m)
    seen = _distinct([m.s_m for m in config.markers if m.s_m > tolerance_m], tolerance_m)
    many = max(pods, seen)
    bending = max(1, min(4, many))
    twist = max(1, min(2, many))
    inplane = min(2, (seen + 1) // 2)
    return bending, twist, inplane


def _distinct(s: list[float], tolerance: float) -> int:
    ordered = sorted(s)
    return sum(1 for i, value in enumerate(ordered) if i == 0 or value - ordered[i - 1] > tolerance)
