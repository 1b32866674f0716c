"""``SimCamera``: the camera at the root as a source of frames, rendered and delivered late."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from avionics.config import Camera, Marker
from drivers.clock import Clock
from drivers.samples import Frame
from sim_bus.buses.faults import FaultPlan
from sim_bus.camera.lens import project
from sim_bus.camera.picture import SHARP_SIGMA_PX, Image, Light, Painter
from sim_bus.camera.strip import Still, Strip
from sim_bus.wing.scenario import FalseLight, Picture
from sim_bus.wing.sim_wing import SimWing

FloatArray = NDArray[np.float64]
TARGET = "camera"
# Faults that change a picture's content: a prepared one is painted again while one is on.
PAINTED_FAULTS = ("marker_hidden", "false_light", "illumination")
# A point moves on a line within one exposure to a few hundredths of a pixel.
SUBSTEPS = 5
SPARE_NS = 1_000_000
NEVER = 1 << 62


@dataclass(frozen=True, slots=True)
class Exposure:
    """One frame before it is painted.

    Attributes
    ----------
    index : int
        Number of the frame.
    t_ns : int
        True middle of the exposure.
    arrival_ns : int
        When it is delivered.
    """

    index: int
    t_ns: int
    arrival_ns: int


class SimCamera:
    """A camera that looks at the simulated wing; a ``Source[Frame]``.

    Parameters
    ----------
    camera : Camera
        Lens, pose, rate and exposure: the true ones.
    wing : SimWing
        What it looks at.
    markers : tuple of Marker
        The LEDs.
    clock : Clock
        The rig's clock.
    look : Picture
        Of the scenario.
    rng : numpy.random.Generator
        Texture, noise, delays, drops.
    faults : FaultPlan
        What goes wrong.
    start_ns : int
        Middle of the first exposure, ns.
    target : str
        What it is called in the fault plan.
    """

    def __init__(
        self,
        camera: Camera,
        wing: SimWing,
        markers: tuple[Marker, ...],
        clock: Clock,
        *,
        look: Picture,
        rng: np.random.Generator,
        faults: FaultPlan | None = None,
        start_ns: int = 0,
        target: str = TARGET,
    ) -> None:
        self._camera, self._wing, self._markers = camera, wing, markers
        self._clock, self._look, self._rng = clock, look, rng
        self._faults = FaultPlan() if faults is None else faults
        self._start_ns, self._target = start_ns, target
        self._painter = Painter(camera.width_px, camera.height_px, look, rng)
        self._grade = 1 + 0.15 * rng.uniform(-1, 1, len(markers))
        self._flicker = rng.uniform(0, 2 * np.pi, 3)
        self._bars = _neighbours(markers) if look.lit_bar > 0 else []
        self._strip: Strip | None = None
        self._first = NEVER
        self._exposures = self._expose()
        self._next, self._is_lost = next(self._exposures)
        self._frozen: Image | None = None
        self._is_open = True

    def still(self, number: int) -> Still:
        """Return the picture of frame ``number`` after the wing's time zero, as its parts."""
        jitter_ns = round(self._rng.standard_normal() * self._look.jitter_s * 1e9)
        t_ns = self._wing.epoch_ns + round(number / self._camera.fps * 1e9) + jitter_ns
        paths, depth = self._paths(t_ns)
        image = self._paint(t_ns, paths, depth)
        boxes = self._painter.boxes(self._lights(t_ns, paths, depth))
        return Still(jitter_ns, paths, depth, boxes, [image[t:b, a:z] for a, z, t, b in boxes])

    def play(self, strip: Strip) -> None:
        """From the wing's time zero on, show these pictures; after the last one, paint again."""
        self._strip = strip

    def align(self, t_ns: int) -> int:
        """Return the next middle of an exposure from a time on: that frame is the strip's first."""
        self._first = int(np.ceil((t_ns - self._start_ns) * 1e-9 * self._camera.fps))
        return self._start_ns + round(self._first / self._camera.fps * 1e9)

    @property
    def marker_ids(self) -> tuple[int, ...]:
        """Ids of the LEDs, in order."""
        return tuple(marker.id for marker in self._markers)

    def read(self, timeout_s: float) -> Frame | None:
        """Return the next frame, None if none is delivered within ``timeout_s``."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        # What is lost is never delivered: only once it is in the past is the next one drawn.
        while self._is_open and self._is_lost and self._next.t_ns <= deadline_ns:
            self._clock.sleep_until_ns(self._next.t_ns)
            self._draw(self._clock.now_ns())
        if not self._is_open or self._is_lost or self._next.arrival_ns > deadline_ns:
            if timeout_s > 0:
                self._clock.sleep_until_ns(deadline_ns)
            return None
        self._clock.sleep_until_ns(self._next.arrival_ns)
        exposure = self._next
        self._draw(self._clock.now_ns())
        return self.frame(exposure)

    def close(self) -> None:
        """Switch the camera off; may be called twice."""
        self._is_open = False

    def frame(self, exposure: Exposure) -> Frame:
        """Return the painted frame of an exposure."""
        stamp_ns = exposure.t_ns + round(self._look.time_offset_s * 1e9)
        is_frozen = self._faults.active("camera_freeze", self._target, exposure.t_ns) is not None
        if not (is_frozen and self._frozen is not None):
            self._frozen = self._picture(exposure)
        return Frame(stamp_ns, self._camera.name, exposure.index, self._frozen)

    def take_exposures(self, until_ns: int) -> Iterator[Exposure]:
        """Yield the exposures up to a time, in order, without waiting: for making data sets."""
        while self._next.t_ns <= until_ns:
            exposure, is_lost = self._next, self._is_lost
            self._draw(until_ns)
            if not is_lost:
                yield exposure

    def marker_pixels(self, t_ns: int) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return where the LEDs are at mid-exposure and which can be seen.

        Returns
        -------
        pixel : ndarray, shape (K, 2)
            Raw image, px; NaN behind the camera.
        visible : ndarray of bool, shape (K,)
            In the image and not hidden.
        """
        pixel = self._paths(t_ns)[0][SUBSTEPS // 2]
        size = np.array([self._camera.width_px, self._camera.height_px])
        # NaN compares false: what lies behind is not visible.
        inside = np.all((pixel > -0.5) & (pixel < size - 0.5), axis=-1)
        return pixel, inside & ~self._hidden(t_ns)

    def _hidden(self, t_ns: int) -> NDArray[np.bool_]:
        hidden = np.zeros(len(self._markers), dtype=np.bool_)
        for fault in self._faults.faults:
            is_now = fault.start_ns <= t_ns < fault.stop_ns
            if fault.kind == "marker_hidden" and is_now and fault.is_for(self._target):
                hidden |= [not fault.markers or m.id in fault.markers for m in self._markers]
        return hidden

    def _draw(self, until_ns: int) -> None:
        """Take the next exposure; of the lost ones, those up to a time are skipped.

        A fault that is on now may be switched off: whether it strikes beyond is not known yet.
        """
        self._next, self._is_lost = next(self._exposures)
        while self._is_lost and self._next.t_ns <= until_ns:
            self._next, self._is_lost = next(self._exposures)

    def _expose(self) -> Iterator[tuple[Exposure, bool]]:
        """Draw the instants of exposure and delivery, first in first out, and what faults lose."""
        look, rng = self._look, self._rng
        least_s, most_s = look.delay_s
        last_ns, index = 0, -1
        while True:
            index += 1
            jitter_s, delay, dropped = (
                rng.standard_normal() * look.jitter_s, rng.exponential(), rng.random()
            )  # fmt: skip
            t_ns = self._instant_ns(index, jitter_s)
            delay_s = min(least_s + (look.delay_mean_s - least_s) * delay, most_s)
            late = self._faults.active("camera_late", self._target, t_ns)
            if late is not None and self._faults.strikes("camera_late", self._target, t_ns):
                delay_s += late.value
            if dropped < look.drop:
                continue
            if (
                self._faults.strikes("camera_drop", self._target, t_ns)
                or self._faults.active("camera_dead", self._target, t_ns) is not None
            ):
                yield Exposure(index, t_ns, t_ns), True
                continue
            last_ns = max(t_ns + round(delay_s * 1e9), last_ns + SPARE_NS)
            yield Exposure(index, t_ns, last_ns), False

    def _instant_ns(self, index: int, jitter_s: float) -> int:
        """Return the middle of an exposure; a prepared picture's is what it was made for."""
        number = index - self._first
        if self._strip is not None and 0 <= number < self._strip.count:
            jitter_s = int(self._strip.jitter_ns[number]) * 1e-9
        return self._start_ns + round((index / self._camera.fps + jitter_s) * 1e9)

    def _paths(self, t_ns: int) -> tuple[FloatArray, FloatArray]:
        """Return the LEDs' pixels at even instants of the exposure (n, K, 2), and depths (K,)."""
        shift = np.linspace(-0.5, 0.5, SUBSTEPS) * self._camera.exposure_s * 1e9
        times = t_ns + np.rint(shift).astype(np.int64)
        pixel, depth = project(self._camera, self._wing.points(times, self._markers))
        if self._camera.row_time_s == 0:
            return pixel, depth[SUBSTEPS // 2]
        # Rolling shutter: rows are exposed one after another about the middle one.
        for _ in range(2):
            rows = np.nan_to_num(pixel[SUBSTEPS // 2, :, 1]) - 0.5 * (self._camera.height_px - 1)
            late = rows * self._camera.row_time_s * 1e9
            columns = [
                project(
                    self._camera,
                    self._wing.points(times + round(float(delay)), (marker,)),
                )[0]
                for marker, delay in zip(self._markers, late, strict=True)
            ]
            pixel = np.concatenate(columns, axis=1)
        return pixel, depth[SUBSTEPS // 2]

    def _picture(self, exposure: Exposure) -> Image:
        number = exposure.index - self._first
        if self._strip is None or not 0 <= number < self._strip.count:
            return self._paint(exposure.t_ns, *self._paths(exposure.t_ns))
        paths, depth = self._strip.paths_px[number], self._strip.depth_m[number]
        if any(self._faults.active(kind, TARGET, exposure.t_ns) for kind in PAINTED_FAULTS):
            return self._paint(exposure.t_ns, paths, depth)
        return self._strip.develop(number, self._backdrop(exposure.t_ns, paths))

    def _backdrop(self, t_ns: int, paths: FloatArray) -> Image:
        gain = self._gain(t_ns, (t_ns - self._wing.epoch_ns) * 1e-9)
        return self._painter.backdrop(gain, self._bar_ends(paths))[1]

    def _bar_ends(self, paths: FloatArray) -> list[FloatArray]:
        return [paths[SUBSTEPS // 2][[a, b]] for a, b in self._bars]

    def _paint(self, t_ns: int, paths: FloatArray, depth: FloatArray) -> Image:
        gain = self._gain(t_ns, (t_ns - self._wing.epoch_ns) * 1e-9)
        lights = self._lights(t_ns, paths, depth)
        return self._painter.paint(lights, gain=gain, bars=self._bar_ends(paths))

    def _lights(self, t_ns: int, paths: FloatArray, depth: FloatArray) -> list[Light]:
        hidden = self._hidden(t_ns)
        lights = [
            self._led(paths[:, k], float(depth[k]), self._grade[k])
            for k in range(len(self._markers))
            if not hidden[k] and np.isfinite(paths[:, k]).all()
        ]
        t_s = (t_ns - self._wing.epoch_ns) * 1e-9
        lights += [light for false in self._look.false_lights if (light := self._false(false, t_s))]
        fault = self._faults.active("false_light", self._target, t_ns)
        if fault is not None:
            middle = np.array([[self._camera.c_x_px, self._camera.c_y_px]])
            lights.append(Light(middle, self._look.led_peak * fault.value, 2.0))
        return lights

    def _led(self, path: FloatArray, depth_m: float, grade: float) -> Light:
        sigma = float(np.hypot(SHARP_SIGMA_PX, self._look.led_sigma_px / max(depth_m, 0.1)))
        return Light(path, self._look.led_peak * grade / np.sqrt(max(depth_m, 0.1)), sigma)

    def _false(self, light: FalseLight, t_s: float) -> Light | None:
        if not light.at_s <= t_s < light.at_s + light.for_s:
            return None
        angle = 2 * np.pi * t_s / light.period_s
        at = np.array([
            light.u_px + light.radius_u_px * np.cos(angle),
            light.v_px + light.radius_v_px * np.sin(angle),
        ])  # fmt: skip
        return Light(at[None], self._look.led_peak * light.brightness, 2.0)

    def _gain(self, t_ns: int, t_s: float) -> float:
        waves = np.sin(2 * np.pi * t_s / np.array([3.7, 11.0, 41.0]) + self._flicker)
        gain = 1 + self._look.flicker * float(waves.mean()) * 1.7
        fault = self._faults.active("illumination", self._target, t_ns)
        return gain if fault is None else gain * fault.value


def _neighbours(markers: tuple[Marker, ...]) -> list[tuple[int, int]]:
    """Return pairs of markers on one station: the ends of lit bars."""
    return [
        (a, b)
        for a in range(len(markers))
        for b in range(a + 1, len(markers))
        if markers[a].s_m == markers[b].s_m
    ]
