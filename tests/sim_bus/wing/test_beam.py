"""Proofs of the beam against closed solutions that share nothing with it."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from sim_bus.wing.beam import Beam, BeamError
from sim_bus.wing.rod_dynamics import imbalance
from sim_bus.wing.rod_integration import integrate
from sim_bus.wing.rod_mass import factor, mass_matrix, solve
from sim_bus.wing.uniform_beam import uniform_beam

pytestmark = pytest.mark.slow

SPAN_M, EI, GJ, MASS_PER_M = 1.5, 6.0, 5.0, 0.4


def beam(elements: int = 24, **changes) -> Beam:
    values = {
        "span_m": SPAN_M, "elements": elements, "mass_per_m": MASS_PER_M, "ei_out_n_m2": EI,
        "ei_in_n_m2": 300.0, "gj_n_m2": GJ, "ea_n": 1e6, "chord_m": 0.05,
    }  # fmt: skip
    return uniform_beam(**(values | changes))


def tip(b: Beam, strain) -> np.ndarray:
    return b.shape(strain, np.array([b.span_m]))[0][0]


def elastica(load: float) -> tuple[float, float, float]:
    """Slope (rad), deflection and reach of the tip over the length, at P L^2 / EI = load.

    Bisshopp and Drucker (1945): a force of fixed direction at the tip of a cantilever.
    """

    def modulus(slope: float) -> tuple[float, float]:
        p = np.sqrt((1 + np.sin(slope)) / 2)
        return p * p, np.arcsin(1 / (p * np.sqrt(2)))

    def miss(slope: float) -> float:
        m, start = modulus(slope)
        return ellipk(m) - ellipkinc(start, m) - np.sqrt(load)

    slope = brentq(miss, 1e-9, np.pi / 2 - 1e-9, xtol=1e-14)
    m, start = modulus(slope)
    deflection = 1 - 2 / np.sqrt(load) * (ellipe(m) - ellipeinc(start, m))
    return slope, deflection, np.sqrt(2 * np.sin(slope) / load)


@pytest.mark.parametrize("load", [0.5, 1.5, 2.5, 3.5])
def test_tip_force_bends_it_as_the_elastica(load: float) -> None:
    slope, deflection, reach = elastica(load)
    b = beam()
    strain = b.static(b.drive(tip_force_n=(0.0, 0.0, load * EI / SPAN_M**2)))
    _, frames = b.shape(strain, np.array([SPAN_M]))
    found = np.arctan2(frames[0, 2, 1], frames[0, 1, 1])
    # Constant strain per element is of second order: 24 elements leave some 1e-4.
    assert found == pytest.approx(slope, rel=4e-4)
    assert tip(b, strain) == pytest.approx(
        [0.0, reach * SPAN_M, deflection * SPAN_M], abs=6e-4 * SPAN_M
    )


def test_loads_reach_sixty_degrees() -> None:
    assert np.degrees(elastica(3.5)[0]) > 60


def test_error_falls_with_the_square_of_the_element() -> None:
    _, deflection, _ = elastica(2.5)
    errors = []
    for count in (8, 16, 32):
        b = beam(count)
        strain = b.static(b.drive(tip_force_n=(0.0, 0.0, 2.5 * EI / SPAN_M**2)))
        errors.append(abs(tip(b, strain)[2] - deflection * SPAN_M))
    assert 3.5 < errors[0] / errors[1] < 4.5
    assert 3.5 < errors[1] / errors[2] < 4.5


def test_tip_moment_rolls_it_into_a_circle() -> None:
    """A pure couple bends it by M L / EI: exact with any number of elements."""
    b = beam(6, ei_in_n_m2=EI)
    moment = EI * np.radians(200) / SPAN_M
    strain = b.static(b.drive(tip_torque_nm=(moment, 0.0, 0.0)))
    radius = EI / moment
    angle = SPAN_M / radius
    wanted = [0.0, radius * np.sin(angle), radius * (1 - np.cos(angle))]
    # The axial strain of EA = 1e6 N is zero here; what is left is Newton's.
    assert tip(b, strain) == pytest.approx(wanted, abs=1e-9)


def test_torque_twists_it_nose_up() -> None:
    b = beam(10)
    strain = b.static(b.drive(tip_torque_nm=(0.0, 1.0, 0.0)))
    _, frames = b.shape(strain, np.array([SPAN_M]))
    forward = frames[0, :, 0]
    assert np.arctan2(-forward[2], forward[0]) == pytest.approx(1.0 * SPAN_M / GJ, rel=1e-9)


def test_small_loads_bend_it_as_the_textbook_in_both_planes() -> None:
    b = beam(60)
    strain = b.static(b.drive(tip_force_n=(0.03, 0.0, 1e-3)))
    wanted = [0.03 * SPAN_M**3 / 3 / 300.0, SPAN_M, 1e-3 * SPAN_M**3 / 3 / EI]
    assert tip(b, strain) == pytest.approx(wanted, rel=2e-4)


def test_follower_force_turns_with_the_tip() -> None:
    """What follows the tip does other work than what stays: with the same load it ends elsewhere,
    and the force across the tip carries no axial load there."""
    b = beam()
    load = 2.5 * EI / SPAN_M**2
    dead = b.static(b.drive(tip_force_n=(0.0, 0.0, load)))
    follows = b.static(b.drive(tip_follow_n=(0.0, 0.0, load)))
    assert abs(follows[-1, 0]) < 0.05 * abs(dead[-1, 0])
    assert follows[:, 2].sum() > 1.2 * dead[:, 2].sum()


def test_first_three_frequencies_are_euler_bernoulli() -> None:
    b = beam(24)
    rest = b.static(b.drive())
    found = b.frequencies_hz(rest, b.drive())
    torsion = 1 / (4 * SPAN_M) * np.sqrt(GJ / (MASS_PER_M * 0.05**2 / 12))
    roots = np.array([1.87510407, 4.69409113, 7.85475744])
    wanted = roots**2 / (2 * np.pi * SPAN_M**2) * np.sqrt(EI / MASS_PER_M)
    # All of them but the in-plane ones (7 times higher) and torsion (above 70 Hz) are bending.
    in_plane = wanted[0] * np.sqrt(300.0 / EI)
    bending = np.array([f for f in found[:4] if abs(f / in_plane - 1) > 0.01])[:3]
    assert torsion > bending[-1]
    # Lumped masses: 0.15 % in the third mode with 24 elements.
    assert bending == pytest.approx(wanted, rel=2e-3)
    assert min(abs(found[:6] / in_plane - 1)) < 2e-3


def test_first_torsion_frequency() -> None:
    b = beam(24, chord_m=0.4)
    found = b.frequencies_hz(b.static(b.drive()), b.drive())
    wanted = 1 / (4 * SPAN_M) * np.sqrt(GJ / (MASS_PER_M * 0.4**2 / 12))
    assert min(abs(found[:6] / wanted - 1)) < 2e-3


def test_mass_matrix_is_what_unit_accelerations_cost() -> None:
    b = beam(8, cg_aft_m=0.02)
    strain = b.static(b.drive(tip_force_n=(0.5, 0.0, 3.0), tip_torque_nm=(0.0, 0.4, 0.0)))
    matrix = mass_matrix(strain, b.length_m, b.body)
    columns, out, still = np.empty((32, 32)), np.zeros((8, 4)), np.zeros((8, 4))
    for k in range(32):
        unit = np.zeros((8, 4))
        unit.flat[k] = 1.0
        imbalance(
            strain, still, unit, b.drive(), b.root, b.length_m, b.body, b.air, out,
            np.zeros((5, 9, 9)),
        )  # fmt: skip
        columns[:, k] = out.ravel()
    assert matrix == pytest.approx(columns, abs=1e-12 * np.abs(columns).max())
    assert np.linalg.eigvalsh(matrix).min() > 0


def test_factors_solve() -> None:
    rng = np.random.default_rng(3)
    half = rng.standard_normal((12, 12))
    matrix, wanted = half @ half.T + np.eye(12), rng.standard_normal(12)
    right, lower = matrix @ wanted, matrix.copy()
    factor(lower)
    solve(lower, right)
    assert right == pytest.approx(wanted, rel=1e-9)


def test_free_swing_keeps_its_energy() -> None:
    """GIVEN no damping and no loss in the time step WHEN a loaded wing is let go, obliquely and
    twisted, THEN the sum of strain and kinetic energy stays."""
    b = beam(8, cg_aft_m=0.01, chord_m=0.2, ea_n=2e4)
    loaded = b.static(b.drive(tip_force_n=(2.0, 0.0, 4.0), tip_torque_nm=(0.0, 0.3, 0.0)))
    steps, step_s = 1500, 5e-4
    state = np.stack([loaded, np.zeros_like(loaded), np.zeros_like(loaded)])
    strains, speeds, accels = (np.empty((steps, 8, 4)) for _ in range(3))
    table = np.repeat(b.drive()[None], steps + 1, axis=0)
    stiffness = b.element_stiffness
    done = integrate(
        state, table, step_s, 1.0, b.root, b.length_m, b.body, b.air, stiffness, 0 * stiffness,
        b.unstrained, strains, speeds, accels,
    )  # fmt: skip
    assert done == steps

    def energy(q, v) -> float:
        elastic = 0.5 * np.einsum("ni,nij,nj->", q, stiffness, q)
        matrix = mass_matrix(q, b.length_m, b.body)
        return elastic + 0.5 * v.ravel() @ matrix @ v.ravel()

    start = energy(loaded, np.zeros_like(loaded))
    later = [energy(strains[k], speeds[k]) for k in range(0, steps, 25)]
    # The method is of second order: 0.5 ms steps against 120 Hz axial waves leave a few parts in
    # a thousand, without trend.
    assert np.abs(np.array(later) / start - 1).max() < 0.01
    assert np.mean(later[-20:]) == pytest.approx(np.mean(later[:20]), rel=3e-3)


def test_compiled_integration_equals_the_plain_function() -> None:
    b = beam(4, damping_s=1e-3)
    rest = b.static(b.drive())
    state = np.stack([rest, np.zeros_like(rest), np.zeros_like(rest)])
    table = np.repeat(b.drive(tip_force_n=(0.3, 0.0, 2.0))[None], 11, axis=0)
    stiffness = b.element_stiffness
    results = []
    for function in (integrate, integrate.py_func):
        out = [np.zeros((10, 4, 4)) for _ in range(3)]
        done = function(
            state, table, 2e-3, 0.8, b.root, b.length_m, b.body, b.air, stiffness,
            1e-3 * stiffness, b.unstrained, *out,
        )  # fmt: skip
        assert done == 10
        results.append(out)
    for fast, plain in zip(*results, strict=True):
        assert fast == pytest.approx(plain, rel=1e-6, abs=1e-9)


def test_impossible_loads_are_reported() -> None:
    b = beam(6)
    with pytest.raises(BeamError, match="no equilibrium"):
        b.static(b.drive(tip_follow_n=(0.0, 0.0, 1e6)))


def test_wrong_shapes_are_refused() -> None:
    b = beam(6)
    with pytest.raises(ValueError, match=r"mass_kg has shape \(6,\), wanted \(7,\)"):
        Beam(b.length_m, b.stiffness, b.mass_kg[1:], b.cg_m, b.inertia_kg_m2)
