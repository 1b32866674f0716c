"""Figures of merit of an estimate against the truth, over segments of a trajectory."""

from dataclasses import dataclass

import numpy as np

from avionics.pos.compiled import Array
from avionics.pos.estimate import Estimate
from avionics.pos.simulate import SlaveTruth

QUANTITIES = ("system", "misalignment", "flexure")


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of the trajectory, s, ends included."""

    name: str
    start: float
    end: float


@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """Errors of one run; quantities in the order of ``QUANTITIES``, all rad.

    Attributes
    ----------
    std, rmse : ndarray, shape (3, S, 3)
        Standard deviation and root mean square of the error by quantity, segment, axis.
    sigma : ndarray, shape (3, S, 3)
        Root mean square of the filter's own one-sigma.
    std_pooled, rmse_pooled : ndarray, shape (3, 3)
        Over all segments together.
    nees : float
        Normalised error squared of the system angle over three, mean over the segments.
    """

    std: Array
    rmse: Array
    sigma: Array
    std_pooled: Array
    rmse_pooled: Array
    nees: float


def errors(estimate: Estimate, truth: SlaveTruth) -> Array:
    """Return estimate minus truth, rad, shape (3, K, 3), by quantity, instant, axis."""
    rho = estimate.rho - truth.rho
    theta = estimate.theta - truth.theta[estimate.index]
    return np.stack([rho + theta, rho, theta])


def sigmas(estimate: Estimate) -> Array:
    """Return the filter's one-sigmas, rad, shape (3, K, 3), by quantity, instant, axis."""
    own = np.sqrt(np.einsum("kii->ki", estimate.covariance))
    return np.stack([estimate.system_sigma, own[:, :3], own[:, 3:]])


def statistics(
    estimate: Estimate, truth: SlaveTruth, dt: float, segments: tuple[Segment, ...]
) -> Statistics:
    """Return the figures of one run.

    Parameters
    ----------
    estimate : Estimate
        K instants.
    truth : SlaveTruth
        On the grid.
    dt : float
        Grid step, s.
    segments : tuple of Segment
        Where to count.

    Raises
    ------
    ValueError
        If a segment holds no output instant.
    """
    t = estimate.index * dt
    inside = [(t >= s.start - 0.5 * dt) & (t <= s.end + 0.5 * dt) for s in segments]
    for segment, mine in zip(segments, inside, strict=True):
        if not mine.any():
            msg = f"segment {segment.name}: {segment.start} to {segment.end} s holds no estimate"
            raise ValueError(msg)
    error, sigma = errors(estimate, truth), sigmas(estimate)
    pooled = np.any(inside, axis=0)
    return Statistics(
        std=np.stack([error[:, mine].std(axis=1) for mine in inside], axis=1),
        rmse=np.stack([_rms(error[:, mine]) for mine in inside], axis=1),
        sigma=np.stack([_rms(sigma[:, mine]) for mine in inside], axis=1),
        std_pooled=error[:, pooled].std(axis=1),
        rmse_pooled=_rms(error[:, pooled]),
        nees=_mean_nees(error[0][pooled], estimate.system_covariance[pooled]),
    )


def _rms(values: Array) -> Array:
    """Root mean square over the instants, shape (Q, 3)."""
    result: Array = np.sqrt(np.mean(values**2, axis=1))
    return result


def _mean_nees(error: Array, covariance: Array) -> float:
    """Mean of e^T P^-1 e / 3."""
    normalised = np.linalg.solve(covariance, error[:, :, None])[:, :, 0]
    return float(np.mean(np.sum(error * normalised, axis=1)) / 3.0)
