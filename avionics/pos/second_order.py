"""What the linearisation of the difference filters leaves out, counted as measurement noise."""

from avionics.pos.compiled import Array, compiled
from avionics.pos.difference_model import RATE, RHO, THETA, Layout, Switches


@compiled
def second_order_variance(
    x: Array, P: Array, r0: Array, dt: float, at: Layout, how: Switches, out: Array
) -> None:
    """Write the variance of what the linearisation leaves out, shape (6,): gyros, forces.

    Parameters
    ----------
    x, P : ndarray, shapes (n,), (n, n)
        Predicted state and covariance.
    r0 : ndarray, shape (3,)
        Lever arm, m.
    dt : float
        Step, s.
    at, how : Layout, Switches
        The variant.
    out : ndarray, shape (6,)
        Result, (rad/s)^2 and (m/s^2)^2.

    Notes
    -----
    An error du of the angle multiplies the flexure's motion: du x theta_dot / 2 in the gyros,
    du x d(r_ddot) in the accelerometers of a flexing arm. While du is large this is
    several times the sensor noise, and a filter that ignores it grows certain of a wrong angle.
    Var (a x b)_i of independent a and b, as in the second-order filter.
    """
    c, scale = (at.d_theta, 0.5 / dt) if at.d_theta >= 0 else (RATE, 0.5)
    part = 0.0 if at.force_bias_m >= 0 else 1.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = (
            scale
            * scale
            * (
                _angle_variance(P, j, j) * (P[c + k, c + k] + part * x[c + k] * x[c + k])
                + _angle_variance(P, k, k) * (P[c + j, c + j] + part * x[c + j] * x[c + j])
                - 2.0 * _angle_variance(P, j, k) * (P[c + j, c + k] + part * x[c + j] * x[c + k])
            )
        )
        out[3 + i] = 0.0
    if how.arm_model:
        c, scale = at.d_rate, 1.0 / (dt * dt)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            out[3 + i] = scale * (
                _angle_variance(P, j, j) * _arm_variance(P, c, r0, k, k)
                + _angle_variance(P, k, k) * _arm_variance(P, c, r0, j, j)
                - 2.0 * _angle_variance(P, j, k) * _arm_variance(P, c, r0, j, k)
            )


@compiled
def _angle_variance(P: Array, i: int, j: int) -> float:
    """Covariance of u_i and u_j."""
    return float(
        P[RHO + i, RHO + j]
        + P[RHO + i, THETA + j]
        + P[THETA + i, RHO + j]
        + P[THETA + i, THETA + j]
    )


@compiled
def _arm_variance(P: Array, c: int, r: Array, i: int, j: int) -> float:
    """Covariance of components i and j of (increment of theta_dot) x r."""
    i1, i2, j1, j2 = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
    return float(
        P[c + i1, c + j1] * r[i2] * r[j2]
        - P[c + i1, c + j2] * r[i2] * r[j1]
        - P[c + i2, c + j1] * r[i1] * r[j2]
        + P[c + i2, c + j2] * r[i1] * r[j1]
    )
