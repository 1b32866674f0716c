import numpy as np
import pytest

from avionics.analysis.interpolation import between, linear_at


def test_values_between_samples() -> None:
    t_ns = np.arange(0, 1_000_000_000, 20_000_000)
    values = np.sin(t_ns * 1e-9 * 6)[:, None]
    values[20:23] = np.nan
    wanted = np.array([105_000_000, 415_000_000, 2_000_000_000])
    found = between(t_ns, values, wanted)
    assert found[0, 0] == pytest.approx(np.sin(0.105 * 6), abs=1e-6)
    assert np.isnan(found[1:, 0]).all()


@pytest.mark.parametrize(
    ("wanted_ns", "expected"),
    [(-5, 0.0), (0, 0.0), (5, 0.5), (10, 1.0), (25, 2.0), (40, 3.0), (99, 3.0)],
)
def test_linear_between_neighbours_and_held_at_the_ends(wanted_ns: int, expected: float) -> None:
    t_ns = np.array([0, 10, 20, 30], dtype=np.int64)
    values = np.array([[0.0, 0.0], [1.0, -1.0], [1.0, -1.0], [3.0, -3.0]])
    assert linear_at(t_ns, values, wanted_ns).tolist() == pytest.approx([expected, -expected])
