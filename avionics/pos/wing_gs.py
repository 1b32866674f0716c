"""Distributed POS on the wing: method Gs online, the root IMU as master and the pods as slaves.

It needs neither camera nor start shape. Until a root IMU delivers, the root is taken to rest; where
one has delivered and is silent, nothing is measured. The wing's angles at the pods come out of the
filter; modal amplitudes are fitted to them.
"""

import math

import numpy as np
from numpy.typing import NDArray

from avionics.pos.attitude import right_jacobian, rotation_from_vector
from avionics.pos.flexure import Flexure
from avionics.pos.online import GsBank, GyroNoise
from avionics.wse.geometry import WingGeometry
from avionics.wse.gyro_estimator import Change
from avionics.wse.gyro_rates import GyroInputs
from avionics.wse.kinematics import euler_rate_matrix
from avionics.wse.settings import FilterSettings
from avionics.wse.state import Estimate

FloatArray = NDArray[np.float64]

# A root IMU that is away for longer is worth an event: as long as for any IMU.
SILENCE_NS = 250_000_000


class WingGs:
    """The Gs filters of one wing's pods, fed as samples come, asked at the ticks.

    Parameters
    ----------
    settings : FilterSettings
        Basis, stations, periods and noises, shared with the camera-aided filter.
    flexure : Flexure
        How a pod turns about the three axes of the line, the same law for every pod.
    rho_sigma : float
        Initial one-sigma of the constant part of the angles, rad.
    """

    def __init__(self, settings: FilterSettings, flexure: Flexure, rho_sigma: float) -> None:
        self._settings = settings
        self._period_ns = settings.step_ns
        self._dt = settings.step_ns * 1e-9
        self._flexure = flexure
        self._rho_sigma = rho_sigma
        self._noise = settings.gyro_noise / math.sqrt(self._dt)
        c, s = math.cos(settings.psi0), math.sin(settings.psi0)
        self._line_from_body = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        self._geometry = WingGeometry(settings.basis, settings.pods_s)
        self.inputs = GyroInputs(settings.rates, settings.pod_period_ns)
        self._bank: GsBank | None = None
        self._known_ns = 0
        self._live: tuple[bool, ...] = (False,) * len(settings.pods_s)
        self.has_master = False
        self._lost_ns: int | None = None
        self._is_reported = False
        self._back_ns = 0
        self._changes: list[Change] = []

    def restart(self) -> None:
        """Forget everything: the next samples are a new start."""
        self.inputs = GyroInputs(self._settings.rates, self._settings.pod_period_ns)
        self._bank = None
        self._lost_ns = None
        self._is_reported = False
        self._back_ns = 0

    def _begin(self, now_ns: int) -> GsBank | None:
        first = self.inputs.first_known_ns(now_ns)
        if first is None or not len(self._settings.pods_s):
            return None
        period = self._period_ns
        self._known_ns = -(-first // period) * period
        # One that fell silent before the pods began is the master all the same.
        self.has_master = self._has_root(0)
        master = "the root IMU" if self.has_master else "a root at rest (no root IMU samples)"
        self._changes.append(("info", f"distributed POS against {master}"))
        return self._new_bank()

    def _has_root(self, until_ns: int) -> bool:
        """Return whether the root IMU delivered at an instant, shortly before, or later."""
        return self.inputs.ahead(until_ns - self._period_ns, until_ns).body is not None

    def _new_bank(self) -> GsBank:
        master = 1.0 if self.has_master else 0.0
        gyros = GyroNoise(
            noise_m=master * self._noise,
            noise_s=self._noise,
            bias_m=master * self._settings.bias.sigma,
            bias_s=self._settings.bias.sigma,
            bias_walk=self._settings.bias.walk,
        )
        pods = len(self._settings.pods_s)
        return GsBank(pods, self._dt, self._flexure, gyros, self._rho_sigma)

    def advance(self, now_ns: int) -> list[Change]:
        """Run the filters over every step of the grid that is known at ``now_ns``.

        Returns
        -------
        list of (level, message)
            What there is to say of the master since the last call.
        """
        if self._bank is None:
            self._bank = self._begin(now_ns)
        if self._bank is not None:
            self._bank = self._run(self._bank, now_ns)
        changes, self._changes = self._changes, []
        return changes

    def _run(self, bank: GsBank, now_ns: int) -> GsBank:
        horizon = self.inputs.known_until(now_ns)
        if self._has_root(horizon):
            if not self.has_master:
                message = "a root IMU delivers, the root is not at rest; restarted against it"
                self._changes.append(("warning", message))
                self.has_master, self._back_ns = True, now_ns
                bank = self._new_bank()
            self._end_silence(now_ns)
        while self._known_ns + self._period_ns <= horizon:
            end = self._known_ns + self._period_ns
            step = self.inputs.ahead(self._known_ns, end)
            self._live = self.inputs.regime(self._known_ns, end).live
            root = self._root_rate(step.body)
            if root is None:
                bank.coast()
            else:
                bank.step(self._line_from_body @ root, step.rates, np.array(self._live))
            self._known_ns = end
        self._report_silence()
        self.inputs.forget(self._known_ns - 10 * self._period_ns)
        return bank

    def _root_rate(self, found: FloatArray | None) -> FloatArray | None:
        """Return the root's rate in the step from now; None where samples are missing."""
        if not self.has_master:
            return np.zeros(3)
        if found is None and self._lost_ns is None:
            self._lost_ns = self._known_ns
        return found if self._known_ns >= self._back_ns else None

    def _report_silence(self) -> None:
        if (
            self._lost_ns is None
            or self._is_reported
            or self._known_ns - self._lost_ns <= SILENCE_NS
        ):
            return
        message = "the root IMU is silent; angles grow uncertain until it is back"
        self._changes.append(("warning", message))
        self._is_reported = True

    def _end_silence(self, now_ns: int) -> None:
        """Measure again from now on: before now the root's rate is not known."""
        if self._lost_ns is None:
            return
        if self._is_reported:
            away_s = (now_ns - self._lost_ns) * 1e-9
            self._changes.append(("info", f"the root IMU is back after {away_s:.2f} s"))
        self._back_ns, self._lost_ns, self._is_reported = now_ns, None, False

    def estimate_at(self, tick_ns: int) -> Estimate | None:
        """Return amplitudes and biases at a tick with what is known; None before the start.

        Parameters
        ----------
        tick_ns : int
            Instant, ns; the flexure law carries the state there from the newest step.
        """
        if self._bank is None:
            return None
        steps = max(0, (tick_ns - self._known_ns) // self._period_ns)
        u, P = self._bank.ahead(steps)
        q, P_q = self._amplitudes(u, P)
        bias, sigma = self._bank.bias
        n = len(q)
        x = np.concatenate([q, bias.ravel()])
        whole = np.zeros((len(x), len(x)))
        whole[:n, :n] = P_q
        whole[range(n, len(x)), range(n, len(x))] = sigma.ravel() ** 2
        return Estimate(x, whole)

    def _amplitudes(self, u: FloatArray, P: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Fit the modes to the angles at the pods; what the pods do not see keeps its prior."""
        basis = self._settings.basis
        angles, slopes = station_angles(u)
        inverse = self._settings.rates.inverse(self._live)
        q = np.zeros(basis.count)
        q[basis.phi] = angles[:, 0] @ inverse.phi
        q[basis.theta] = angles[:, 1] @ inverse.theta
        if basis.inplane:
            q[basis.psi] = (angles[:, 2] - self._geometry.at(q).psi) @ inverse.psi
        to_q = np.zeros((basis.count, len(u), 3))
        families = (basis.phi, basis.theta, basis.psi)
        matrices = (inverse.phi, inverse.theta, inverse.psi)
        P_q = np.zeros((basis.count, basis.count))
        for axis, (family, matrix) in enumerate(zip(families, matrices, strict=True)):
            to_q[family, :, axis] = matrix.T
            if matrix.shape[1]:
                P_q[family, family] = (
                    inverse.unobserved[family, family] * self._settings.prior[family][0]
                )
        to_q = np.einsum("nma,mab->nmb", to_q, slopes)
        P_q += np.einsum("nma,mab,kmb->nk", to_q, P, to_q)
        return q, P_q


def station_angles(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (phi, theta, psi - psi0) of stations turned by u against the undeformed line.

    Parameters
    ----------
    u : ndarray, shape (M, 3)
        Rotation vectors: C_s^m = exp(u x), rad.

    Returns
    -------
    angles : ndarray, shape (M, 3)
        Of D = R1(phi) R2(theta) R3(psi), rad.
    slopes : ndarray, shape (M, 3, 3)
        Their derivatives by u.
    """
    C = rotation_from_vector(u)
    phi = np.arctan2(C[:, 2, 1], C[:, 2, 2])
    theta = -np.arcsin(np.clip(C[:, 2, 0], -1.0, 1.0))
    psi = np.arctan2(C[:, 1, 0], C[:, 0, 0])
    angles = np.stack([phi, theta, psi], axis=-1)
    slopes: FloatArray = euler_rate_matrix(phi, theta) @ right_jacobian(u)
    return angles, slopes
