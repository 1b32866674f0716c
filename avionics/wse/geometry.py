"""Shape of the wing from modal amplitudes: angles along the span, reference line, markers.

Body axes, right wing; a left wing is mirrored in y by whoever needs body points of it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from avionics.wse.attitude import sin_cos
from avionics.wse.modes import ModeBasis

Array = NDArray[Any]

# Sixteen nodes integrate a wing bent by one radian in three modes to 1e-9 m of its span.
QUADRATURE_NODES = 16


def gauss_nodes(span: float, count: int = QUADRATURE_NODES) -> Array:
    """Return the Gauss-Legendre nodes on [0, span], m, shape (count,)."""
    x, _ = legendre.leggauss(count)
    nodes: Array = 0.5 * span * (x + 1.0)
    return nodes


def integration_matrix(s: Array, span: float, count: int = QUADRATURE_NODES) -> Array:
    """Return the matrix that turns values at ``gauss_nodes`` into integrals from 0 to ``s``.

    Parameters
    ----------
    s : ndarray, shape (S,)
        Upper limits, m, within [0, span].
    span : float
        Length of the interval, m.
    count : int
        Number of nodes.

    Returns
    -------
    ndarray, shape (S, count)
        Exact for polynomials of degree below ``count``.

    Notes
    -----
    Discrete Legendre transform at the nodes, then the closed integral
    (P[k+1] - P[k-1]) / (2k + 1) of each polynomial.
    """
    x, weight = legendre.leggauss(count)
    order = np.arange(count)
    transform = (order[:, None] + 0.5) * legendre.legvander(x, count - 1).T * weight
    upper = legendre.legvander(2.0 * np.asarray(s) / span - 1.0, count)
    integral = np.empty((len(upper), count))
    integral[:, 0] = upper[:, 1] + 1.0
    integral[:, 1:] = (upper[:, 2:] - upper[:, :-2]) / (2 * order[1:] + 1)
    matrix: Array = 0.5 * span * integral @ transform
    return matrix


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """The wing at some stations; leading axes are those of the amplitudes.

    Attributes
    ----------
    phi, theta, psi : ndarray, shape (..., S)
        Local angles, rad.
    line : ndarray, shape (..., 3, S)
        Components of the reference line's points, body axes, m.
    offset : ndarray, shape (..., 3, S)
        Components of D^T (x, 0, z)^T of each station's point, m.
    tangent_at_nodes : ndarray, shape (..., 3, nodes)
        Components of the tangents at the quadrature nodes.
    """

    phi: Array
    theta: Array
    psi: Array
    line: Array
    offset: Array
    tangent_at_nodes: Array

    @property
    def r_in_body(self) -> Array:
        """Points of the reference line, m, shape (..., S, 3)."""
        return self.line.swapaxes(-1, -2)


class WingGeometry:
    """Line and section points at fixed stations as functions of the amplitudes.

    Parameters
    ----------
    basis : ModeBasis
        Mode shapes.
    s : ndarray, shape (S,)
        Stations, m.
    x, z : ndarray, shape (S,), optional
        Point of each station's section, local axes, m.
    psi0 : float
        Sweep at the root, rad.
    """

    def __init__(
        self,
        basis: ModeBasis,
        s: Array,
        *,
        x: Array | None = None,
        z: Array | None = None,
        psi0: float = 0.0,
    ) -> None:
        self.basis = basis
        self.s = np.asarray(s, dtype=np.float64)
        self._x = np.zeros_like(self.s) if x is None else np.asarray(x)
        self._z = np.zeros_like(self.s) if z is None else np.asarray(z)
        self._psi0 = psi0
        nodes = gauss_nodes(basis.span_m)
        self._nodes = len(nodes)
        self._to_stations = integration_matrix(self.s, basis.span_m).T.copy()
        everywhere = np.concatenate([nodes, self.s])
        self._to_everywhere = integration_matrix(everywhere, basis.span_m).T
        self._angles = _angle_matrix(basis, everywhere, nodes)
        self._has_twist = basis.twist > 0

    def at(self, q: Array) -> Shape:
        """Return the shape of amplitudes ``q``.

        Parameters
        ----------
        q : ndarray, shape (..., basis.count)
            Amplitudes, rad; may be complex (complex step).

        Notes
        -----
        psi' = theta' tan(phi) / cos(theta), the wing being stiff in its own plane, plus the
        in-plane modes; r_f(s) is the integral of the tangent D^T e_y.
        """
        n, everywhere = self._nodes, self._nodes + len(self.s)
        angles = q @ self._angles
        sines, cosines = sin_cos(angles[..., : 2 * everywhere])
        s_phi, s_theta = sines[..., :everywhere], sines[..., everywhere:]
        c_phi, c_theta = cosines[..., :everywhere], cosines[..., everywhere:]
        psi = angles[..., 2 * everywhere : 3 * everywhere] + self._psi0
        if self._has_twist:
            slope = angles[..., 3 * everywhere :]
            curvature = slope * s_phi[..., :n] / (c_phi[..., :n] * c_theta[..., :n])
            psi = psi + curvature @ self._to_everywhere
        s_psi, c_psi = sin_cos(psi)
        trigonometry = (s_phi, c_phi, s_theta, c_theta, s_psi, c_psi)
        tangent = _tangent(a[..., :n] for a in trigonometry)
        return Shape(
            angles[..., n:everywhere],
            angles[..., everywhere + n : 2 * everywhere],
            psi[..., n:],
            tangent @ self._to_stations,
            self._offset(a[..., n:] for a in trigonometry),
            tangent,
        )

    def _offset(self, trigonometry: Iterable[Array]) -> Array:
        """Components of D^T (x, 0, z)^T."""
        s_phi, c_phi, s_theta, c_theta, s_psi, c_psi = trigonometry
        x, z = self._x, self._z
        along = c_theta * x + c_phi * s_theta * z
        across = s_phi * z
        offset = np.empty((*s_phi.shape[:-1], 3, len(x)), dtype=s_phi.dtype)
        offset[..., 0, :] = c_psi * along + s_psi * across
        offset[..., 1, :] = s_psi * along - c_psi * across
        offset[..., 2, :] = c_phi * c_theta * z - s_theta * x
        return offset

    def points(self, q: Array) -> Array:
        """Return the section points of the stations in body axes, m, shape (..., S, 3)."""
        shape = self.at(q)
        points: Array = (shape.line + shape.offset).swapaxes(-1, -2)
        return points


def _tangent(trigonometry: Iterable[Array]) -> Array:
    """Components of t = D^T e_y, shape (..., 3, n)."""
    s_phi, c_phi, s_theta, c_theta, s_psi, c_psi = trigonometry
    both = s_phi * s_theta
    tangent = np.empty((*s_phi.shape[:-1], 3, s_phi.shape[-1]), dtype=s_phi.dtype)
    tangent[..., 0, :] = both * c_psi - c_phi * s_psi
    tangent[..., 1, :] = both * s_psi + c_phi * c_psi
    tangent[..., 2, :] = s_phi * c_theta
    return tangent


def _angle_matrix(basis: ModeBasis, everywhere: Array, nodes: Array) -> Array:
    """Amplitudes to phi, theta, in-plane psi everywhere, and theta' at the nodes."""
    size = len(everywhere)
    matrix = np.zeros((basis.count, 3 * size + len(nodes)))
    matrix[basis.phi, :size] = basis.shape(everywhere, basis.bending).T
    matrix[basis.theta, size : 2 * size] = basis.shape(everywhere, basis.twist).T
    matrix[basis.psi, 2 * size : 3 * size] = basis.shape(everywhere, basis.inplane).T
    matrix[basis.theta, 3 * size :] = basis.slope(nodes, basis.twist).T
    return matrix
