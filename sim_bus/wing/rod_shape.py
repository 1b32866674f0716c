"""Where stations of a chain of rods are, how they turn and what they feel, compiled."""

from sim_bus.wing.rod import (
    chain,
    compiled,
    cross,
    plus,
    pose,
    rates,
    times,
    turn,
    turn_back,
)
from sim_bus.wing.rod_dynamics import (
    ROOT_FORCE,
    ROOT_RATE,
    ROOT_TURN,
    FloatArray,
    put3,
    put9,
    row3,
)


@compiled
def along(  # noqa: PLR0917 - compiled: positional arrays
    strain: FloatArray,
    speed: FloatArray,
    accel: FloatArray,
    drive: FloatArray,
    root: FloatArray,
    length_m: FloatArray,
    element: FloatArray,
    within_m: FloatArray,
    position: FloatArray,
    frame: FloatArray,
    rate: FloatArray,
    felt: FloatArray,
) -> None:
    """Store the motion of stations at every one of many instants.

    Parameters
    ----------
    strain, speed, accel : ndarray, shape (n, N, 4)
        Strains and their derivatives at the instants.
    drive : ndarray, shape (n, 12)
        Motion of the root (the first columns of the drive table).
    root : ndarray, shape (9,)
        Body from local frame at the root, by rows.
    length_m : ndarray, shape (N,)
        Element lengths.
    element, within_m : ndarray, shape (S,)
        Number of the element that holds each station, ascending, and the arc length inside it.
    position : ndarray, shape (n, S, 3)
        Receives the stations in body axes, m.
    frame : ndarray, shape (n, S, 9)
        Receives body from local, by rows.
    rate, felt : ndarray, shape (n, S, 3)
        Receive the inertial angular rate and the specific force at the line, local axes.
    """
    r0 = (root[0], root[1], root[2], root[3], root[4], root[5], root[6], root[7], root[8])
    for n in range(strain.shape[0]):
        r, at = r0, (0.0, 0.0, 0.0)
        w = turn_back(r0, row3(drive, n, ROOT_RATE))
        wd = turn_back(r0, row3(drive, n, ROOT_TURN))
        f = turn_back(r0, row3(drive, n, ROOT_FORCE))
        reached = 0
        for j in range(element.size):
            i_last = int(element[j])
            # Whole elements up to the one that holds the station are kept; the part is not.
            for i in range(reached, i_last + 1):
                el = length_m[i] if i < i_last else within_m[j]
                phi = (el * strain[n, i, 2], el * strain[n, i, 1], el * strain[n, i, 3])
                dphi = (el * speed[n, i, 2], el * speed[n, i, 1], el * speed[n, i, 3])
                ddphi = (el * accel[n, i, 2], el * accel[n, i, 1], el * accel[n, i, 3])
                stretch = (el * (1 + strain[n, i, 0]), el * speed[n, i, 0], el * accel[n, i, 0])
                p, d = pose(phi, stretch[0])
                spin, spin_dot, d_dot, d_ddot = rates(phi, dphi, ddphi, stretch)
                f_far = plus(
                    plus(f, cross(wd, d)),
                    plus(cross(w, plus(cross(w, d), times(2.0, d_dot))), d_ddot),
                )
                f_far = turn_back(p, f_far)
                carried = turn_back(p, w)
                wd_far = plus(plus(turn_back(p, wd), spin_dot), cross(carried, spin))
                w_far = plus(carried, spin)
                at_far, r_far = plus(at, turn(r, d)), chain(r, p)
                if i < i_last:
                    r, at, w, wd, f = r_far, at_far, w_far, wd_far, f_far
                else:
                    put3(position[n], j, at_far)
                    put9(frame[n], j, r_far)
                    put3(rate[n], j, w_far)
                    put3(felt[n], j, f_far)
            reached = i_last


@compiled
def between(  # noqa: PLR0917 - compiled: positional arrays
    history: FloatArray,
    step: FloatArray,
    step_s: float,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
) -> None:
    """Store strains, rates and accelerations at instants between the steps of a block.

    Strains follow the cubic through both ends of a step, and rates are its derivative: what a
    gyro integrates to is exactly how the shape changes. Accelerations are linear in between.

    Parameters
    ----------
    history : ndarray, shape (3, rows + 1, N, 4)
        Strains, rates and accelerations at the steps of a block.
    step : ndarray, shape (n,)
        Instants in steps from the block's start.
    step_s : float
        Length of a step, s.
    q, v, a : ndarray, shape (n, N, 4)
        Receive the result.
    """
    last = history.shape[1] - 2
    for n in range(step.size):
        k = min(max(int(step[n]), 0), last)
        x = step[n] - k
        for i in range(q.shape[1]):
            for j in range(4):
                q0, v0, a0 = history[0, k, i, j], history[1, k, i, j], history[2, k, i, j]
                q1, v1, a1 = (
                    history[0, k + 1, i, j],
                    history[1, k + 1, i, j],
                    history[2, k + 1, i, j],
                )
                b = 3 * (q1 - q0) - step_s * (2 * v0 + v1)
                c = step_s * (v0 + v1) - 2 * (q1 - q0)
                q[n, i, j] = q0 + x * (step_s * v0 + x * (b + x * c))
                v[n, i, j] = v0 + x * (2 * b + 3 * x * c) / step_s
                a[n, i, j] = a0 + x * (a1 - a0)
