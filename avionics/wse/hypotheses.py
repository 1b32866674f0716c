"""Where the markers could be when the shape is not known: pictures of possible wings.

A covariance linearised about one shape says little when bending is uncertain by fifteen degrees;
whoever searches the markers then needs the curves on which they lie.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.markers import MarkerModel

Array = NDArray[Any]

# Steps along the three directions of amplitude space that move the markers most, in sigmas.
GRIDS = (np.linspace(-2.6, 2.6, 53), np.linspace(-1.5, 1.5, 5), np.linspace(-1.0, 1.0, 3))


def marker_hypotheses(model: MarkerModel, prior: Array) -> Array | None:
    """Return the pixels of all markers for shapes spread over the prior about the straight wing.

    Parameters
    ----------
    model : MarkerModel
        The markers before the camera.
    prior : ndarray, shape (n, n)
        Covariance of the amplitudes before anything is known, rad^2.

    Returns
    -------
    ndarray, shape (S, K, 2), or None
        NaN behind the camera; None where the camera sees no marker of the straight wing.
    """
    q = np.zeros(model.basis.count)
    view = model.view(q)
    if model.camera is None or not view.can_see.any():
        return None
    values, vectors = np.linalg.eigh(prior)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    slopes = view.pixel_by_q[view.can_see].reshape(-1, len(q)) @ root
    _, _, directions = np.linalg.svd(slopes, full_matrices=False)
    axes = (root @ directions[: len(GRIDS)].T).T
    steps = np.stack(np.meshgrid(*GRIDS[: len(axes)], indexing="ij"), axis=-1)
    shapes = steps.reshape(-1, len(axes)) @ axes
    points = model.points(shapes)
    pixel: Array = model.camera.project(points)
    return np.where(model.camera.can_see(points)[..., None], pixel, np.nan)
