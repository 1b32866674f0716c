"""What every tracker is: frames and predictions in, marker tracks out."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from avionics.records import FloatArray, MarkerPrediction, MarkerTracks
from drivers.samples import Frame


class Tracker(Protocol):
    """Finds the markers in one frame after the other; starts by itself."""

    def update(self, frame: Frame, prediction: MarkerPrediction) -> MarkerTracks:
        """Return where a frame shows the markers.

        Parameters
        ----------
        frame : Frame
            The picture, gray or BGR.
        prediction : MarkerPrediction
            Where the filter expects the markers in it, and how surely.
        """
        ...


def tracks_of(
    frame: Frame, pixel: FloatArray, sigma_px: FloatArray, found: NDArray[np.bool_], name: str
) -> MarkerTracks:
    """Return the record of one frame; positions of markers that were not found become NaN."""
    return MarkerTracks(
        frame.t_ns,
        frame.camera,
        frame.index,
        np.where(found[:, None], pixel, np.nan),
        np.where(found, sigma_px, np.nan),
        found,
        name,
    )
