import numpy as np
import pytest
from numpy.testing import assert_allclose

from avionics.wse.attitude import sin_cos, station_attitude
from avionics.wse.geometry import WingGeometry, gauss_nodes, integration_matrix
from avionics.wse.jacobian import STEP, complex_step
from avionics.wse.modes import ModeBasis

S = np.array([0.6, 1.2, 1.5])


def dense_line(basis: ModeBasis, q: np.ndarray, *, psi0: float, pieces: int = 20000):
    """Angles and line by trapezoids on 20000 pieces and rotation matrices written out."""
    s = np.linspace(0.0, basis.span_m, pieces + 1)
    phi = basis.shape(s, basis.bending) @ q[basis.phi]
    theta = basis.shape(s, basis.twist) @ q[basis.theta]
    slope = np.gradient(theta, s, edge_order=2)
    curvature = slope * np.tan(phi) / np.cos(theta)
    h = s[1]
    bend = np.concatenate([[0.0], np.cumsum(0.5 * h * (curvature[1:] + curvature[:-1]))])
    psi = psi0 + bend + basis.shape(s, basis.inplane) @ q[basis.psi]
    D = np.array([station_attitude(*angles) for angles in zip(phi, theta, psi, strict=True)])
    tangent = D[:, 1]
    steps = 0.5 * h * (tangent[1:] + tangent[:-1])
    return s, psi, np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), D


def test_integration_matrix_integrates_a_sine_to_rounding() -> None:
    nodes = gauss_nodes(1.5)
    s = np.array([0.0, 0.3, 1.5])
    assert_allclose(
        integration_matrix(s, 1.5) @ np.sin(2 * nodes), 0.5 - 0.5 * np.cos(2 * s), atol=1e-14
    )


def test_tangent_of_the_specification_is_the_second_row_of_the_attitude() -> None:
    phi, theta, psi = 0.4, -0.2, 0.3
    s, c = np.sin, np.cos
    expected = [
        s(phi) * s(theta) * c(psi) - c(phi) * s(psi),
        s(phi) * s(theta) * s(psi) + c(phi) * c(psi),
        s(phi) * c(theta),
    ]
    assert_allclose(station_attitude(phi, theta, psi)[1], expected, atol=1e-15)


def test_positive_phi_is_tip_down_and_positive_theta_nose_up() -> None:
    basis = ModeBasis("quarter-sine", 1.5, 1, 1, 0)
    wing = WingGeometry(basis, np.array([1.5]), x=np.array([0.1]), z=np.zeros(1))
    assert wing.points(np.array([0.1, 0.0]))[0, 2] > 0
    assert wing.points(np.array([0.0, 0.1]))[0, 2] == pytest.approx(-0.1 * np.sin(0.1))


def test_constant_curvature_gives_a_circular_arc() -> None:
    # phi = s / r: y = r sin(s/r), z = r (1 - cos(s/r)).
    radius = 1.3
    basis = ModeBasis("linear", 1.5, 1, 0, 0, linear_slope_per_m=1 / radius)
    line = WingGeometry(basis, S).at(np.array([1.0])).r_in_body
    expected = np.column_stack(
        [np.zeros(3), radius * np.sin(S / radius), radius * (1 - np.cos(S / radius))]
    )
    assert_allclose(line, expected, atol=1e-12)


@pytest.mark.parametrize("psi0", [0.0, 0.35])
def test_line_and_sections_agree_with_a_dense_sum(basis, q, psi0: float) -> None:
    x, z = np.array([0.1, -0.1, 0.12]), np.array([-0.01, 0.0, 0.02])
    wing = WingGeometry(basis, S, x=x, z=z, psi0=psi0)
    shape = wing.at(q)
    s, psi, line, D = dense_line(basis, q, psi0=psi0)
    at = np.round(S / s[1]).astype(int)
    # The dense trapezoids are good to a few 1e-9.
    assert_allclose(shape.psi, psi[at], atol=1e-8)
    assert_allclose(shape.r_in_body, line[at], atol=1e-8)
    sections = [D[i].T @ [a, 0.0, b] for i, a, b in zip(at, x, z, strict=True)]
    assert_allclose(wing.points(q), line[at] + sections, atol=1e-8)


def test_more_nodes_change_nothing_above_a_nanometre(basis) -> None:
    q = np.array([0.5, 0.05, -0.02, 0.15, -0.03, 0.05])
    wing = WingGeometry(basis, S)
    _, _, coarse, _ = dense_line(basis, q, psi0=0.0, pieces=30000)
    _, _, fine, _ = dense_line(basis, q, psi0=0.0, pieces=60000)
    # Richardson: the trapezoids' error falls by four.
    best = fine[-1] + (fine[-1] - coarse[-1]) / 3
    assert_allclose(wing.at(q).r_in_body[-1], best, atol=2e-9)


def test_inplane_curvature_of_a_wing_without_inplane_modes_is_zero(basis) -> None:
    # The curvature in the wing's plane is the z component of dD/ds D^T.
    q = np.array([0.6, 0.1, -0.05, 0.2, -0.06, 0.0])
    s, h = 0.9, 1e-4
    wing = WingGeometry(basis, np.array([s - h, s, s + h]))
    shape = wing.at(q)
    D = [station_attitude(*a) for a in zip(shape.phi, shape.theta, shape.psi, strict=True)]
    turning = -((D[2] - D[0]) / (2 * h)) @ D[1].T
    # Central differences over 0.1 mm are good to a few 1e-6.
    assert abs(turning[1, 0]) < 1e-5
    # The same differences see the bending curvature.
    assert abs(turning[2, 1]) > 0.02


def test_complex_step_equals_central_differences(basis, q) -> None:
    wing = WingGeometry(basis, S, x=np.full(3, 0.1), z=np.full(3, -0.01), psi0=0.1)
    value, J = complex_step(lambda a: wing.points(a).reshape(*a.shape[:-1], -1), q)
    h = 1e-6
    for i in range(len(q)):
        step = h * np.eye(len(q))[i]
        numeric = (wing.points(q + step) - wing.points(q - step)).ravel() / (2 * h)
        assert_allclose(J[:, i], numeric, atol=1e-8)
    assert_allclose(value, wing.points(q).ravel(), atol=1e-14)


def test_sine_and_cosine_of_a_complex_step_are_those_of_the_library() -> None:
    rng = np.random.default_rng(1)
    z = rng.normal(size=50) + 1j * STEP * rng.normal(size=50)
    sine, cosine = sin_cos(z)
    for found, wanted in ((sine, np.sin(z)), (cosine, np.cos(z))):
        assert_allclose(found.real, wanted.real, rtol=1e-15)
        assert_allclose(found.imag, wanted.imag, rtol=1e-15)
