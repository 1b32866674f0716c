"""Tip of the reference line from motion-capture markers, which never stand on the line itself."""

import numpy as np

from avionics.config import Config, Marker
from avionics.flight.filter_setup import marker_model
from avionics.records import FloatArray
from avionics.wse.jacobian import complex_step
from avionics.wse.modes import ModeBasis

PASSES = 5
SHAPE_PRIOR_RAD = 1.0
MARKER_SIGMA_M = 1e-3
AT_TIP = 0.98


def tip_from_markers(
    config: Config, markers: tuple[Marker, ...], marker_m: FloatArray
) -> FloatArray:
    """Return the end of the reference line, fitted to the markers of each instant.

    Parameters
    ----------
    config : Config
        The wing.
    markers : tuple of Marker
        The motion-capture markers.
    marker_m : ndarray, shape (n, K, 3)
        Their positions, body axes, m; NaN where missing.

    Returns
    -------
    ndarray, shape (n, 3)
        NaN where fewer than three markers are known, or none of those at the tip, if there are any.

    Notes
    -----
    A shape of three bending, two twist and one in-plane mode is fitted by Gauss-Newton. Where
    markers stand at the tip's own section, the fit gives that section's attitude only, and their
    mean residual moves the tip: the modes left out then cost nothing.
    """
    count = len({round(m.s_m, 3) for m in markers if m.s_m > 0})
    basis = ModeBasis(
        "quarter-sine", config.wing.span_m, min(3, count), min(2, count), min(1, count)
    )
    points = marker_model(config, basis, markers=markers)
    tip = marker_model(config, basis, markers=[Marker(id=0, s_m=config.wing.span_m)])
    at_tip = np.array([m.s_m > AT_TIP * config.wing.span_m for m in markers])
    weight = 1.0 / MARKER_SIGMA_M**2
    prior = np.eye(basis.count) / SHAPE_PRIOR_RAD**2
    result = np.full((len(marker_m), 3), np.nan)
    q = np.zeros(basis.count)
    for i, measured in enumerate(marker_m):
        known = np.isfinite(measured).all(axis=1)
        near = known & at_tip
        if known.sum() < 3 or (at_tip.any() and not near.any()):
            continue
        for _ in range(PASSES):
            value, slope = complex_step(points.points, q)
            residual = (measured - value)[known].ravel()
            slopes = slope[known].reshape(-1, basis.count)
            step = np.linalg.solve(
                slopes.T @ slopes * weight + prior, slopes.T @ residual * weight - prior @ q
            )
            q = q + step
            if np.abs(step).max() < 1e-7:
                break
        result[i] = tip.points(q)[0]
        if near.any():
            result[i] += (measured - points.points(q))[near].mean(axis=0)
    return result
