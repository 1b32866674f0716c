"""One picture of the wing: LEDs with bloom, saturation, motion blur and noise on a background.

Only small patches are computed; the background's noise comes from a bank of tiles. A 640x480
picture with six LEDs costs about two milliseconds.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_bus.wing.scenario import Picture

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]
Box = tuple[int, int, int, int]
TILES, MARGIN = 3, 64
SHARP_SIGMA_PX = 0.9  # of the lens itself
HALO_SIGMAS, CORE_SIGMAS = 2.6, 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """One light in the picture.

    Attributes
    ----------
    path_px : ndarray, shape (n, 2)
        Where it is at even instants of the exposure, px.
    peak : float
        Counts at its centre if it stood still, unclipped.
    sigma_px : float
        Of its image.
    """

    path_px: FloatArray
    peak: float
    sigma_px: float


class Painter:
    """Paints pictures of one size and one look.

    Parameters
    ----------
    width_px, height_px : int
        Size.
    look : Picture
        Background, noise, bloom.
    rng : numpy.random.Generator
        Texture and noise.
    """

    def __init__(
        self, width_px: int, height_px: int, look: Picture, rng: np.random.Generator
    ) -> None:
        self._size, self._look, self._rng = (height_px, width_px), look, rng
        self._background = self._make_background()
        level = float(self._background.mean())
        sigma = np.hypot(look.read_noise, np.sqrt(level / look.photons_per_count))
        shape = (TILES, height_px + MARGIN, width_px + MARGIN)
        noise = sigma * rng.standard_normal(shape, dtype=np.float32)
        self._tiles = np.rint(noise).astype(np.int8)

    def _make_background(self) -> Image:
        """Blotches, fine grain, two soft edges and a vignette."""
        height, width = self._size
        look, rng = self._look, self._rng
        total = np.full(self._size, look.background, dtype=np.float32)
        for sigma, share in ((40.0, 1.0), (9.0, 0.5), (1.5, 0.25)):
            field = cv2.GaussianBlur(
                rng.standard_normal(self._size).astype(np.float32), (0, 0), sigma
            )
            total += look.texture * share * field / field.std()
        v, u = np.mgrid[0:height, 0:width].astype(np.float32)
        for _ in range(2):
            angle, place = rng.uniform(0, np.pi), rng.uniform(-0.3, 0.3) * width
            across = (u - width / 2) * np.cos(angle) + (v - height / 2) * np.sin(angle) - place
            total += 0.6 * look.texture * np.tanh(across / 3)
        radius = np.hypot(u - width / 2, v - height / 2) / np.hypot(width, height)
        return np.asarray(np.clip(np.rint(total * (1 - 0.5 * radius**2)), 0, 255), dtype=np.uint8)

    def paint(
        self, lights: list[Light], *, gain: float = 1.0, bars: list[FloatArray] | None = None
    ) -> Image:
        """Return a picture.

        Parameters
        ----------
        lights : list of Light
            What shines.
        gain : float
            Illumination of the background, 1 = as made.
        bars : list of ndarray, shape (2, 2)
            Ends of lit bars, px.
        """
        lit, image = self.backdrop(gain, bars or [])
        self._add_lights(image, lit, lights)
        return image

    def backdrop(self, gain: float, bars: list[FloatArray]) -> tuple[Image, Image]:
        """Return the background without and with the camera's noise, before any light."""
        height, width = self._size
        rng = self._rng
        row, column, tile = rng.integers(MARGIN), rng.integers(MARGIN), rng.integers(TILES)
        lit: Image = np.asarray(cv2.convertScaleAbs(self._background, alpha=gain), dtype=np.uint8)
        for bar in bars:
            self._add_bar(lit, bar)
        noise = self._tiles[tile, row : row + height, column : column + width]
        return lit, np.asarray(cv2.add(lit, noise, dtype=cv2.CV_8U), dtype=np.uint8)

    def boxes(self, lights: list[Light]) -> list[Box]:
        """Return the patches of a picture that lights reach: left, right, top, bottom, px."""
        return [box for light in lights if (box := self._box(light)) is not None]

    def _box(self, light: Light) -> Box | None:
        height, width = self._size
        reach = max(HALO_SIGMAS * self._look.bloom_sigma_px, CORE_SIGMAS * light.sigma_px)
        low = np.floor(light.path_px.min(axis=0) - reach)
        high = np.ceil(light.path_px.max(axis=0) + reach) + 1
        left, top = np.clip(low, 0, (width, height)).astype(int).tolist()
        right, bottom = np.clip(high, 0, (width, height)).astype(int).tolist()
        return (left, right, top, bottom) if right > left and bottom > top else None

    def _add_bar(self, lit: NDArray[np.uint8], bar: FloatArray) -> None:
        height, width = self._size
        if not np.isfinite(bar).all():
            return
        left, top = np.clip(np.floor(bar.min(axis=0)) - 8, 0, (width, height)).astype(int)
        right, bottom = np.clip(np.ceil(bar.max(axis=0)) + 9, 0, (width, height)).astype(int)
        if right - left < 2 or bottom - top < 2:
            return
        mask = np.zeros((bottom - top, right - left), dtype=np.uint8)
        ends = np.rint((bar - (left, top)) * 16).astype(int)
        level = min(255, round(self._look.lit_bar))
        cv2.line(mask, tuple(ends[0]), tuple(ends[1]), level, 4, cv2.LINE_AA, 4)
        blurred = cv2.GaussianBlur(mask, (0, 0), 1.5)
        part = lit[top:bottom, left:right]
        part[:] = cv2.add(part, blurred)

    def _add_lights(self, image: Image, lit: NDArray[np.uint8], lights: list[Light]) -> None:
        """Add light in patches; those that overlap are summed before they clip."""
        look = self._look
        reached = [(light, box) for light in lights if (box := self._box(light)) is not None]
        if not reached:
            return
        layer = np.zeros(self._size, dtype=np.float32)
        for light, (left, right, top, bottom) in reached:
            layer[top:bottom, left:right] += self._spot(light, left, right, top, bottom)
        for _, (left, right, top, bottom) in reached:
            part = np.s_[top:bottom, left:right]
            signal = lit[part] + layer[part]
            noise = self._rng.standard_normal(signal.shape, dtype=np.float32)
            signal += noise * np.sqrt(look.read_noise**2 + signal / look.photons_per_count)
            image[part] = np.clip(np.rint(signal), 0, 255)

    def _spot(
        self, light: Light, left: int, right: int, top: int, bottom: int
    ) -> NDArray[np.float32]:
        """Return the light of one LED over its exposure: core along the path, halo at its mean."""
        u, v = np.arange(left, right), np.arange(top, bottom)
        core = 2 * light.sigma_px**2
        across = np.exp(-((u - light.path_px[:, :1]) ** 2) / core)
        down = np.exp(-((v - light.path_px[:, 1:]) ** 2) / core)
        spot = (light.peak / len(light.path_px)) * (down.T @ across)
        middle, wide = light.path_px.mean(axis=0), 2 * self._look.bloom_sigma_px**2
        halo = np.outer(
            np.exp(-((v - middle[1]) ** 2) / wide), np.exp(-((u - middle[0]) ** 2) / wide)
        )
        return np.asarray(spot + self._look.bloom * light.peak * halo, dtype=np.float32)
