import numpy as np
import pytest
from numpy.testing import assert_allclose

from avionics.wse.attitude import station_attitude
from avionics.wse.geometry import WingGeometry
from avionics.wse.gyro_step import GyroStep, Regime, stacked
from avionics.wse.kinematics import body_rates, euler_rate_matrix, modal_inverse
from avionics.wse.modes import ModeBasis
from avionics.wse.process import Process
from avionics.wse.rates import ModalRates
from avionics.wse.state import RandomWalk, StateLayout

PODS = np.array([0.5, 1.0, 1.4])
DQ = np.array([1.1, -0.4, 0.3, 0.5, 0.2, -0.3])


def gyro_rates(basis: ModeBasis, q, dq, s, *, psi0: float = 0.0) -> np.ndarray:
    """Body rates at stations by differences of the attitude: skew part of -dD/dt D^T."""
    h = 1e-5
    wing = WingGeometry(basis, s, psi0=psi0)
    D = []
    for k in (-1, 0, 1):
        shape = wing.at(q + k * h * dq)
        angles = zip(shape.phi, shape.theta, shape.psi, strict=True)
        D.append(np.array([station_attitude(*a) for a in angles]))
    skew = -((D[2] - D[0]) / (2 * h)) @ D[1].swapaxes(1, 2)
    return np.column_stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])


def test_eq4_agrees_with_differentiated_rotation_matrices() -> None:
    angles, rates, h = np.array([0.5, -0.3, 0.7]), np.array([0.8, -0.6, 0.4]), 1e-6
    D = [station_attitude(*(angles + k * h * rates)) for k in (-1, 0, 1)]
    skew = -((D[2] - D[0]) / (2 * h)) @ D[1].T
    omega = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    H = euler_rate_matrix(np.array([angles[0]]), np.array([angles[1]]))[0]
    assert_allclose(H @ omega, rates, atol=1e-9)


def test_body_rates_invert_eq4() -> None:
    phi, theta = np.array([0.5, -0.2]), np.array([-0.3, 0.1])
    rates = np.array([[0.8, -0.6, 0.4], [0.1, 0.2, -0.9]])
    omega = body_rates(phi, theta, rates)
    again = np.einsum("mij,mj->mi", euler_rate_matrix(phi, theta), omega)
    assert_allclose(again, rates, atol=1e-14)


def test_euler_rate_matrix_refuses_unequal_shapes() -> None:
    with pytest.raises(ValueError, match="equal shapes"):
        euler_rate_matrix(np.zeros(2), np.zeros(3))


def test_eq7_recovers_the_modal_rates_of_all_three_families(basis, q) -> None:
    rates = ModalRates(basis, PODS, np.ones(6))
    omega = gyro_rates(basis, q, DQ, PODS)
    found = rates(q, omega, rates.inverse((True, True, True)))
    assert_allclose(found, DQ, atol=1e-7)


def test_rates_of_a_turning_root_are_taken_out(basis, q) -> None:
    rates = ModalRates(basis, PODS, np.ones(6), psi0=0.2)
    root = np.array([0.3, -0.5, 0.7])
    shape = WingGeometry(basis, PODS, psi0=0.2).at(q)
    omega = gyro_rates(basis, q, DQ, PODS, psi0=0.2)
    angles = zip(shape.phi, shape.theta, shape.psi, strict=True)
    omega = omega + np.array([station_attitude(*a) @ root for a in angles])
    found = rates(q, omega, rates.inverse((True, True, True)), root)
    assert_allclose(found, DQ, atol=1e-7)


def test_eq7_is_the_normal_equations_for_one_mode() -> None:
    basis = ModeBasis("linear", 1.5, 1, 1, 0)
    s = np.array([0.6, 1.2])
    Phi = 0.3776 * s
    rates = ModalRates(basis, s, np.ones(2))
    omega = np.array([[0.3, 0.1, -0.05], [0.7, 0.2, 0.02]])
    H = euler_rate_matrix(Phi * 0.4, Phi * -0.1)
    angle_rates = np.einsum("mij,mj->mi", H, omega)
    expected = [Phi @ angle_rates[:, i] / (Phi @ Phi) for i in (0, 1)]
    found = rates(np.array([0.4, -0.1]), omega, rates.inverse((True, True)))
    assert_allclose(found, expected, atol=1e-14)


def test_more_modes_than_pods_give_the_weighted_least_norm() -> None:
    rng = np.random.default_rng(3)
    Phi, W = rng.normal(size=(2, 3)), np.array([1.0, 0.1, 0.01])
    expected = np.diag(W) @ Phi.T @ np.linalg.inv(Phi @ np.diag(W) @ Phi.T)
    assert_allclose(modal_inverse(Phi, W), expected, atol=1e-10)
    assert_allclose(modal_inverse(Phi, np.ones(3)), np.linalg.pinv(Phi), atol=1e-10)


@pytest.mark.parametrize("live", [(False,) * 3, (True, False, False), (False, True, True)])
def test_silent_pods_do_not_count_and_never_crash(basis, q, live) -> None:
    rates = ModalRates(basis, PODS, np.ones(6))
    omega = gyro_rates(basis, q, DQ, PODS)
    wild = omega.copy()
    wild[~np.array(live)] = 100.0
    inverse = rates.inverse(live)
    assert_allclose(rates(q, wild, inverse), rates(q, omega, inverse), atol=1e-12)
    assert np.isfinite(rates(q, omega, inverse)).all()


def test_pods_at_one_station_do_not_crash() -> None:
    basis = ModeBasis("quarter-sine", 1.5, 2, 1, 0)
    rates = ModalRates(basis, np.array([1.0, 1.0]), np.ones(3))
    found = rates(np.zeros(3), np.ones((2, 3)), rates.inverse((True, True)))
    assert np.isfinite(found).all()


def test_unobserved_covariance_is_zero_for_what_the_pods_determine() -> None:
    """With no modes left out it would vanish; the omitted ones keep it finite and small."""
    basis = ModeBasis("quarter-sine", 1.5, 1, 0, 0)
    one = ModalRates(basis, np.array([1.0]), np.ones(1)).inverse((True,)).unobserved[0, 0]
    many = ModalRates(basis, np.linspace(0.2, 1.5, 14), np.ones(1)).inverse((True,) * 14)
    none = ModalRates(basis, np.array([1.0]), np.ones(1)).inverse((False,)).unobserved[0, 0]
    assert none == pytest.approx(1.0)
    assert many.unobserved[0, 0] < one < 0.5


def test_activity_is_the_mean_square_rate_of_the_first_mode() -> None:
    basis = ModeBasis("quarter-sine", 1.5, 2, 1, 1)
    rates = ModalRates(basis, np.array([0.5, 1.5]), np.ones(4))
    p = basis.shape(np.array([0.5, 1.5]), 1)[:, 0] * 0.8
    omega = np.column_stack([p, 0 * p, 0 * p])
    assert rates.activity(omega, (True, True)) == pytest.approx([0.64, 0.0, 0.0])
    assert rates.activity(omega, (False, False)) is None


@pytest.mark.parametrize("has_bias", [False, True])
def test_one_mode_of_each_by_numbers_moves_as_by_arrays(has_bias) -> None:
    rng = np.random.default_rng(6)
    basis = ModeBasis("quarter-sine", 1.5, 1, 1, 0)
    rates = ModalRates(basis, np.array([0.6, 1.2]), np.ones(2))
    bias = RandomWalk(0.01) if has_bias else None
    layout = StateLayout(basis, ("0", "1"), prior=np.ones(2), bias=bias)
    process = Process(rates, layout, 1e-4)
    x, omega = rng.normal(size=layout.size), rng.normal(size=(2, 3))
    for live in ((True, True), (False, True), (False, False)):
        step = GyroStep(0.01, omega, Regime(live, np.ones(3)))
        # A stack takes the way of the arrays.
        many, middles = process.move(x[None], stacked([step]))
        one, middle = process.move(x, step)
        assert_allclose(one, many[0], atol=1e-15)
        assert_allclose(middle, middles[0], atol=1e-15)
