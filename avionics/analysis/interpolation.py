"""Values between the samples of a series."""

import numpy as np
from scipy.interpolate import CubicSpline

from avionics.analysis.series import TimeArray
from avionics.records import FloatArray

MAX_GAP_NS = 45_000_000


def between(
    t_ns: TimeArray, values: FloatArray, wanted_ns: TimeArray, *, max_gap_ns: int = MAX_GAP_NS
) -> FloatArray:
    """Return values between samples by a cubic spline; NaN outside and inside longer gaps.

    Parameters
    ----------
    t_ns : ndarray, shape (n,)
        Instants of the samples, increasing.
    values : ndarray, shape (n, ...)
        Samples; each column is interpolated over its own finite ones.
    wanted_ns : ndarray, shape (m,)
        Instants wanted.
    max_gap_ns : int
        Longest gap that is interpolated, ns.

    Returns
    -------
    ndarray, shape (m, ...)
    """
    flat = values.reshape(len(values), -1)
    result = np.full((len(wanted_ns), flat.shape[1]), np.nan)
    patterns: dict[bytes, list[int]] = {}
    finite = np.isfinite(flat)
    for column in range(flat.shape[1]):
        patterns.setdefault(finite[:, column].tobytes(), []).append(column)
    for columns in patterns.values():
        use = finite[:, columns[0]]
        if use.sum() < 4:
            continue
        known_ns = t_ns[use]
        after = np.searchsorted(known_ns, wanted_ns)
        low = np.clip(after - 1, 0, len(known_ns) - 1)
        high = np.clip(after, 0, len(known_ns) - 1)
        exact = known_ns[high] == wanted_ns
        gap = known_ns[high] - known_ns[low]
        inside = (wanted_ns >= known_ns[0]) & (wanted_ns <= known_ns[-1])
        fits = inside & (exact | (gap <= max_gap_ns))
        origin = known_ns[0]
        spline = CubicSpline((known_ns - origin) * 1e-9, flat[use][:, columns])
        rows = np.flatnonzero(fits)
        result[np.ix_(rows, np.array(columns))] = spline((wanted_ns[rows] - origin) * 1e-9)
    return result.reshape(len(wanted_ns), *values.shape[1:])


def linear_at(t_ns: TimeArray, values: FloatArray, wanted_ns: int) -> FloatArray:
    """Return values at an instant, linear between neighbours, held at the ends.

    Parameters
    ----------
    t_ns : ndarray, shape (n,)
        Instants of the samples, increasing.
    values : ndarray, shape (n, ...)
        Samples.
    wanted_ns : int
        Instant wanted.

    Returns
    -------
    ndarray, shape (...)
    """
    right = int(np.searchsorted(t_ns, wanted_ns))
    if right == 0 or right == len(t_ns):
        return np.asarray(values[min(right, len(t_ns) - 1)])
    left = right - 1
    weight = (wanted_ns - t_ns[left]) / (t_ns[right] - t_ns[left])
    return np.asarray(values[left] + weight * (values[right] - values[left]), dtype=np.float64)
