"""95 % bounds of normalised squares (NIS, NEES) per degree of freedom, for a consistent filter."""

from typing import Any

from numpy.typing import NDArray
from scipy.special import gammaincinv

PROBABILITIES_95 = (0.025, 0.975)


def mean_square_bounds(degrees: float | NDArray[Any]) -> tuple[Any, Any]:
    """Return where 95 % of the means of squares of independent unit normals lie.

    Parameters
    ----------
    degrees : float or ndarray
        How many squares go into a mean; above zero.

    Returns
    -------
    low, high : float or ndarray
        Chi-squared quantiles over ``degrees``, of its shape; one is the expectation.

    Notes
    -----
    The quantile of chi-squared is 2 P^-1(n / 2, p), the inverse of the regularised incomplete gamma
    function: what ``scipy.stats`` computes, without the second that it takes to load.
    """
    low, high = (2.0 * gammaincinv(degrees / 2, p) / degrees for p in PROBABILITIES_95)
    return low, high
