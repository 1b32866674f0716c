"""How two steady clocks differ, from one motion seen on both: measured and true gyro rates."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import fftconvolve

from avionics.errors import JoinError
from avionics.records import FloatArray

TimeArray = NDArray[np.int64]
GRID_S: Final = 0.01
LEAST_CORRELATION: Final = 0.8
# Two lags that fit equally well to this part: a wing that only swings steadily.
AMBIGUOUS: Final = 0.98
BLOCK_S: Final = 1.0
ROUNDS: Final = 8
DONE_S: Final = 1e-8
LEAST_SAMPLES: Final = 100
WORST_CONDITION: Final = 1e12


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Rates of one pod in its sensor's axes.

    Attributes
    ----------
    t_ns : ndarray of int64, shape (n,)
        Each log's own clock, ns, ascending.
    rate_rad_s : ndarray, shape (n, 3)
    """

    t_ns: TimeArray
    rate_rad_s: FloatArray


@dataclass(frozen=True, slots=True)
class ClockFit:
    """The flight's clock against the truth's.

    Attributes
    ----------
    offset_ns : float
        Flight time minus truth time at ``at_ns``, ns.
    sigma_ns : float
        Its one-sigma, from residuals in blocks of a second, ns.
    drift : float
        Flight seconds per truth second, minus one.
    drift_sigma : float
    at_ns : int
        Truth time to which the offset belongs, ns.
    correlation : float
        Of the rates at the coarse alignment, 0 to 1.
    """

    offset_ns: float
    sigma_ns: float
    drift: float
    drift_sigma: float
    at_ns: int
    correlation: float

    def flight_ns(self, truth_ns: int) -> int:
        """Return the flight's time of an instant on the truth's clock, ns."""
        return round(truth_ns + self.offset_ns + self.drift * (truth_ns - self.at_ns))


def fit_clocks(
    flown: Mapping[str, Rates],
    true: Mapping[str, Rates],
    lag_s: Mapping[str, float],
    *,
    expected_ns: float | None = None,
) -> ClockFit:
    """Return how the clocks of two logs differ.

    Parameters
    ----------
    flown, true : mapping of str to Rates
        Measured and true rates by pod; at least one pod in common.
    lag_s : mapping of str to float
        Delay of each pod's gyro filter, s.
    expected_ns : float, optional
        Difference of their UTC offsets, ns; decides between alignments where the motion repeats.

    Raises
    ------
    JoinError
        If they have no pod in common, are too short, or do not show the same motion.
    """
    pods = sorted(set(flown) & set(true))
    if not pods:
        msg = f"flight has pods {sorted(flown)}, truth has {sorted(true)}; none in common"
        raise JoinError(msg)
    pairs = [_Pair(flown[pod], true[pod], lag_s.get(pod, 0.0)) for pod in pods]
    coarse_ns, correlation = _coarse(pairs, expected_ns)
    return _fine(pairs, coarse_ns, correlation)


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    flown: Rates
    true: Rates
    lag_s: float


def _gridded(rates: Rates, start_ns: int, count: int) -> FloatArray:
    """Return the rates on an even grid without their means, zero outside of the record."""
    t_s = (rates.t_ns - start_ns) * 1e-9
    grid = np.arange(count) * GRID_S
    inside = (grid >= t_s[0]) & (grid <= t_s[-1])
    rate = rates.rate_rad_s - np.median(rates.rate_rad_s, axis=0)
    # Spikes would outweigh the motion.
    largest = 1.5 * np.percentile(np.abs(rate), 98, axis=0)
    rate = np.clip(rate, -largest, largest)
    return np.stack([np.where(inside, np.interp(grid, t_s, axis), 0.0) for axis in rate.T], axis=1)


def _coarse(pairs: list[_Pair], expected_ns: float | None) -> tuple[float, float]:
    """Return the offset to a grid step by correlating the whole records, and the correlation."""
    start_f = min(int(pair.flown.t_ns[0]) for pair in pairs)
    start_t = min(int(pair.true.t_ns[0]) for pair in pairs)
    n_f = 1 + int(max(pair.flown.t_ns[-1] - start_f for pair in pairs) * 1e-9 / GRID_S)
    n_t = 1 + int(max(pair.true.t_ns[-1] - start_t for pair in pairs) * 1e-9 / GRID_S)
    if min(n_f, n_t) < 2 / GRID_S:
        msg = "less than 2 s of gyro rates; the clocks cannot be aligned"
        raise JoinError(msg)
    product, power_f, power_t = (np.zeros(n_f + n_t - 1) for _ in range(3))
    for pair in pairs:
        f, t = _gridded(pair.flown, start_f, n_f), _gridded(pair.true, start_t, n_t)
        for axis in range(3):
            product += fftconvolve(f[:, axis], t[::-1, axis])
            power_f += fftconvolve(f[:, axis] ** 2, np.ones(n_t))
            power_t += fftconvolve(np.ones(n_f), t[::-1, axis] ** 2)
    # Only what overlaps counts; little overlap proves nothing.
    least = 0.2 * min(power_f.max(), power_t.max())
    with np.errstate(invalid="ignore", divide="ignore"):
        score = product / np.sqrt(power_f * power_t)
    score[~np.isfinite(score) | (power_f < least) | (power_t < least)] = -1.0
    lags_ns = (np.arange(score.size) - (n_t - 1)) * GRID_S * 1e9 + (start_f - start_t)
    best = int(score.argmax())
    if score[best] < LEAST_CORRELATION:
        msg = (
            f"measured and true rates correlate by {max(score[best], 0):.2f} at best, wanted "
            f"{LEAST_CORRELATION}: is this the truth of this flight, and did the wing move?"
        )
        raise JoinError(msg)
    if expected_ns is not None:
        rivals = np.flatnonzero(score >= AMBIGUOUS * score[best])
        best = int(rivals[np.abs(lags_ns[rivals] - expected_ns).argmin()])
        near = slice(max(0, best - 20), best + 21)
        best = near.start + int(score[near].argmax())
    return float(lags_ns[best]), float(score[best])


def _fine(pairs: list[_Pair], coarse_ns: float, correlation: float) -> ClockFit:
    """Refine offset and drift by Gauss-Newton on the rates.

    The flight's time of truth time t is t plus offset plus drift times (t - middle).
    """
    at_ns = int(np.mean([pair.true.t_ns.mean() for pair in pairs]))
    splines = [
        CubicSpline((pair.true.t_ns - at_ns) * 1e-9, pair.true.rate_rad_s, axis=0) for pair in pairs
    ]
    offset_s, drift = coarse_ns * 1e-9, 0.0
    covariance = np.eye(2)
    for _ in range(ROUNDS):
        normal, scores, right = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2)
        for pair, spline in zip(pairs, splines, strict=True):
            t_s = (pair.flown.t_ns - at_ns) * 1e-9 - pair.lag_s
            x = (t_s - offset_s) / (1 + drift)
            use = (x >= spline.x[0]) & (x <= spline.x[-1])
            if use.sum() >= LEAST_SAMPLES:
                part = _equations(x[use], pair.flown.rate_rad_s[use], spline)
                normal, scores, right = normal + part[0], scores + part[1], right + part[2]
        if not np.linalg.cond(normal) < WORST_CONDITION:
            msg = "the wing moved too little to align the clocks"
            raise JoinError(msg)
        inverse = np.linalg.inv(normal)
        step = inverse @ right
        covariance = inverse @ scores @ inverse
        offset_s, drift = offset_s + step[0], drift + step[1]
        if abs(step[0]) < DONE_S:
            break
    sigma = np.sqrt(np.diag(covariance))
    return ClockFit(
        offset_s * 1e9, float(sigma[0] * 1e9), float(drift), float(sigma[1]), at_ns, correlation
    )


def _equations(
    x: FloatArray, measured: FloatArray, spline: CubicSpline
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return one pod's normal matrix, the scatter of its scores by block, and its right side."""
    slope = -spline(x, 1)
    residual = measured - spline(x)
    residual -= np.median(residual, axis=0)  # a constant bias per axis
    slope -= slope.mean(axis=0)
    rows = np.stack([slope, slope * x[:, None]], axis=-1)
    # A spike or a lost second must not steer the fit.
    scale = 1.4826 * np.median(np.abs(residual), axis=0) + 1e-9
    weight = (np.abs(residual) < 6 * scale) / scale**2
    normal = np.einsum("nai,na,naj->ij", rows, weight, rows)
    each = np.einsum("nai,na,na->ni", rows, weight, residual)
    block = np.floor(x / BLOCK_S).astype(np.int64)
    parts = np.array([each[block == b].sum(axis=0) for b in np.unique(block)])
    return normal, parts.T @ parts, each.sum(axis=0)
