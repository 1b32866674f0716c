"""The LED tracker: sub-pixel centroids of bright spots, found where the filter expects markers."""

import numpy as np
from numpy.typing import NDArray

from avionics.config import Config
from avionics.records import FloatArray, MarkerPrediction, MarkerTracks
from avionics.tracking.assignment import (
    NONE,
    IntArray,
    assign,
    best_hypothesis,
    common_shift,
)
from avionics.tracking.blobs import Blobs, Image, find_blobs, gray_of, spots_in
from avionics.tracking.centroid import refine
from avionics.tracking.lights import StandingLights
from avionics.tracking.tracker import tracks_of
from drivers.samples import Frame

GATE = 4.0
"""Gate of one marker about the common shift, in sigmas."""
SHAPE_PX = 1.0
"""One-sigma of a marker's deviation from prediction and common shift, beyond the filter's own."""
OWN_PX = 1.5
"""One-sigma of a single marker's deviation from its prediction, beyond the filter's own."""
AGREEING = 0.6
"""Share of the markers in view whose common shift is used against the filter's prediction."""
COMMON_PX = 6.0
"""One-sigma of the common shift beyond the filter's own."""
WIDE_PX = 25.0
"""A prediction less sure than this is searched for as a whole pattern in the whole picture."""
LARGEST_REACH_PX = 60.0
HYPOTHESIS_PX = 14.0
WORST_COST = 0.45
SCAN_EVERY = 15
LOST_FRAMES = 8
AREA_FACTOR = 3.0
HEIGHT_FACTOR = 2.6
LONG_FRAMES = 30
LONG_HEIGHT_FACTOR = 3.5
LEARN = 0.05
CROSSING_PX = 9.0
MAX_REFINE_PX = 3.0
CROWDED_PX = 6.0
CROWDED_SIGMA_PX = 0.3


class LedTracker:
    """Tracks LEDs without templates.

    Parameters
    ----------
    config : Config
        Markers and size of the picture.
    """

    name = "led"

    def __init__(self, config: Config) -> None:
        count = len(config.markers)
        self._lights = StandingLights()
        self._area = np.full(count, np.nan)
        self._height = np.full(count, np.nan)
        self._absent = np.zeros(count, dtype=np.int64)
        self._is_locked = False
        self._lost = 0
        self._frames = 0

    @property
    def is_locked(self) -> bool:
        """Whether the pattern is known to be where the prediction says."""
        return self._is_locked

    def update(self, frame: Frame, prediction: MarkerPrediction) -> MarkerTracks:
        """Return where a frame shows the markers."""
        gray = gray_of(frame.image)
        expected = _visible(prediction.pixel, gray.shape)
        self._frames += 1
        sigma = np.sqrt(np.maximum(prediction.covariance_px2.trace(axis1=1, axis2=2), 0.0))
        known = np.isfinite(expected[:, 0])
        is_wide = not known.any() or float(np.median(sigma[known])) > WIDE_PX
        is_lost = self._lost >= LOST_FRAMES and self._lost % LOST_FRAMES == 0
        if self._is_locked and not is_wide and not is_lost:
            spots, chosen = self._near(gray, expected, prediction.covariance_px2)
        else:
            spots, chosen = self._anywhere(gray, prediction, expected)
        tracks = self.measure(frame, gray, spots, chosen)
        self._judge(tracks, gray, expected, known)
        return tracks

    def measure(self, frame: Frame, gray: Image, spots: Blobs, chosen: IntArray) -> MarkerTracks:
        """Return the tracks of markers that have a spot, to a fraction of a pixel."""
        count = len(chosen)
        pixel, sigma = np.full((count, 2), np.nan), np.full(count, np.nan)
        found = np.zeros(count, dtype=np.bool_)
        lights = self._lights.pixel()
        for k in np.flatnonzero(chosen != NONE):
            spot = int(chosen[k])
            place = self.position(gray, spots, spot)
            if place is None:
                continue
            u, v, error = place
            near = np.linalg.norm(lights - (u, v), axis=1) < CROSSING_PX
            pixel[k], found[k] = (u, v), True
            # A standing light nearby pulls the centroid by an unknown part of a pixel.
            sigma[k] = np.hypot(error, 1.5) if near.any() else error
            if not near.any():
                self._remember(int(k), spots.area_px[spot], spots.height[spot])
        return tracks_of(frame, pixel, sigma, found, self.name)

    def position(self, gray: Image, spots: Blobs, spot: int) -> tuple[float, float, float] | None:
        """Return (u, v, sigma) of a spot to a part of a pixel, px; None if nothing is left."""
        rough, radius = spots.pixel[spot], float(np.sqrt(spots.area_px[spot] / np.pi))
        size = np.array(gray.shape[::-1])
        if (rough < radius).any() or (rough > size - 1 - radius).any():
            return None  # cut by the edge of the picture: its middle is not where it seems
        apart = np.linalg.norm(spots.pixel - rough, axis=1)
        apart[spot] = np.inf
        neighbour = float(apart.min())
        u, v, sigma = refine(
            gray, float(rough[0]), float(rough[1]), float(spots.area_px[spot]), neighbour
        )
        if not np.isfinite(sigma) or np.hypot(u - rough[0], v - rough[1]) > MAX_REFINE_PX:
            return None
        # A neighbour's halo bends the background; how much depends on where it stands.
        is_crowded = neighbour < 2.0 * radius + CROWDED_PX
        return u, v, float(np.hypot(sigma, CROWDED_SIGMA_PX)) if is_crowded else sigma

    def _remember(self, marker: int, area_px: float, height: float) -> None:
        for store, value in ((self._area, area_px), (self._height, height)):
            old = store[marker]
            store[marker] = value if np.isnan(old) else old + LEARN * (value - old)

    def candidates(self, gray: Image, centres: FloatArray, reach_px: FloatArray) -> Blobs:
        """Return the spots within square windows about the centres that are not NaN."""
        least = float(np.nanmin(self._height)) / HEIGHT_FACTOR if self._knows_height() else 30.0
        parts = [
            spots_in(gray, centre, float(reach), min_contrast=max(30.0, least))
            for centre, reach in zip(centres, reach_px, strict=True)
            if np.isfinite(centre).all()
        ]
        return _unique(parts)

    def _knows_height(self) -> bool:
        return bool(np.isfinite(self._height).any())

    def _near(
        self, gray: Image, expected: FloatArray, covariance: FloatArray
    ) -> tuple[Blobs, IntArray]:
        """Find the markers about their predictions.

        Each must lie where the filter says it can be; only when most of them agree on one shift
        is the filter taken to be wrong, and the pattern right.
        """
        own = np.nan_to_num(covariance)
        variance = own.trace(axis1=1, axis2=2) / 2
        reach = np.minimum(3.0 * np.sqrt(variance + COMMON_PX**2), LARGEST_REACH_PX)
        spots = self.candidates(gray, expected, reach)
        spots = spots.take(~self._forbidden(spots, expected))
        unlike = self._unlike(spots)
        likely = 2.0 * own + OWN_PX**2 * np.eye(2)
        chosen = assign(expected, spots.pixel, likely, gate=GATE, penalty=unlike)
        shift = common_shift(expected, spots.pixel, reach)
        # Against the common shift the filter's own spread says little: most of it is common.
        within = 0.25 * own + SHAPE_PX**2 * np.eye(2)
        shifted = assign(expected + shift, spots.pixel, within, gate=GATE, penalty=unlike)
        agree = int((shifted != NONE).sum())
        visible = int(np.isfinite(expected[:, 0]).sum())
        if agree >= max(min(3, len(expected)), AGREEING * visible):
            return spots, shifted
        return spots, chosen

    def _forbidden(self, spots: Blobs, expected: FloatArray) -> NDArray[np.bool_]:
        """Return which spots are standing lights that no marker is expected to cross now."""
        standing = self._lights.are_at(spots.pixel)
        if not standing.any():
            return standing
        distance = np.linalg.norm(spots.pixel[:, None] - expected[None], axis=-1)
        return np.asarray(standing & (np.nan_to_num(distance, nan=1e9).min(axis=1) > 3.0))

    def _unlike(self, spots: Blobs) -> FloatArray:
        """Return a penalty for pairs whose size or brightness does not match, shape (K, N)."""
        # After a long absence the light may have changed: what a marker looked like counts less.
        factor = np.where(self._absent > LONG_FRAMES, LONG_HEIGHT_FACTOR, HEIGHT_FACTOR)
        with np.errstate(invalid="ignore", divide="ignore"):
            area = np.abs(np.log(spots.area_px[None] / self._area[:, None])) / np.log(AREA_FACTOR)
            height = np.abs(np.log(spots.height[None] / self._height[:, None]))
        worst = np.fmax(np.nan_to_num(area), np.nan_to_num(height / np.log(factor)[:, None]))
        return np.where(worst > 1.0, np.inf, worst**2)

    def _anywhere(
        self, gray: Image, prediction: MarkerPrediction, expected: FloatArray
    ) -> tuple[Blobs, IntArray]:
        """Find the whole pattern in the whole picture."""
        spots = find_blobs(gray)
        spots = spots.take(~self._lights.are_at(spots.pixel))
        nothing = np.full(len(expected), NONE, dtype=np.int64)
        if len(spots) == 0:
            return spots, nothing
        possible = expected[None]
        if prediction.hypotheses_px is not None:
            others = _visible(prediction.hypotheses_px, gray.shape)
            possible = np.concatenate([possible, others])
        inside = np.asarray(np.isfinite(possible).all(axis=-1))
        index, cost = best_hypothesis(possible, spots.pixel, inside, tolerance_px=HYPOTHESIS_PX)
        if cost > WORST_COST:
            return spots, nothing
        place = possible[index]
        reach = np.full(len(place), HYPOTHESIS_PX)
        place = place + common_shift(place, spots.pixel, reach)
        spread = np.broadcast_to((HYPOTHESIS_PX / 3) ** 2 * np.eye(2), (len(place), 2, 2))
        chosen = assign(place, spots.pixel, spread, gate=3.0)
        matched = int((chosen != NONE).sum())
        needed = max(min(3, len(place)), round(0.6 * int(inside[index].sum())))
        if matched < needed:
            return spots, nothing
        self._is_locked = True
        return spots, chosen

    def _judge(
        self, tracks: MarkerTracks, gray: Image, expected: FloatArray, known: NDArray[np.bool_]
    ) -> None:
        """Notice a lost pattern, and now and then learn the lights that stand still."""
        self._absent = np.where(tracks.found, 0, self._absent + 1)
        is_there = int(tracks.found.sum()) >= 0.35 * int(known.sum())
        self._lost = 0 if is_there else self._lost + 1
        if self._is_locked and self._frames % SCAN_EVERY == 0 and tracks.found.any():
            spots = find_blobs(gray).pixel
            places = np.concatenate([expected[known], tracks.pixel[tracks.found]])
            distance = np.linalg.norm(spots[:, None] - places[None], axis=-1)
            self._lights.learn(spots[distance.min(axis=1) > 12.0])


def _visible(pixel: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return the pixels with those outside the picture as NaN."""
    height, width = shape[:2]
    u, v = pixel[..., 0], pixel[..., 1]
    with np.errstate(invalid="ignore"):
        inside = (u > -0.5) & (u < width - 0.5) & (v > -0.5) & (v < height - 0.5)
    return np.where(inside[..., None], pixel, np.nan)


def _unique(parts: list[Blobs]) -> Blobs:
    """Return the spots of several windows, each once."""
    if not parts:
        return Blobs(np.empty((0, 2)), np.empty(0), np.empty(0))
    pixel = np.concatenate([p.pixel for p in parts])
    area = np.concatenate([p.area_px for p in parts])
    height = np.concatenate([p.height for p in parts])
    # A window's edge may cut a spot; of two views of one spot the larger is whole.
    order = np.argsort(-area, kind="stable")
    keep: list[int] = []
    for i in order:
        radius = 1.5 + np.sqrt(area[i] / np.pi)
        if all(np.hypot(*(pixel[i] - pixel[j])) > radius for j in keep):
            keep.append(int(i))
    kept = np.array(sorted(keep), dtype=np.int64)
    return Blobs(pixel[kept], height[kept], area[kept])
