"""Pictures of LEDs drawn by code that shares nothing with the tracker or the simulator."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from avionics.config import Camera, Config, Marker, Wing
from avionics.records import MarkerPrediction
from drivers.samples import Frame

SHAPE = (240, 320)
Pixel = tuple[float, float]


@dataclass
class Scene:
    """What one picture shows."""

    leds: Sequence[Pixel]
    hidden: Sequence[int] = ()
    others: Sequence[Pixel] = ()
    bars: Sequence[tuple[Pixel, Pixel]] = ()
    bar_height: float = 70.0
    peak: float = 600.0
    sigma_px: float = 1.6
    ground: float = 30.0
    blur_px: Pixel = (0.0, 0.0)
    noise: float = 2.0
    seed: int = 0
    colour: bool = False
    shape: tuple[int, int] = field(default=SHAPE)


def draw(scene: Scene) -> np.ndarray:
    """Return the picture of a scene, gray uint8."""
    rng = np.random.default_rng(scene.seed)
    v, u = np.mgrid[: scene.shape[0], : scene.shape[1]].astype(float)
    image = scene.ground + 6 * np.sin(u / 17) * np.cos(v / 23)
    for (u0, v0), (u1, v1) in scene.bars:
        along = np.array([u1 - u0, v1 - v0])
        length = np.hypot(*along)
        across = np.abs((u - u0) * along[1] - (v - v0) * along[0]) / length
        part = ((u - u0) * along[0] + (v - v0) * along[1]) / length
        image += scene.bar_height * ((across < 2.5) & (part > 0) & (part < length))
    lights = [p for k, p in enumerate(scene.leds) if k not in scene.hidden] + list(scene.others)
    for u0, v0 in lights:
        for step in np.linspace(-0.5, 0.5, 7):
            r2 = (u - u0 - step * scene.blur_px[0]) ** 2 + (v - v0 - step * scene.blur_px[1]) ** 2
            image += scene.peak / 7 * np.exp(-r2 / (2 * scene.sigma_px**2))
            image += 30 / 7 * np.exp(-r2 / (2 * 6.0**2))
    image += rng.normal(0, scene.noise, image.shape)
    gray = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    return np.repeat(gray[:, :, None], 3, axis=2) if scene.colour else gray


def prediction_at(pixel, sigma_px: float = 1.0, hypotheses=None) -> MarkerPrediction:
    pixel = np.array(pixel, dtype=float)
    covariance = np.broadcast_to(sigma_px**2 * np.eye(2), (len(pixel), 2, 2)).copy()
    return MarkerPrediction(0, pixel, covariance, hypotheses)


def frame_of(scene: Scene, index: int = 0) -> Frame:
    return Frame(index, "root", index, draw(scene))


LEDS: tuple[Pixel, ...] = (
    (70.3, 190.6), (190.8, 191.2), (95.4, 120.7), (165.1, 121.3), (84.6, 71.4), (175.9, 70.2),
)  # fmt: skip


@pytest.fixture
def config() -> Config:
    return config_for(len(LEDS))


def config_for(count: int, tracker: str = "led") -> Config:
    camera = Camera(
        width_px=SHAPE[1], height_px=SHAPE[0], f_x_px=300, f_y_px=300, c_x_px=160, c_y_px=120
    )
    markers = tuple(Marker(id=k, s_m=0.1 * (k + 1)) for k in range(count))
    return Config.model_validate(
        {
            "wing": Wing(span_m=1.5).model_dump(),
            "markers": [m.model_dump() for m in markers],
            "camera": camera.model_dump(),
            "tracker": {"name": tracker},
        }
    )


Draw = Callable[[Scene], np.ndarray]
