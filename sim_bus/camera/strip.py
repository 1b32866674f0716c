"""Pictures made beforehand, kept as what the lights change: a strip to be developed later.

A picture is a background with the camera's noise, cheap to make, and patches about its lights,
where all the work is. The patches of a minute at 30 frames a second take 15 MB, whole pictures of
1280x720 would take 1.7 GB.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sim_bus.camera.picture import Box, Image

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Still:
    """One picture as its parts: background and what moves before it.

    Attributes
    ----------
    jitter_ns : int
        Middle of its exposure against the even grid of frames, ns.
    paths_px : ndarray, shape (SUBSTEPS, K, 2)
        The LEDs at even instants of the exposure, px.
    depth_m : ndarray, shape (K,)
        Their distances along the optical axis, m.
    boxes : list of Box
        The patches: left, right, top, bottom, px.
    patches : list of ndarray of uint8
        Their content, lights and noise included.
    """

    jitter_ns: int
    paths_px: FloatArray
    depth_m: FloatArray
    boxes: list[Box]
    patches: list[Image]


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """Pictures in the order of their exposures.

    Attributes
    ----------
    jitter_ns : ndarray of int64, shape (n,)
    paths_px : ndarray, shape (n, SUBSTEPS, K, 2)
    depth_m : ndarray, shape (n, K)
        As of ``Still``.
    first_patch : ndarray of int64, shape (n + 1,)
        Number of each picture's first patch; the last one is the number of all.
    boxes : ndarray of int64, shape (patches, 4)
    first_pixel : ndarray of int64, shape (patches,)
        Where each patch begins in ``pixels``.
    pixels : ndarray of uint8
        All patches, row by row.
    """

    jitter_ns: NDArray[np.int64]
    paths_px: FloatArray
    depth_m: FloatArray
    first_patch: NDArray[np.int64]
    boxes: NDArray[np.int64]
    first_pixel: NDArray[np.int64]
    pixels: NDArray[np.uint8]

    @classmethod
    def of(cls, stills: Sequence[Still]) -> "Strip":
        """Return the strip of one or more stills."""
        patches = [patch.ravel() for still in stills for patch in still.patches]
        boxes = [box for still in stills for box in still.boxes]
        return cls(
            jitter_ns=np.array([still.jitter_ns for still in stills], dtype=np.int64),
            paths_px=np.stack([still.paths_px for still in stills]),
            depth_m=np.stack([still.depth_m for still in stills]),
            first_patch=np.cumsum([0, *(len(still.boxes) for still in stills)]),
            boxes=np.array(boxes, dtype=np.int64).reshape(-1, 4),
            first_pixel=np.cumsum([0, *(patch.size for patch in patches)])[:-1],
            pixels=np.concatenate([np.empty(0, dtype=np.uint8), *patches]),
        )

    @property
    def count(self) -> int:
        """Number of pictures."""
        return len(self.jitter_ns)

    def develop(self, number: int, backdrop: Image) -> Image:
        """Put the patches of one picture on its background; returns the background."""
        for k in range(self.first_patch[number], self.first_patch[number + 1]):
            left, right, top, bottom = self.boxes[k].tolist()
            shape, start = (bottom - top, right - left), int(self.first_pixel[k])
            patch = self.pixels[start : start + shape[0] * shape[1]]
            backdrop[top:bottom, left:right] = patch.reshape(shape)
        return backdrop

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Return the arrays by name, for a file."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> "Strip":
        """Return the strip of such arrays; more than its own are left alone."""
        return cls(**{field.name: arrays[field.name] for field in fields(cls)})  # type: ignore[arg-type]
