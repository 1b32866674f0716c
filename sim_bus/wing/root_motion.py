"""How the root of the simulated wing moves: angles and positions as sums of sines.

They are exactly differentiable, so that rates and accelerations need no numerical derivative.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_bus.wing.beam import STANDARD_GRAVITY_M_S2

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Swing:
    """One sine of one degree of freedom, faded in and out.

    Attributes
    ----------
    axis : int
        0 to 2: roll, pitch, yaw, rad; 3 to 5: north, east, down, m.
    amplitude, hz, phase_rad : float
        Of the sine.
    start_s, stop_s, fade_s : float
        When it acts; the amplitude rises and falls as a smooth step (C2) within ``fade_s``.
    """

    axis: int
    amplitude: float
    hz: float
    phase_rad: float
    start_s: float
    stop_s: float
    fade_s: float


def smooth_step(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the quintic from 0 to 1 on 0 <= x <= 1, and its first two derivatives by x."""
    x = np.clip(x, 0.0, 1.0)
    return (
        x**3 * (10 - 15 * x + 6 * x**2),
        30 * x**2 * (1 - x) ** 2,
        60 * x * (1 - x) * (1 - 2 * x),
    )


def _swing(swing: Swing, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    w = 2 * np.pi * swing.hz
    sine, cosine = np.sin(w * t_s + swing.phase_rad), np.cos(w * t_s + swing.phase_rad)
    up, up1, up2 = smooth_step((t_s - swing.start_s) / swing.fade_s)
    down, down1, down2 = smooth_step((swing.stop_s - t_s) / swing.fade_s)
    e = up * down
    e1 = (up1 * down - up * down1) / swing.fade_s
    e2 = (up2 * down - 2 * up1 * down1 + up * down2) / swing.fade_s**2
    a = swing.amplitude
    return (
        a * e * sine,
        a * (e1 * sine + e * w * cosine),
        a * (e2 * sine + 2 * e1 * w * cosine - e * w**2 * sine),
    )


@dataclass(frozen=True, slots=True)
class RootMotion:
    """The root's attitude (roll, pitch, yaw) and position over time."""

    swings: tuple[Swing, ...] = ()
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2

    def _coordinates(self, t_s: FloatArray) -> FloatArray:
        """Return coordinates and two derivatives, shape (3, 6, n)."""
        total = np.zeros((3, 6, t_s.size))
        for swing in self.swings:
            total[:, swing.axis] += np.array(_swing(swing, t_s))
        return total

    def attitude(self, t_s: FloatArray) -> FloatArray:
        """Return body from earth (north, east, down), shape (n, 3, 3)."""
        roll, pitch, yaw = self._coordinates(t_s)[0, :3]
        return _attitude(roll, pitch, yaw)

    def drive(self, t_s: FloatArray) -> FloatArray:
        """Return the root columns of the drive table.

        Parameters
        ----------
        t_s : ndarray, shape (n,)
            Instants, s.

        Returns
        -------
        ndarray, shape (n, 12)
            Body rate, its derivative, acceleration less gravity, velocity, body axes.
        """
        if not self.swings:
            still = np.zeros((t_s.size, 12))
            still[:, 8] = -self.gravity_m_s2
            return still
        x, v, a = self._coordinates(t_s)
        (roll, pitch, _), (dr, dp, dy), (ddr, ddp, ddy) = x[:3], v[:3], a[:3]
        cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
        rate = [dr - dy * sp, dp * cr + dy * cp * sr, -dp * sr + dy * cp * cr]
        turn = [
            ddr - ddy * sp - dy * cp * dp,
            ddp * cr - dp * sr * dr + ddy * cp * sr - dy * sp * dp * sr + dy * cp * cr * dr,
            -ddp * sr - dp * cr * dr + ddy * cp * cr - dy * sp * dp * cr - dy * cp * sr * dr,
        ]
        to_body = _attitude(*x[:3])
        felt = a[3:].T - np.array([0.0, 0.0, self.gravity_m_s2])
        return np.concatenate(
            [
                np.array(rate).T,
                np.array(turn).T,
                np.einsum("nij,nj->ni", to_body, felt),
                np.einsum("nij,nj->ni", to_body, v[3:].T),
            ],
            axis=1,
        )


def _attitude(roll: FloatArray, pitch: FloatArray, yaw: FloatArray) -> FloatArray:
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    rows = [
        [cp * cy, cp * sy, -sp],
        [sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp],
        [cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
