"""Mass matrix of a chain of rod elements, and the factors that Newton's iteration solves with.

Composite rigid bodies (Featherstone): what hangs outboard of an element moves with its far end
as one body. Cost grows with the square of the elements, a tenth of that of one column at a time.
"""

import numpy as np

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
    work,
)
from sim_bus.wing.rod_dynamics import FloatArray, row9


@compiled
def about(shift: Vector, moment: Vector, mass: float) -> Matrix:
    """Return the inertia that a shift of the reference point adds.

    Parameters
    ----------
    shift : tuple of float
        From the new point to the old one, m.
    moment : tuple of float
        First moment of mass about the old point, kg m.
    mass : float
        Mass, kg.
    """
    a, b = shift, plus(times(mass, shift), times(2.0, moment))
    along = dot(a, b)
    xy = -0.5 * (a[0] * b[1] + a[1] * b[0])
    xz = -0.5 * (a[0] * b[2] + a[2] * b[0])
    yz = -0.5 * (a[1] * b[2] + a[2] * b[1])
    return (
        along - a[0] * b[0], xy, xz,
        xy, along - a[1] * b[1], yz,
        xz, yz, along - a[2] * b[2],
    )  # fmt: skip


@compiled
def transposed(m: Matrix) -> Matrix:
    """Return the transpose."""
    return (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])


@compiled
def added(m: Matrix, n: Matrix) -> Matrix:
    """Return m + n."""
    return (
        m[0] + n[0], m[1] + n[1], m[2] + n[2],
        m[3] + n[3], m[4] + n[4], m[5] + n[5],
        m[6] + n[6], m[7] + n[7], m[8] + n[8],
    )  # fmt: skip


@compiled
def mass_matrix(strain: FloatArray, length_m: FloatArray, body: FloatArray) -> FloatArray:
    """Return the mass matrix of the strains, shape (4 N, 4 N).

    Parameters
    ----------
    strain : ndarray, shape (N, 4)
        Strains.
    length_m : ndarray, shape (N,)
        Element lengths.
    body : ndarray, shape (N + 1, 13)
        Node masses, see ``rod_dynamics.section_wrench``.
    """
    count = length_m.size
    matrix = np.zeros((4 * count, 4 * count))
    turned, reach = np.zeros((count, 9)), np.zeros((count, 3))
    for i in range(count):
        el = length_m[i]
        p, d = pose(
            (el * strain[i, 2], el * strain[i, 1], el * strain[i, 3]), el * (1 + strain[i, 0])
        )
        turned[i] = p
        reach[i] = d
    mass, first = 0.0, (0.0, 0.0, 0.0)
    inertia = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    still: Vector = (0.0, 0.0, 0.0)
    for i in range(count - 1, -1, -1):
        row = body[i + 1]
        cg = (row[1], row[2], row[3])
        own = (row[4], row[5], row[6], row[7], row[8], row[9], row[10], row[11], row[12])
        inertia = added(added(inertia, own), about(cg, still, row[0]))
        mass, first = mass + row[0], plus(first, times(row[0], cg))
        el = length_m[i]
        phi = (el * strain[i, 2], el * strain[i, 1], el * strain[i, 3])
        p = row9(turned, i)
        for k in range(4):
            unit = (
                el if k == 2 else 0.0,
                el if k == 1 else 0.0,
                el if k == 3 else 0.0,
            )
            stretch = (el * (1 + strain[i, 0]), el if k == 0 else 0.0, 0.0)
            spin, _, shift, _ = rates(phi, unit, still, stretch)
            shift = turn(transposed(p), shift)
            force = plus(times(mass, shift), cross(spin, first))
            moment = plus(turn(inertia, spin), cross(first, shift))
            for j in range(i, -1, -1):
                ej = length_m[j]
                bent = (ej * strain[j, 2], ej * strain[j, 1], ej * strain[j, 3])
                near = turn(row9(turned, j), force)
                q = work(bent, ej * (1 + strain[j, 0]), ej, near, moment)
                for n in range(4):
                    matrix[4 * j + n, 4 * i + k] = q[n]
                    matrix[4 * i + k, 4 * j + n] = q[n]
                arm = (reach[j, 0], reach[j, 1], reach[j, 2])
                moment = plus(turn(row9(turned, j), moment), cross(arm, near))
                force = near
        # Carry the composite body over to the near end.
        d = (reach[i, 0], reach[i, 1], reach[i, 2])
        first = turn(p, first)
        inertia = added(chain(chain(p, inertia), transposed(p)), about(d, first, mass))
        first = plus(first, times(mass, d))
    return matrix


@compiled
def factor(matrix: FloatArray) -> None:
    """Replace a symmetric positive matrix by its Cholesky factor, in its lower triangle."""
    size = matrix.shape[0]
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(total) if i == j else total / matrix[j, j]


@compiled
def solve(lower: FloatArray, right: FloatArray) -> None:
    """Replace ``right`` (n,) by the solution of the factored system."""
    size = right.size
    for i in range(size):
        total = right[i]
        for k in range(i):
            total -= lower[i, k] * right[k]
        right[i] = total / lower[i, i]
    for i in range(size - 1, -1, -1):
        right[i] /= lower[i, i]
        for k in range(i):
            right[k] -= lower[i, k] * right[i]
