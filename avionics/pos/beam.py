"""Timoshenko cantilever: linear elements with reduced shear, exact frequencies, modal reduction."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

from avionics.pos.compiled import Array

SHEAR_FACTOR = 1.2  # k of a rectangular section, Guo and Zhu, Eq. 6


@dataclass(frozen=True, slots=True)
class Beam:
    """A clamped-free beam of rectangular section.

    Attributes
    ----------
    length, width, thickness : float
        m; it bends in the direction of its thickness.
    youngs, shear : float
        E and G, Pa.
    density : float
        kg/m^3.
    """

    length: float
    width: float
    thickness: float
    youngs: float = 70e9
    shear: float = 26.9e9
    density: float = 2700.0

    @property
    def area(self) -> float:
        """A, m^2."""
        return self.width * self.thickness

    @property
    def inertia(self) -> float:
        """I, m^4."""
        return self.width * self.thickness**3 / 12.0

    @property
    def bending_stiffness(self) -> float:
        """EI, N m^2."""
        return self.youngs * self.inertia

    @property
    def shear_stiffness(self) -> float:
        """GA / k, N."""
        return self.shear * self.area / SHEAR_FACTOR


Integration = Literal["reduced", "full"]


def element_matrices(
    beam: Beam, length: float, integration: Integration = "reduced"
) -> tuple[Array, Array]:
    """Return stiffness and mass of one element, shapes (4, 4), in (v1, theta1, v2, theta2).

    Parameters
    ----------
    beam : Beam
        Section and material.
    length : float
        Of the element, m.
    integration : {"reduced", "full"}
        Of the shear term: one point, or exact, which locks.

    Notes
    -----
    Guo and Zhu, Eq. 10-15.
    """
    half, square, cross = 0.5 * length, 0.25 * length**2, 0.25 * length**2
    if integration == "full":
        square, cross = length**2 / 3.0, length**2 / 6.0
    shear = np.array(
        [
            [1.0, half, -1.0, half],
            [half, square, -half, cross],
            [-1.0, -half, 1.0, -half],
            [half, cross, -half, square],
        ]
    )
    bending = np.zeros((4, 4))
    bending[1, 1] = bending[3, 3] = 1.0
    bending[1, 3] = bending[3, 1] = -1.0
    K = beam.bending_stiffness / length * bending + beam.shear_stiffness / length * shear
    mass = np.kron(np.array([[2.0, 1.0], [1.0, 2.0]]), np.diag([beam.area, beam.inertia]))
    return K, beam.density * length / 6.0 * mass


def assemble(
    beam: Beam, elements: int, integration: Integration = "reduced"
) -> tuple[Array, Array]:
    """Return K and M of the clamped beam, shapes (2n, 2n), nodes 1..n as (v, theta) pairs."""
    K_e, M_e = element_matrices(beam, beam.length / elements, integration)
    size = 2 * (elements + 1)
    K, M = np.zeros((size, size)), np.zeros((size, size))
    for e in range(elements):
        place = slice(2 * e, 2 * e + 4)
        K[place, place] += K_e
        M[place, place] += M_e
    return K[2:, 2:], M[2:, 2:]


def tip_deflection(
    beam: Beam, elements: int, force: float, integration: Integration = "reduced"
) -> tuple[float, float]:
    """Return deflection, m, and rotation, rad, of the tip under a force, N, on it."""
    K, _ = assemble(beam, elements, integration)
    load = np.zeros(len(K))
    load[-2] = force
    q = np.linalg.solve(K, load)
    return float(q[-2]), float(q[-1])


def modes(beam: Beam, elements: int, count: int) -> tuple[Array, Array]:
    """Return frequencies, rad/s, shape (count,), and mass-normalised shapes, (2n, count)."""
    K, M = assemble(beam, elements)
    squared, shapes = eigh(K, M, subset_by_index=[0, count - 1])
    return np.sqrt(squared), shapes


def exact_frequencies(beam: Beam, count: int) -> Array:
    """Return the first natural frequencies of the exact Timoshenko cantilever, rad/s.

    Parameters
    ----------
    beam : Beam
        The beam.
    count : int
        How many.

    Notes
    -----
    Roots in omega of the determinant of the (M, Q) block of exp(A L) for the state (v, theta,
    M, Q): clamped at 0, free of moment and shear at L. In lengths of L and moments of EI / L.
    """
    L, EI = beam.length, beam.bending_stiffness
    compliance = EI / (L**2 * beam.shear_stiffness)
    unit = np.sqrt(EI / (beam.density * beam.area * L**4))
    rotary = beam.inertia / (beam.area * L**2)

    def free_end(x: float) -> float:
        A = np.array(
            [
                [0.0, 1.0, 0.0, compliance],
                [0.0, 0.0, 1.0, 0.0],
                [0.0, -rotary * x * x, 0.0, -1.0],
                [-x * x, 0.0, 0.0, 0.0],
            ]
        )
        return float(np.linalg.det(expm(A)[2:, 2:]))

    # Euler-Bernoulli's spacing of lambda is pi; shear only lowers it. Steps of a tenth in lambda.
    found: list[float] = []
    lam = np.arange(0.5, (count + 1) * np.pi, 0.1)
    values = [free_end(x) for x in lam**2]
    for (x1, y1), (x2, y2) in pairwise(zip(lam**2, values, strict=True)):
        if y1 * y2 < 0.0:
            found.append(float(brentq(free_end, x1, x2, xtol=1e-12, rtol=1e-14)))
    return np.array([unit * x for x in found[:count]])
