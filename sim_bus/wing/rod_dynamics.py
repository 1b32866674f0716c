"""Inverse dynamics of a chain of rod elements, compiled.

``imbalance`` returns by how much strains, their rates and accelerations miss the equations of
motion: one pass out along the chain for the motion, one pass back for the forces, cost linear in
the elements.
"""

import numpy as np
from numpy.typing import NDArray

from sim_bus.wing.rod import (
    Matrix,
    Vector,
    chain,
    compiled,
    cross,
    dot,
    plus,
    pose,
    rates,
    times,
    turn,
    turn_back,
    work,
)

FloatArray = NDArray[np.float64]

# Columns of the table that drives a flight, one row per step; all vectors in body axes.
ROOT_RATE, ROOT_TURN, ROOT_FORCE, ROOT_VELOCITY = 0, 3, 6, 9
TIP_FORCE, TIP_FOLLOW, TIP_TORQUE = 12, 15, 18
GUIDE, HANDLE, HANDLE_SPEED, HOLD, DAMP = 21, 24, 25, 26, 27
AIRSPEED = 28
GUST = 29
"""Root: rate, its derivative, acceleration less gravity, velocity. Tip: force fixed in the body,
force fixed in the tip's section, torque fixed in it. Handle: unit vector along which a rod holds
the tip (it is free across), coordinate and speed of the rod's far end along it, stiffness (N/m)
and damping (N s/m). Airspeed; downward gust at every node."""


@compiled
def row3(table: FloatArray, row: int, column: int) -> Vector:
    """Return three numbers of a table."""
    return (table[row, column], table[row, column + 1], table[row, column + 2])


@compiled
def put3(table: FloatArray, row: int, value: Vector) -> None:
    """Store three numbers as a row."""
    table[row, 0], table[row, 1], table[row, 2] = value[0], value[1], value[2]


@compiled
def row9(table: FloatArray, row: int) -> Matrix:
    """Return nine numbers of a table."""
    t = table[row]
    return (t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7], t[8])


@compiled
def put9(table: FloatArray, row: int, value: Matrix) -> None:
    """Store nine numbers as a row."""
    for k in range(9):
        table[row, k] = value[k]


@compiled
def section_wrench(
    body: FloatArray, node: int, rate: Vector, turn_rate: Vector, felt: Vector
) -> tuple[Vector, Vector]:
    """Return the inertial force and moment (about the node) of one node's mass, local axes.

    ``body`` rows: mass, centre of gravity (3), inertia about it (9); ``felt`` is the node's
    acceleration less gravity.
    """
    row = body[node]
    mass, arm = row[0], (row[1], row[2], row[3])
    inertia = (row[4], row[5], row[6], row[7], row[8], row[9], row[10], row[11], row[12])
    at_cg = plus(felt, plus(cross(turn_rate, arm), cross(rate, cross(rate, arm))))
    force = times(mass, at_cg)
    spin = plus(turn(inertia, turn_rate), cross(rate, turn(inertia, rate)))
    return force, plus(spin, cross(arm, force))


@compiled
def air_wrench(
    air: FloatArray, node: int, velocity_z: float, nose_up: float, drive: FloatArray
) -> tuple[Vector, Vector]:
    """Return the quasi-steady strip force and moment on a node, local axes.

    ``air`` rows: lift per unit of normal velocity per airspeed (kg/m: half density times chord
    times lift slope times width), lift centre ahead of the line (m), still-air damping (N s/m).
    """
    normal = velocity_z - drive[GUST + node]
    lift = air[node, 0] * drive[AIRSPEED] * (normal + drive[AIRSPEED] * nose_up)
    return (0.0, 0.0, -lift - air[node, 2] * normal), (0.0, air[node, 1] * lift, 0.0)


@compiled
def imbalance(  # noqa: PLR0915, PLR0917 - one pass, compiled: positional arrays, no calls wasted
    strain: FloatArray,
    speed: FloatArray,
    accel: FloatArray,
    drive: FloatArray,
    root: FloatArray,
    length_m: FloatArray,
    body: FloatArray,
    air: FloatArray,
    out: FloatArray,
    work_space: FloatArray,
) -> None:
    """Store inertial less external generalised forces, shape (N, 4), in ``out``.

    Parameters
    ----------
    strain, speed, accel : ndarray, shape (N, 4)
        Strains (axial, torsion, out of plane, in plane) and their time derivatives.
    drive : ndarray, shape (GUST + N + 1,)
        One row of the drive table.
    root : ndarray, shape (9,)
        Body from local frame at the root, by rows.
    length_m : ndarray, shape (N,)
        Element lengths.
    body, air : ndarray, shapes (N + 1, 13), (N + 1, 3)
        See ``section_wrench`` and ``air_wrench``.
    out : ndarray, shape (N, 4)
        Receives the result; elastic and structural damping forces are not in it.
    work_space : ndarray, shape (5, N + 1, 9)
        Scratch.
    """
    count = length_m.size
    turned, reach, frame = work_space[0], work_space[1], work_space[2]
    force, moment = work_space[3], work_space[4]
    one = drive.reshape(1, -1)
    r0 = (root[0], root[1], root[2], root[3], root[4], root[5], root[6], root[7], root[8])
    rate, turn_rate = turn_back(r0, row3(one, 0, ROOT_RATE)), turn_back(r0, row3(one, 0, ROOT_TURN))
    feel, velocity = (
        turn_back(r0, row3(one, 0, ROOT_FORCE)),
        turn_back(r0, row3(one, 0, ROOT_VELOCITY)),
    )
    at: Vector = (0.0, 0.0, 0.0)
    put9(frame, 0, r0)
    f, m = section_wrench(body, 0, rate, turn_rate, feel)
    put3(force, 0, f)
    put3(moment, 0, m)
    for i in range(count):
        el = length_m[i]
        phi = (el * strain[i, 2], el * strain[i, 1], el * strain[i, 3])
        dphi = (el * speed[i, 2], el * speed[i, 1], el * speed[i, 3])
        ddphi = (el * accel[i, 2], el * accel[i, 1], el * accel[i, 3])
        stretch = (el * (1 + strain[i, 0]), el * speed[i, 0], el * accel[i, 0])
        p, d = pose(phi, stretch[0])
        spin, spin_dot, d_dot, d_ddot = rates(phi, dphi, ddphi, stretch)
        feel = plus(
            plus(feel, cross(turn_rate, d)),
            plus(cross(rate, plus(cross(rate, d), times(2.0, d_dot))), d_ddot),
        )
        velocity = turn_back(p, plus(velocity, plus(cross(rate, d), d_dot)))
        feel = turn_back(p, feel)
        carried = turn_back(p, rate)
        turn_rate = plus(plus(turn_back(p, turn_rate), spin_dot), cross(carried, spin))
        rate = plus(carried, spin)
        at = plus(at, turn(row9(frame, i), d))
        put9(turned, i, p)
        put3(reach, i, d)
        put9(frame, i + 1, chain(row9(frame, i), p))
        f, m = section_wrench(body, i + 1, rate, turn_rate, feel)
        fa, ma = air_wrench(air, i + 1, velocity[2], -frame[i + 1, 6], drive)
        put3(force, i + 1, plus(f, times(-1.0, fa)))
        put3(moment, i + 1, plus(m, times(-1.0, ma)))
    tip = row9(frame, count)
    pull = row3(one, 0, TIP_FORCE)
    if drive[HOLD] > 0 or drive[DAMP] > 0:
        # The velocity in ``velocity`` is inertial; the handle moves with the body.
        origin = turn_back(tip, row3(one, 0, ROOT_VELOCITY))
        swing = turn_back(tip, cross(row3(one, 0, ROOT_RATE), at))
        own = turn(tip, plus(velocity, times(-1.0, plus(origin, swing))))
        guide = row3(one, 0, GUIDE)
        away, slip = drive[HANDLE] - dot(guide, at), drive[HANDLE_SPEED] - dot(guide, own)
        pull = plus(pull, times(drive[HOLD] * away + drive[DAMP] * slip, guide))
    pull = plus(turn_back(tip, pull), row3(one, 0, TIP_FOLLOW))
    put3(force, count, plus(row3(force, count, 0), times(-1.0, pull)))
    put3(moment, count, plus(row3(moment, count, 0), times(-1.0, row3(one, 0, TIP_TORQUE))))
    f, m = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(count - 1, -1, -1):
        f, m = plus(f, row3(force, i + 1, 0)), plus(m, row3(moment, i + 1, 0))
        el = length_m[i]
        phi = (el * strain[i, 2], el * strain[i, 1], el * strain[i, 3])
        p = row9(turned, i)
        near = turn(p, f)
        q = work(phi, el * (1 + strain[i, 0]), el, near, m)
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = q[0], q[1], q[2], q[3]
        m = plus(turn(p, m), cross(row3(reach, i, 0), near))
        f = near
