"""Try a tracker on the pictures of a log, without flying anything.

The estimate as flown is the prediction, the log's own tracks are what to compare with.

    .venv/bin/python examples/try_a_tracker.py out/demo.mcap
"""

import sys

import numpy as np

from avionics import read_flight
from avionics.records import MarkerPrediction, MarkerTracks
from avionics.tracking.blobs import gray_of, spots_in
from avionics.tracking.tracker import tracks_of
from drivers.samples import Frame


class NearestSpot:
    """Takes the light that is nearest to each prediction: no memory, no assignment."""

    name = "nearest"
    reach_px = 12.0

    def update(self, frame: Frame, prediction: MarkerPrediction) -> MarkerTracks:
        """Return where a frame shows the markers."""
        gray = gray_of(frame.image)
        pixel = np.full(prediction.pixel.shape, np.nan)
        found = np.zeros(len(pixel), dtype=np.bool_)
        for k, expected in enumerate(prediction.pixel):
            if not np.isfinite(expected).all():
                continue
            spots = spots_in(gray, expected, self.reach_px)
            if len(spots):
                distance = np.linalg.norm(spots.pixel - expected, axis=1)
                pixel[k], found[k] = spots.pixel[np.argmin(distance)], True
        return tracks_of(frame, pixel, np.full(len(pixel), 0.3), found, self.name)


def main(path: str, *, frames: int = 150) -> np.ndarray:
    """Return the distances to the log's own tracks, px."""
    flight = read_flight(path)
    flown, tracks = flight.estimates["crg"], flight.tracks
    tracker, distances = NearestSpot(), []
    for i in range(min(frames, len(tracks.t_ns))):
        frame = flight.frames().with_index(int(tracks.frame_index[i]))
        # The row before the exposure: at most 10 ms old.
        row = max(int(np.searchsorted(flown.t_ns, frame.t_ns)) - 1, 0)
        variance = flown.marker_sigma_px[row][:, :, None] ** 2 * np.eye(2)
        seen = tracker.update(frame, MarkerPrediction(frame.t_ns, flown.marker_px[row], variance))
        both = seen.found & tracks.found[i]
        distances.append(np.linalg.norm(seen.pixel[both] - tracks.pixel[i][both], axis=1))
    apart = np.concatenate(distances)
    print(f"{len(apart)} markers, {np.median(apart):.2f} px from the log's tracks (median)")
    return apart


if __name__ == "__main__":
    main(sys.argv[1])
