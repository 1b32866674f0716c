"""The flexible wing as a geometrically exact beam: what it is made of, and how it stands still.

Elements of constant strain, lumped section masses with offset and inertia, a full 4x4 stiffness
per element: no modal model, and nothing shared with the estimator's geometry. Left out: shear
and warping (the wing is slender), material non-linearity.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from avionics.errors import AvionicsError
from sim_bus.wing.rod_dynamics import (
    GUST,
    ROOT_FORCE,
    TIP_FOLLOW,
    TIP_FORCE,
    TIP_TORQUE,
    imbalance,
)
from sim_bus.wing.rod_mass import mass_matrix
from sim_bus.wing.rod_shape import along

FloatArray = NDArray[np.float64]
STRAINS = 4
STANDARD_GRAVITY_M_S2 = 9.80665


class BeamError(AvionicsError):
    """The simulated wing finds no equilibrium."""


@dataclass(frozen=True, slots=True, eq=False)
class Beam:
    """A beam clamped at its root.

    Attributes
    ----------
    length_m : ndarray, shape (N,)
        Element lengths from root to tip, m.
    stiffness : ndarray, shape (N, 4, 4)
        Section stiffness per element: axial (N), torsion, out-of-plane and in-plane bending
        (N m^2) and their couplings, about the local axes y, y, x, z.
    mass_kg : ndarray, shape (N + 1,)
        Mass lumped at each node, kg.
    cg_m : ndarray, shape (N + 1, 3)
        Its centre of gravity from the node, local axes, m.
    inertia_kg_m2 : ndarray, shape (N + 1, 3, 3)
        Its inertia about that centre, local axes.
    damping_s : float
        Structural damping proportional to stiffness: damping = damping_s * stiffness.
    psi0_rad : float
        Sweep of the root section.
    unstrained : ndarray, shape (N, 4)
        Strains of the unloaded shape.
    air : ndarray, shape (N + 1, 3)
        Aerodynamic strip of each node, see ``rod_dynamics.air_wrench``.
    """

    length_m: FloatArray
    stiffness: FloatArray
    mass_kg: FloatArray
    cg_m: FloatArray
    inertia_kg_m2: FloatArray
    damping_s: float = 0.0
    psi0_rad: float = 0.0
    unstrained: FloatArray = field(default_factory=lambda: np.zeros((0, STRAINS)))
    air: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        count = self.elements
        if self.unstrained.size == 0:
            object.__setattr__(self, "unstrained", np.zeros((count, STRAINS)))
        if self.air.size == 0:
            object.__setattr__(self, "air", np.zeros((count + 1, 3)))
        wanted = {
            "stiffness": (count, 4, 4), "mass_kg": (count + 1,), "cg_m": (count + 1, 3),
            "inertia_kg_m2": (count + 1, 3, 3), "unstrained": (count, 4), "air": (count + 1, 3),
        }  # fmt: skip
        for name, shape in wanted.items():
            found = getattr(self, name).shape
            if found != shape:
                msg = f"beam: {name} has shape {found}, wanted {shape}"
                raise ValueError(msg)

    @property
    def elements(self) -> int:
        """Number of elements N."""
        return int(self.length_m.size)

    @property
    def span_m(self) -> float:
        """Arc length from root to tip, m."""
        return float(self.length_m.sum())

    @property
    def root(self) -> FloatArray:
        """Body from local frame at the root, shape (9,), by rows."""
        c, s = np.cos(self.psi0_rad), np.sin(self.psi0_rad)
        return np.array([c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0])

    @property
    def body(self) -> FloatArray:
        """Node masses as the compiled code wants them, shape (N + 1, 13)."""
        count = self.elements + 1
        return np.concatenate(
            [self.mass_kg[:, None], self.cg_m, self.inertia_kg_m2.reshape(count, 9)], axis=1
        )

    @property
    def element_stiffness(self) -> FloatArray:
        """Stiffness times length, shape (N, 4, 4)."""
        return np.ascontiguousarray(self.stiffness * self.length_m[:, None, None])

    def drive(
        self,
        *,
        gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, 0.0),
        tip_force_n: tuple[float, float, float] = (0.0, 0.0, 0.0),
        tip_follow_n: tuple[float, float, float] = (0.0, 0.0, 0.0),
        tip_torque_nm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> FloatArray:
        """Return one row of the drive table: a root at rest and these loads.

        Parameters
        ----------
        gravity_m_s2, tip_force_n : tuple of float
            In body axes.
        tip_follow_n, tip_torque_nm : tuple of float
            In the axes of the tip's own section.
        """
        row = np.zeros(GUST + self.elements + 1)
        row[ROOT_FORCE : ROOT_FORCE + 3] = -np.array(gravity_m_s2)
        row[TIP_FORCE : TIP_FORCE + 3] = tip_force_n
        row[TIP_FOLLOW : TIP_FOLLOW + 3] = tip_follow_n
        row[TIP_TORQUE : TIP_TORQUE + 3] = tip_torque_nm
        return row

    def static(
        self, drive: FloatArray, start: FloatArray | None = None, *, load_steps: int = 10
    ) -> FloatArray:
        """Return the strains at rest, shape (N, 4).

        Parameters
        ----------
        drive : ndarray, shape (GUST + N + 1,)
            One row of the drive table.
        start : ndarray, shape (N, 4), optional
            Where to begin; with it the load is applied at once.
        load_steps : int
            Parts in which the load grows otherwise.

        Raises
        ------
        BeamError
            If Newton's iteration finds no equilibrium.
        """
        strain = self.unstrained.copy() if start is None else start.copy()
        for part in [1.0] if start is not None else np.linspace(1 / load_steps, 1, load_steps):
            strain = self._newton(strain, drive * part)
        return strain

    def _newton(self, strain: FloatArray, drive: FloatArray) -> FloatArray:
        scale = 1 / self.length_m[:, None]  # one element turned by one radian
        for _ in range(40):
            tangent = self.tangent(strain, drive)
            change = np.linalg.solve(tangent, self._residual(strain, drive).ravel())
            change = change.reshape(strain.shape)
            size = float(np.abs(change / scale).max())
            strain = strain - change * min(1.0, 0.3 / max(size, 1e-300))
            if size < 1e-12:
                return strain
        if size < 1e-9:
            return strain
        msg = f"beam: no equilibrium; the last correction was {size:.1e} rad in one element"
        raise BeamError(msg)

    def _residual(self, strain: FloatArray, drive: FloatArray) -> FloatArray:
        out, zero = np.zeros_like(strain), np.zeros_like(strain)
        scratch = np.zeros((5, self.elements + 1, 9))
        imbalance(
            strain, zero, zero, drive, self.root, self.length_m, self.body, self.air, out, scratch
        )
        elastic = np.einsum("nij,nj->ni", self.element_stiffness, strain - self.unstrained)
        return np.asarray(out + elastic)

    def tangent(self, strain: FloatArray, drive: FloatArray) -> FloatArray:
        """Return the tangent stiffness by central differences, shape (4 N, 4 N)."""
        size = strain.size
        columns = np.empty((size, size))
        step = 1e-6 / np.repeat(self.length_m, STRAINS)
        for k in range(size):
            ahead, behind = strain.copy(), strain.copy()
            ahead.flat[k] += step[k]
            behind.flat[k] -= step[k]
            difference = self._residual(ahead, drive) - self._residual(behind, drive)
            columns[:, k] = difference.ravel() / (2 * step[k])
        return columns

    def frequencies_hz(self, strain: FloatArray, drive: FloatArray) -> FloatArray:
        """Return the natural frequencies about an equilibrium, ascending, shape (4 N,), Hz."""
        mass = mass_matrix(strain, self.length_m, self.body)
        tangent = self.tangent(strain, drive)
        squares = eigh((tangent + tangent.T) / 2, (mass + mass.T) / 2, eigvals_only=True)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi))

    def place(self, s_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the element that holds each arc length, and the length inside it.

        Raises
        ------
        ValueError
            If a station lies off the beam.
        """
        ends = np.concatenate([[0.0], np.cumsum(self.length_m)])
        if s_m.size and (s_m.min() < 0 or s_m.max() > ends[-1] * (1 + 1e-9)):
            msg = f"station {s_m.min()} .. {s_m.max()} m lies off the beam, 0 .. {ends[-1]} m"
            raise ValueError(msg)
        element = np.clip(np.searchsorted(ends, s_m, side="right") - 1, 0, self.elements - 1)
        return element.astype(np.float64), s_m - ends[element]

    def shape(self, strain: FloatArray, s_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where stations are and how their sections stand.

        Parameters
        ----------
        strain : ndarray, shape (N, 4)
            Strains.
        s_m : ndarray, shape (S,)
            Arc lengths, m, ascending.

        Returns
        -------
        r_in_body_m : ndarray, shape (S, 3)
        D_body_from_local : ndarray, shape (S, 3, 3)
        """
        element, within = self.place(s_m)
        shape = (1, s_m.size, 3)
        position, rate, felt = np.empty(shape), np.empty(shape), np.empty(shape)
        frame = np.empty((1, s_m.size, 9))
        zero = np.zeros((1, *strain.shape))
        along(
            strain[None], zero, zero, np.zeros((1, 12)), self.root, self.length_m, element,
            within, position, frame, rate, felt,
        )  # fmt: skip
        return position[0], frame[0].reshape(-1, 3, 3)
