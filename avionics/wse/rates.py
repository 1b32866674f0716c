"""Rates of the modal amplitudes from the gyros of all pods."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.attitude import sin_cos
from avionics.wse.geometry import gauss_nodes, integration_matrix
from avionics.wse.kinematics import modal_inverse, turned
from avionics.wse.modes import ModeBasis
from avionics.wse.one_mode import PodWeights

Array = NDArray[Any]

# Modes beyond the basis whose rates disturb those within.
MODES_BEYOND = 4


@dataclass(frozen=True, slots=True, eq=False)
class LiveInverse:
    """Modal inverses for one set of live pods; columns of silent pods are zero.

    Attributes
    ----------
    phi, theta, psi : ndarray, shapes (M, N), (M, Nt), (M, Np)
        Transposed inverses: ``rates_at_pods @ phi``.
    unobserved : ndarray, shape (count, count)
        Covariance of the errors of the modal rates while every family's first amplitude moves
        with unit variance: what the live pods leave undetermined, and what modes beyond the
        basis add to their rates. Blocks by family.
    one_mode : tuple of PodWeights, or None
        The live pods for ``one_mode``; None where there is more than a mode of each kind.
    whole : ndarray, shape (3M, count)
        All three for the angle rates (phi, theta, psi) pod by pod.
    psi_from_nodes : ndarray, shape (nodes, Np)
        In-plane rates from what bending and twist turn at the nodes.
    """

    phi: Array
    theta: Array
    psi: Array
    unobserved: Array
    one_mode: tuple[PodWeights, ...] | None
    whole: Array
    psi_from_nodes: Array


class ModalRates:
    """phi(x, u) of Srikanth et al.: rates of the amplitudes from the gyros, Eqs. 6 and 7.

    Parameters
    ----------
    basis : ModeBasis
        Mode shapes.
    s : ndarray, shape (M,)
        Stations of the pods, m.
    prior : ndarray, shape (count,)
        Prior variances of the amplitudes, relative.
    psi0 : float
        Sweep at the root, rad; matters only where the root turns.
    """

    def __init__(self, basis: ModeBasis, s: Array, prior: Array, *, psi0: float = 0.0) -> None:
        self.basis = basis
        self.pods = len(s)
        self._prior = prior
        self._s = np.asarray(s, dtype=np.float64)
        self._first = basis.shape(self._s, 1)[:, 0].tolist()
        self._shapes = tuple(basis.shape(s, n) for n in (basis.bending, basis.twist, basis.inplane))
        self._inverses: dict[tuple[bool, ...], LiveInverse] = {}
        self._psi0 = psi0
        self._is_one_mode = (basis.bending, basis.twist, basis.inplane) == (1, 1, 0)
        self._psi_at_pods = np.zeros((basis.count, self.pods))
        self._psi_at_pods[basis.psi] = self._shapes[2].T
        nodes = gauss_nodes(basis.span_m)
        phi, theta = basis.shape(nodes, basis.bending).T, basis.shape(nodes, basis.twist).T
        slope = basis.slope(nodes, basis.twist).T
        # Columns: phi at pods and nodes, theta at pods and nodes, theta' at the nodes.
        size = self._size = self.pods + len(nodes)
        self._angles = np.zeros((basis.count, 2 * size + len(nodes)))
        self._angles[basis.phi, :size] = np.hstack([self._shapes[0].T, phi])
        self._angles[basis.theta, size : 2 * size] = np.hstack([self._shapes[1].T, theta])
        self._angles[basis.theta, 2 * size :] = slope
        self._phi_at_nodes = phi
        self._theta_and_slope_at_nodes = np.hstack([theta, slope])
        # Rates of phi, theta and theta' at the nodes from those of all amplitudes.
        self._rates_at_nodes = np.zeros((basis.count, 3 * len(nodes)))
        self._rates_at_nodes[basis.phi, : len(nodes)] = phi
        self._rates_at_nodes[basis.theta, len(nodes) :] = self._theta_and_slope_at_nodes
        self._to_pods = integration_matrix(s, basis.span_m).T
        # Without in-plane modes and a turning root only the angles at the pods are needed.
        self._at_pods = np.hstack(
            [self._angles[:, : self.pods], self._angles[:, size : size + self.pods]]
        )

    def inverse(self, live: tuple[bool, ...]) -> LiveInverse:
        """Return the modal inverses while the pods marked ``live`` deliver."""
        found = self._inverses.get(live)
        if found is None:
            found = self._inverses[live] = self._make_inverse(np.array(live, dtype=bool))
        return found

    def _make_inverse(self, live: Array) -> LiveInverse:
        basis = self.basis
        unobserved = np.zeros((basis.count, basis.count))
        inverses = []
        families = (basis.phi, basis.theta, basis.psi)
        for family, shapes in zip(families, self._shapes, strict=True):
            count = shapes.shape[1]
            prior = self._prior[family]
            inverse = np.zeros((self.pods, count))
            inverse[live] = modal_inverse(shapes[live], prior).T
            inverses.append(inverse)
            if count:
                every = basis.shape(self._s, count + MODES_BEYOND)
                variance = prior[0] * (2.0 * np.arange(1, every.shape[1] + 1) - 1.0) ** -2
                variance[:count] = prior
                wrong = np.eye(count, every.shape[1]) - inverse.T @ every
                unobserved[family, family] = (wrong * (variance / prior[0])) @ wrong.T
        phi, theta, psi = inverses
        whole = np.zeros((self.pods, 3, basis.count))
        for axis, (family, inverse) in enumerate(zip(families, inverses, strict=True)):
            whole[:, axis, family] = inverse
        one_mode = self._one_mode(live, phi, theta) if self._is_one_mode else None
        by_pod = whole.reshape(-1, basis.count)
        return LiveInverse(phi, theta, psi, unobserved, one_mode, by_pod, self._to_pods @ psi)

    def _one_mode(self, live: Array, phi: Array, theta: Array) -> tuple[PodWeights, ...]:
        columns = (self._shapes[0], self._shapes[1], phi, theta)
        numbers = zip(*(column[:, 0].tolist() for column in columns), strict=True)
        every = (PodWeights(3 * i, *of_pod) for i, of_pod in enumerate(numbers))
        return tuple(pod for pod, is_live in zip(every, live, strict=True) if is_live)

    def activity(self, rates: Array, live: tuple[bool, ...]) -> Array | None:
        """Return the mean square rate of each family's first amplitude that pods' rates suggest.

        Parameters
        ----------
        rates : ndarray, shape (M, 3)
            Rates of the pods, local axes, rad/s.
        live : tuple of bool
            Which count.

        Returns
        -------
        ndarray, shape (3,), or None
            Bending, twist, in-plane, (rad/s)^2; None without live pods. Twist and in-plane
            rates appear in two axes of a bent wing and are not told apart here.
        """
        count = sum(live)
        if count == 0:
            return None
        size = p = q = r = 0.0
        pods = zip(live, self._first, rates.tolist(), strict=True)
        for is_live, first, (p_pod, q_pod, r_pod) in pods:
            if is_live:
                size += first * first
                p += p_pod * p_pod
                q += q_pod * q_pod
                r += r_pod * r_pod
        weight = 1.0 / max(size, 1e-3 * count)
        return np.array([p, q + r, q + r]) * weight

    def __call__(
        self, q: Array, omega: Array, inverse: LiveInverse, body: Array | None = None
    ) -> Array:
        """Return the rates of the amplitudes.

        Parameters
        ----------
        q : ndarray, shape (..., count)
            Amplitudes, rad; may be complex.
        omega : ndarray, shape (..., M, 3)
            Rates of the pods, local axes, rad/s; may be complex.
        inverse : LiveInverse
            For the pods that are live.
        body : ndarray, shape (..., 3), optional
            Rate of the body, body axes, rad/s; taken from the pods' rates.

        Returns
        -------
        ndarray, shape (..., count)
            rad/s.
        """
        if body is None and q.ndim == 1 and self.basis.inplane and self.basis.twist:
            return self._one(q, omega, inverse)
        if body is None and (self.basis.inplane == 0 or self.basis.twist == 0):
            s, c = sin_cos(q @ self._at_pods)
            m = self.pods
            parts = _Angles(s[..., :m], c[..., :m], s[..., m:], c[..., m:], s[..., :0])
        else:
            size = self._size
            angles = q @ self._angles
            s, c = sin_cos(angles[..., : 2 * size])
            parts = _Angles(
                s[..., :size],
                c[..., :size],
                s[..., size:],
                c[..., size:],
                angles[..., 2 * size :],
            )
        return self._modal(q, omega, inverse, body, parts)

    def _one(self, q: Array, omega: Array, inverse: LiveInverse) -> Array:
        """All three families of one set of amplitudes with the fewest array calls."""
        m, size = self.pods, self._size
        angles = q @ self._angles
        s, c = np.sin(angles[: 2 * size]), np.cos(angles[: 2 * size])
        at_pods = []
        pods = (s[:m], c[:m], s[size : size + m], c[size : size + m], omega)
        numbers = zip(*(array.tolist() for array in pods), strict=True)
        for s_phi, c_phi, s_theta, c_theta, (p, q_rate, r) in numbers:
            psi_rate = (s_phi * q_rate + c_phi * r) / c_theta
            at_pods += [p + s_theta * psi_rate, c_phi * q_rate - s_phi * r, psi_rate]
        rates: Array = np.array(at_pods) @ inverse.whole
        nodes = size - m
        phi_rate, theta_rate, slope_rate = (rates @ self._rates_at_nodes).reshape(3, nodes)
        tan = s / c
        tan_phi, tan_theta = tan[m:size], tan[size + m :]
        bent = theta_rate * tan_theta * tan_phi + phi_rate * (1.0 + tan_phi * tan_phi)
        turning = (angles[2 * size :] * bent + tan_phi * slope_rate) / c[size + m :]
        rates[self.basis.psi] -= turning @ inverse.psi_from_nodes
        return rates

    def _modal(
        self, q: Array, omega: Array, inverse: LiveInverse, body: Array | None, at: "_Angles"
    ) -> Array:
        m = self.pods
        s_phi, c_phi = at.s_phi[..., :m], at.c_phi[..., :m]
        s_theta, c_theta = at.s_theta[..., :m], at.c_theta[..., :m]
        if body is not None:
            psi = q @ self._psi_at_pods + self._psi0 + self._constrained_psi(at)
            omega = omega - turned(body, s_phi, c_phi, s_theta, c_theta, *sin_cos(psi))
        p, q_rate, r = omega[..., 0], omega[..., 1], omega[..., 2]
        d_psi = (s_phi * q_rate + c_phi * r) / c_theta
        d_phi = (p + s_theta * d_psi) @ inverse.phi
        d_theta = (c_phi * q_rate - s_phi * r) @ inverse.theta
        if self.basis.inplane == 0:
            return np.concatenate([d_phi, d_theta], axis=-1)
        if self.basis.twist:
            d_psi = d_psi - self._constrained_psi_rate(at, d_phi, d_theta)
        return np.concatenate([d_phi, d_theta, d_psi @ inverse.psi], axis=-1)

    def _constrained_psi(self, at: "_Angles") -> Array:
        """Integral of theta' tan(phi) / cos(theta) to the pods."""
        m = self.pods
        curvature = at.slope * at.s_phi[..., m:] / (at.c_phi[..., m:] * at.c_theta[..., m:])
        psi: Array = curvature @ self._to_pods
        return psi

    def _constrained_psi_rate(self, at: "_Angles", d_phi: Array, d_theta: Array) -> Array:
        """Time derivative of that integral."""
        m = self.pods
        s_phi, c_phi = at.s_phi[..., m:], at.c_phi[..., m:]
        s_theta, c_theta = at.s_theta[..., m:], at.c_theta[..., m:]
        phi_rate = d_phi @ self._phi_at_nodes
        theta_rates = d_theta @ self._theta_and_slope_at_nodes
        nodes = self._size - m
        theta_rate, slope_rate = theta_rates[..., :nodes], theta_rates[..., nodes:]
        integrand = (
            s_phi * c_phi * (slope_rate + at.slope * theta_rate * (s_theta / c_theta))
            + at.slope * phi_rate
        ) / (c_phi * c_phi * c_theta)
        rate: Array = integrand @ self._to_pods
        return rate


@dataclass(frozen=True, slots=True, eq=False)
class _Angles:
    """Sines and cosines at the pods and then the nodes; theta' at the nodes."""

    s_phi: Array
    c_phi: Array
    s_theta: Array
    c_theta: Array
    slope: Array
