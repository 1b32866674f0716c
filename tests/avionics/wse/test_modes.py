import numpy as np
import pytest

from avionics.wse.modes import ModeBasis, quarter_sine

S = np.linspace(0.0, 1.5, 7)


def test_eq1_quarter_sines_are_clamped_and_uncurved_at_the_tip() -> None:
    h = 1e-3
    near_tip = quarter_sine(np.array([1.5 - 2 * h, 1.5 - h, 1.5]), 1.5, 4)
    assert quarter_sine(np.array([0.0]), 1.5, 4) == pytest.approx(np.zeros((1, 4)))
    # phi' vanishes at a free tip: the moment there is zero.
    slope = (3 * near_tip[2] - 4 * near_tip[1] + near_tip[0]) / (2 * h)
    assert slope == pytest.approx(np.zeros(4), abs=2e-3)
    assert quarter_sine(np.array([0.5]), 1.5, 2)[0] == pytest.approx([0.5, 1.0])


@pytest.mark.parametrize("family", ["quarter-sine", "linear"])
def test_slope_is_the_derivative_of_the_shape(family: str) -> None:
    basis = ModeBasis(family, 1.5, 3, 0, 0)
    h = 1e-6
    numeric = (basis.shape(S + h, 3) - basis.shape(S - h, 3)) / (2 * h)
    assert basis.slope(S, 3) == pytest.approx(numeric, abs=1e-8)


def test_linear_basis_is_the_snapshot_of_the_paper() -> None:
    assert ModeBasis("linear", 1.5, 1, 1, 0).shape(S, 1)[:, 0] == pytest.approx(0.3776 * S)


def test_embedded_amplitudes_make_the_same_shape() -> None:
    wide, narrow = ModeBasis("quarter-sine", 1.5, 3, 2, 1), ModeBasis("quarter-sine", 1.5, 1, 1, 0)
    assert wide.holds(narrow)
    assert not narrow.holds(wide)
    assert np.array([0.3, -0.1]) @ wide.embed(narrow) == pytest.approx([0.3, 0, 0, -0.1, 0, 0])
