"""Kinematics of one rod element of constant strain, compiled.

An element has axial strain and three curvatures that are constant along it (the strain-based,
geometrically exact beam of Su and Cesnik): its far end is the exponential map of its strains, with
no limit on displacement. Vectors are tuples of three, matrices tuples of nine (rows), so that
the compiler keeps everything in registers.

The element's own frame is the specification's local frame at its near end: x chordwise forward,
y along the line, z down. Strains are ordered axial, torsion (about y), out-of-plane bending
(about x), in-plane bending (about z).
"""

from pathlib import Path

from avionics.compiler import IS_COMPILED, cached_compiler
from avionics.desk import missing

if not IS_COMPILED:
    raise missing("the simulated wing", "numba")

compiled = cached_compiler("rod", Path(__file__).parent.glob("rod*.py"))
Vector = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]

# Taylor coefficients in x = angle^2 of (1 - cos)/angle^2 and (angle - sin)/angle^3; nine terms
# leave 1e-13 at two radians in one element.
B_SERIES = (
    1 / 2, -1 / 24, 1 / 720, -1 / 40320, 1 / 3628800, -1 / 479001600, 1 / 87178291200,
    -1 / 20922789888000, 1 / 6402373705728000,
)  # fmt: skip
C_SERIES = (
    1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800, 1 / 1307674368000,
    -1 / 355687428096000, 1 / 121645100408832000,
)  # fmt: skip


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def plus(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@compiled
def times(k: float, a: Vector) -> Vector:
    """Return k a."""
    return (k * a[0], k * a[1], k * a[2])


@compiled
def turn(m: Matrix, a: Vector) -> Vector:
    """Return m a."""
    return (
        m[0] * a[0] + m[1] * a[1] + m[2] * a[2],
        m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
        m[6] * a[0] + m[7] * a[1] + m[8] * a[2],
    )


@compiled
def turn_back(m: Matrix, a: Vector) -> Vector:
    """Return m^T a."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[6] * a[2],
        m[1] * a[0] + m[4] * a[1] + m[7] * a[2],
        m[2] * a[0] + m[5] * a[1] + m[8] * a[2],
    )


@compiled
def chain(m: Matrix, n: Matrix) -> Matrix:
    """Return m n."""
    return (
        m[0] * n[0] + m[1] * n[3] + m[2] * n[6],
        m[0] * n[1] + m[1] * n[4] + m[2] * n[7],
        m[0] * n[2] + m[1] * n[5] + m[2] * n[8],
        m[3] * n[0] + m[4] * n[3] + m[5] * n[6],
        m[3] * n[1] + m[4] * n[4] + m[5] * n[7],
        m[3] * n[2] + m[4] * n[5] + m[5] * n[8],
        m[6] * n[0] + m[7] * n[3] + m[8] * n[6],
        m[6] * n[1] + m[7] * n[4] + m[8] * n[7],
        m[6] * n[2] + m[7] * n[5] + m[8] * n[8],
    )


@compiled
def series(x: float) -> tuple[float, float, float, float, float, float]:
    """Return b, b', b'', c, c', c'' at x = angle^2, derivatives by x."""
    b = bx = bxx = c = cx = cxx = 0.0
    for k in range(8, -1, -1):  # Horner, with both derivatives carried along
        bxx = bxx * x + 2 * bx
        bx = bx * x + b
        b = b * x + B_SERIES[k]
        cxx = cxx * x + 2 * cx
        cx = cx * x + c
        c = c * x + C_SERIES[k]
    return b, bx, bxx, c, cx, cxx


@compiled
def pose(phi: Vector, stretched: float) -> tuple[Matrix, Vector]:
    """Return the far end's frame and position seen from the near end.

    Parameters
    ----------
    phi : tuple of float
        Rotation vector of the whole element: length times curvature, rad.
    stretched : float
        Length times (1 + axial strain), m.

    Returns
    -------
    turned : tuple of 9 floats
        Near from far.
    reach : tuple of 3 floats
        Position of the far end, near axes, m.
    """
    x = dot(phi, phi)
    b, _, _, c, _, _ = series(x)
    a, cosine = 1 - x * c, 1 - x * b
    f, g, h = phi
    turned = (
        cosine + b * f * f, b * f * g - a * h, b * f * h + a * g,
        b * f * g + a * h, cosine + b * g * g, b * g * h - a * f,
        b * f * h - a * g, b * g * h + a * f, cosine + b * h * h,
    )  # fmt: skip
    u = (-h, 0.0, f)  # phi x e_y
    w = cross(phi, u)
    return turned, (
        stretched * (b * u[0] + c * w[0]),
        stretched * (1 + b * u[1] + c * w[1]),
        stretched * (b * u[2] + c * w[2]),
    )


@compiled
def rates(
    phi: Vector, dphi: Vector, ddphi: Vector, length: Vector
) -> tuple[Vector, Vector, Vector, Vector]:
    """Return how the far end moves relative to the near end.

    Parameters
    ----------
    phi, dphi, ddphi : tuple of float
        Rotation vector of the element and its two time derivatives.
    length : tuple of float
        Stretched length and its two time derivatives, m, m/s, m/s^2.

    Returns
    -------
    omega, omega_dot : tuple of float
        Relative angular rate and its derivative, far axes, rad/s, rad/s^2.
    reach_dot, reach_ddot : tuple of float
        Derivatives of the far end's position, near axes, m/s, m/s^2.
    """
    x, xd = dot(phi, phi), 2 * dot(phi, dphi)
    xdd = 2 * (dot(dphi, dphi) + dot(phi, ddphi))
    b, bx, bxx, c, cx, cxx = series(x)
    bd, cd = bx * xd, cx * xd
    bdd, cdd = bxx * xd * xd + bx * xdd, cxx * xd * xd + cx * xdd
    # Right Jacobian of the rotation: I - b [phi] + c [phi]^2.
    v, vd = cross(phi, dphi), cross(phi, ddphi)
    pv = cross(phi, v)
    omega = plus(dphi, plus(times(-b, v), times(c, pv)))
    omega_dot = plus(
        plus(ddphi, plus(times(-bd, v), times(-b, vd))),
        plus(times(cd, pv), times(c, plus(cross(dphi, v), cross(phi, vd)))),
    )
    u, ud, udd = (-phi[2], 0.0, phi[0]), (-dphi[2], 0.0, dphi[0]), (-ddphi[2], 0.0, ddphi[0])
    w = cross(phi, u)
    wd = plus(cross(dphi, u), cross(phi, ud))
    wdd = plus(plus(cross(ddphi, u), times(2.0, cross(dphi, ud))), cross(phi, udd))
    h = plus((0.0, 1.0, 0.0), plus(times(b, u), times(c, w)))
    hd = plus(plus(times(bd, u), times(b, ud)), plus(times(cd, w), times(c, wd)))
    hdd = plus(
        plus(times(bdd, u), plus(times(2 * bd, ud), times(b, udd))),
        plus(times(cdd, w), plus(times(2 * cd, wd), times(c, wdd))),
    )
    reach_dot = plus(times(length[1], h), times(length[0], hd))
    reach_ddot = plus(times(length[2], h), plus(times(2 * length[1], hd), times(length[0], hdd)))
    return omega, omega_dot, reach_dot, reach_ddot


@compiled
def work(
    phi: Vector, stretched: float, length_m: float, force: Vector, moment: Vector
) -> tuple[float, float, float, float]:
    """Return the generalised forces of a wrench on the far end, in the order of the strains.

    Parameters
    ----------
    phi, stretched
        As in ``pose``.
    length_m : float
        Unstretched length, m.
    force : tuple of float
        Force on the far end, near axes, N.
    moment : tuple of float
        Moment on the far end, far axes, N m.
    """
    x = dot(phi, phi)
    b, bx, _, c, cx, _ = series(x)
    u = (-phi[2], 0.0, phi[0])
    w = cross(phi, u)
    h = plus((0.0, 1.0, 0.0), plus(times(b, u), times(c, w)))
    # Transpose of the derivative of h by phi, and of the right Jacobian, applied to the wrench.
    along = 2 * (bx * dot(u, force) + cx * dot(w, force))
    fu = cross(u, force)  # d(u) . f = dphi . (e_y x f)
    ef = cross((0.0, 1.0, 0.0), force)
    pf = cross(force, phi)
    gradient = plus(
        plus(times(along, phi), times(b, ef)),
        times(c, plus(fu, cross((0.0, 1.0, 0.0), pf))),
    )
    pm = cross(phi, moment)
    turning = plus(moment, plus(times(b, pm), times(c, cross(phi, pm))))
    total = plus(times(stretched, gradient), turning)
    return (
        length_m * dot(h, force),
        length_m * total[1],
        length_m * total[0],
        length_m * total[2],
    )
