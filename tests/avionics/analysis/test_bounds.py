import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.stats import chi2

from avionics.analysis.bounds import mean_square_bounds


def test_bounds_of_two_degrees_are_those_of_an_exponential() -> None:
    """Chi-squared with two degrees of freedom: its quantile is -2 ln(1 - p)."""
    low, high = mean_square_bounds(2)
    assert low == pytest.approx(-np.log(0.975))
    assert high == pytest.approx(-np.log(0.025))


def test_bounds_are_those_of_scipy_stats_to_the_last_bit() -> None:
    degrees = np.array([1, 2, 3, 7, 12, 100, 5000])
    low, high = mean_square_bounds(degrees)
    assert_array_equal(low, chi2.ppf(0.025, degrees) / degrees)
    assert_array_equal(high, chi2.ppf(0.975, degrees) / degrees)
