"""Derivatives by complex step: every perturbation in one batched call."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

STEP = 1e-30


@lru_cache
def _steps(n: int) -> Array:
    steps: Array = (1j * STEP) * np.eye(n)
    return steps


def perturbed(x: Array) -> Array:
    """Return ``x`` (..., n) with each entry stepped by i * STEP in turn, shape (..., n, n)."""
    stepped: Array = x[..., None, :] + _steps(x.shape[-1])
    return stepped


def derivatives(values: Array) -> Array:
    """Return the derivatives that perturbed results hold in their imaginary parts.

    Parameters
    ----------
    values : ndarray of complex, shape (perturbations, ...)
        Results of a batched call.

    Returns
    -------
    ndarray, shape (..., perturbations)
    """
    axes = (*range(1, values.ndim), 0)
    found: Array = values.imag.transpose(axes) / STEP
    return found


def complex_step(f: Callable[[Array], Array], x: Array) -> tuple[Array, Array]:
    """Return value and Jacobian of an analytic function by one batched call.

    Parameters
    ----------
    f : callable
        Takes (..., n) complex and returns (..., m) complex.
    x : ndarray, shape (n,)
        Where.

    Returns
    -------
    value : ndarray, shape (m,)
    jacobian : ndarray, shape (m, n)

    Notes
    -----
    Srikanth et al., Eq. 9. The step is so small that its square vanishes: exact to rounding.
    """
    values = f(perturbed(x))
    return values[0].real.copy(), derivatives(values)
