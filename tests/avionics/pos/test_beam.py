"""Timoshenko beam: closed forms, exact frequencies, convergence, locking; the modal flexure."""

import numpy as np
import pytest

from avionics.pos.beam import (
    Beam,
    assemble,
    element_matrices,
    exact_frequencies,
    modes,
    tip_deflection,
)

WING = Beam(5.0, 0.5, 0.06)
STUBBY = Beam(1.0, 0.1, 0.2)
BEAMS = pytest.mark.parametrize("beam", [WING, STUBBY], ids=["wing", "stubby"])


def test_element_matrices_are_guos() -> None:
    """Eq. 10-15 with l = 2 m, EI = 3, GA/k = 5, rho A = 7, rho I: by hand."""
    beam = Beam(2.0, 1.0, 1.0, youngs=36.0, shear=6.0, density=7.0)
    K, M = element_matrices(beam, 2.0)
    bending = 1.5 * np.array([[0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 0, 0], [0, -1, 0, 1]])
    shear = 2.5 * np.array([[1, 1, -1, 1], [1, 1, -1, 1], [-1, -1, 1, -1], [1, 1, -1, 1]])
    np.testing.assert_allclose(K, bending + shear)
    np.testing.assert_allclose(M[0, [0, 2]], 7.0 * 2.0 / 6.0 * np.array([2.0, 1.0]))
    np.testing.assert_allclose(M[1, [1, 3]], 7.0 / 12.0 * 2.0 / 6.0 * np.array([2.0, 1.0]))


def test_a_rigid_motion_costs_nothing() -> None:
    K, M = element_matrices(WING, 0.7)
    lift, turn = np.array([1.0, 0.0, 1.0, 0.0]), np.array([0.0, 1.0, 0.7, 1.0])
    np.testing.assert_allclose(K @ lift, 0.0, atol=1e-6)
    np.testing.assert_allclose(K @ turn, 0.0, atol=1e-6 * np.abs(K).max())
    assert lift @ M @ lift == pytest.approx(WING.density * WING.area * 0.7)


@BEAMS
def test_tip_load_meets_the_closed_form(beam: Beam) -> None:
    force, L = 1000.0, beam.length
    exact = force * L**3 / (3 * beam.bending_stiffness) + force * L / beam.shear_stiffness
    slope = force * L**2 / (2 * beam.bending_stiffness)
    errors = []
    for n in (8, 16, 32):
        v, theta = tip_deflection(beam, n, force)
        errors.append(abs(v / exact - 1.0))
        assert theta == pytest.approx(slope, rel=1e-8)  # nodal rotations are exact
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.01)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.01)


@BEAMS
def test_frequencies_converge_with_the_square_of_the_element(beam: Beam) -> None:
    exact = exact_frequencies(beam, 4)
    coarse, fine, finest = (modes(beam, n, 4)[0] / exact - 1.0 for n in (16, 32, 64))
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.12)
    np.testing.assert_allclose(fine / finest, 4.0, rtol=0.05)
    assert abs(finest[0]) < 1e-4
    assert abs(finest[3]) < 1e-2


def test_a_slender_beam_has_euler_and_bernoullis_frequencies() -> None:
    slender = Beam(10.0, 0.1, 0.01)
    unit = np.sqrt(slender.bending_stiffness / (slender.density * slender.area)) / 10.0**2
    expected = np.array([1.8751041, 4.6940911, 7.8547574]) ** 2 * unit
    np.testing.assert_allclose(exact_frequencies(slender, 3), expected, rtol=2e-5)


def test_shear_and_rotary_inertia_lower_the_stubby_beams_frequencies() -> None:
    unit = np.sqrt(STUBBY.bending_stiffness / (STUBBY.density * STUBBY.area))
    bernoulli = np.array([1.8751041, 4.6940911]) ** 2 * unit
    ratio = exact_frequencies(STUBBY, 2) / bernoulli
    assert ratio[1] < ratio[0] < 0.985


def test_full_integration_locks_and_reduced_does_not() -> None:
    exact = 1000.0 * 5.0**3 / (3 * WING.bending_stiffness) + 1000.0 * 5.0 / WING.shear_stiffness
    locked, _ = tip_deflection(WING, 16, 1000.0, "full")
    free, _ = tip_deflection(WING, 16, 1000.0)
    assert locked < 0.15 * exact
    assert free == pytest.approx(exact, rel=2e-3)


def test_first_mode_is_a_clamped_bow_of_unit_modal_mass() -> None:
    frequency, shapes = modes(WING, 32, 1)
    K, M = assemble(WING, 32)
    shape = shapes[:, 0]
    assert shape @ M @ shape == pytest.approx(1.0)
    assert shape @ K @ shape == pytest.approx(frequency[0] ** 2)
    deflection = shape[::2] * np.sign(shape[-2])
    assert np.all(np.diff(deflection) > 0.0)
