"""Stepping a chain of rod elements through time, compiled.

The generalised-alpha method (Chung and Hulbert, 1993) solves ``imbalance`` at every step; Newton's
iteration matrix is kept as long as it serves.
"""

import numpy as np

from sim_bus.wing.rod import compiled
from sim_bus.wing.rod_dynamics import FloatArray, imbalance
from sim_bus.wing.rod_mass import factor, mass_matrix, solve

# Steps that one factored matrix serves unless the iteration slows down before.
REFRESH_STEPS = 25


@compiled
def integrate(  # noqa: PLR0912, PLR0917 - compiled: positional arrays, one loop over time
    state: FloatArray,
    table: FloatArray,
    step_s: float,
    spectral_radius: float,
    root: FloatArray,
    length_m: FloatArray,
    body: FloatArray,
    air: FloatArray,
    stiffness: FloatArray,
    damping: FloatArray,
    unstrained: FloatArray,
    strains: FloatArray,
    speeds: FloatArray,
    accels: FloatArray,
) -> int:
    """Step through the rows of a drive table.

    Parameters
    ----------
    state : ndarray, shape (3, N, 4)
        Strains, rates and accelerations at the first row.
    table : ndarray, shape (n + 1, GUST + N + 1)
        Drive at the start and after each of n steps; linear in between.
    step_s, spectral_radius : float
        Step, and the damping of what it cannot resolve (1: none).
    root, length_m, body, air
        See ``imbalance``.
    stiffness, damping : ndarray, shape (N, 4, 4)
        Length times section stiffness, and its viscous counterpart.
    unstrained : ndarray, shape (N, 4)
        Strains at which the elastic forces vanish.
    strains, speeds, accels : ndarray, shape (n, N, 4)
        Receive the states after each step.

    Returns
    -------
    int
        Number of steps done; less than n where Newton's iteration found no solution.
    """
    count, steps = length_m.size, table.shape[0] - 1
    alpha_m = (2 * spectral_radius - 1) / (spectral_radius + 1)
    alpha_f = spectral_radius / (spectral_radius + 1)
    gamma = 0.5 - alpha_m + alpha_f
    beta = 0.25 * (1 - alpha_m + alpha_f) ** 2
    q, v, a = state[0].copy(), state[1].copy(), state[2].copy()
    work_space, out = np.zeros((5, count + 1, 9)), np.zeros((count, 4))
    lower, age = np.zeros((4 * count, 4 * count)), 1 << 30
    for n in range(steps):
        drive = (1 - alpha_f) * table[n + 1] + alpha_f * table[n]
        a_new = a.copy()
        is_solved = False
        for attempt in range(2):
            if age > REFRESH_STEPS or attempt == 1:
                lower, age = (1 - alpha_m) * mass_matrix(q, length_m, body), 0
                for i in range(count):
                    c = 4 * i
                    lower[c : c + 4, c : c + 4] += (1 - alpha_f) * (
                        beta * step_s**2 * stiffness[i] + gamma * step_s * damping[i]
                    )
                factor(lower)
            for trial in range(12):
                q_new = q + step_s * v + step_s**2 * ((0.5 - beta) * a + beta * a_new)
                v_new = v + step_s * ((1 - gamma) * a + gamma * a_new)
                q_mid = (1 - alpha_f) * q_new + alpha_f * q
                v_mid = (1 - alpha_f) * v_new + alpha_f * v
                a_mid = (1 - alpha_m) * a_new + alpha_m * a
                imbalance(q_mid, v_mid, a_mid, drive, root, length_m, body, air, out, work_space)
                for i in range(count):
                    out[i] += stiffness[i] @ (q_mid[i] - unstrained[i]) + damping[i] @ v_mid[i]
                change = out.copy()
                solve(lower, change.reshape(4 * count))
                a_new -= change
                size = 0.0
                for i in range(count):
                    for k in range(4):
                        size = max(size, abs(change[i, k]) * length_m[i])
                if size * beta * step_s**2 < 1e-10:
                    is_solved = True
                    break
                if not size < 1e12:
                    break
                if trial == 5 and attempt == 0 and age > 0:
                    break
            if is_solved:
                break
            a_new = a.copy()
        if not is_solved:
            return n
        q = q + step_s * v + step_s**2 * ((0.5 - beta) * a + beta * a_new)
        v = v + step_s * ((1 - gamma) * a + gamma * a_new)
        a = a_new
        age += 1
        strains[n], speeds[n], accels[n] = q, v, a
    return int(steps)
