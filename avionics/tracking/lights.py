"""Lights that stand still in the picture while the wing moves: they are no markers."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from avionics.records import FloatArray

SAME_PX = 2.0
CERTAIN = 3
FORGET = 40


@dataclass(slots=True)
class StandingLights:
    """Remembers spots that no marker explains and that stay where they are."""

    _pixel: list[FloatArray] = field(default_factory=list)
    _seen: list[int] = field(default_factory=list)
    _absent: list[int] = field(default_factory=list)

    def learn(self, unexplained: FloatArray) -> None:
        """Take the spots (N, 2), px, of one picture that lie away from every marker."""
        for i, known in enumerate(self._pixel):
            distance = np.linalg.norm(unexplained - known, axis=1)
            if distance.size and distance.min() < SAME_PX:
                self._seen[i] += 1
                self._absent[i] = 0
            else:
                self._absent[i] += 1
        known = self.pixel(certain=False)
        for spot in unexplained:
            if not len(known) or np.linalg.norm(known - spot, axis=1).min() >= SAME_PX:
                self._pixel.append(spot.copy())
                self._seen.append(1)
                self._absent.append(0)
        keep = [i for i, absent in enumerate(self._absent) if absent < FORGET]
        self._pixel = [self._pixel[i] for i in keep]
        self._seen = [self._seen[i] for i in keep]
        self._absent = [self._absent[i] for i in keep]

    def pixel(self, *, certain: bool = True) -> FloatArray:
        """Return the lights' pixels, shape (n, 2)."""
        chosen = [
            pixel
            for pixel, seen in zip(self._pixel, self._seen, strict=True)
            if seen >= (CERTAIN if certain else 1)
        ]
        return np.array(chosen, dtype=np.float64).reshape(-1, 2)

    def are_at(self, spots: FloatArray) -> NDArray[np.bool_]:
        """Return which spots (N, 2) are such lights, shape (N,)."""
        lights = self.pixel()
        if not len(lights) or not len(spots):
            return np.zeros(len(spots), dtype=np.bool_)
        distance = np.linalg.norm(spots[:, None] - lights[None], axis=-1)
        return np.asarray(distance.min(axis=1) < SAME_PX)
