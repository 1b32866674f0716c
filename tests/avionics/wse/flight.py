"""A made-up flight with truth: shapes that are no modes, gyros by differentiation, own projection.

Shares no equation with ``avionics.wse``: rotation matrices are multiplied out, the line is a
trapezoidal sum of 400 pieces, the gyros see the skew part of dD/dt D^T by central differences.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from avionics.config import Camera, Config, Estimator, Marker, Pod, Wing
from avionics.flight.pipelines import Pipelines
from avionics.records import Event, Health, MarkerTracks, WingShapeEstimate
from avionics.topics import Record, topic_of
from drivers.samples import ImuSample

EPOCH_NS = 1_700_000_000_000_000_000
SPAN_M = 1.5
LAG_S = 0.00703
PIECES = 400


def turn(axis: int, a: np.ndarray) -> np.ndarray:
    c, s, one, zero = np.cos(a), np.sin(a), np.ones_like(a), np.zeros_like(a)
    rows = {
        1: [[one, zero, zero], [zero, c, s], [zero, -s, c]],
        2: [[c, zero, -s], [zero, one, zero], [s, zero, c]],
        3: [[c, s, zero], [-s, c, zero], [zero, zero, one]],
    }[axis]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def attitude(phi: np.ndarray, theta: np.ndarray, psi: np.ndarray) -> np.ndarray:
    return turn(1, phi) @ turn(2, theta) @ turn(3, psi)


Amplitude = Callable[[np.ndarray], np.ndarray]


def nothing(t: np.ndarray) -> np.ndarray:
    return np.zeros_like(t)


def swing(amplitude: float, hz: float, *, rest: float = 0.0, begins: float = 2.0) -> Amplitude:
    """Rest, then a swing that grows within a second."""

    def value(t: np.ndarray) -> np.ndarray:
        tau = np.maximum(t - begins, 0.0)
        return rest + amplitude * (1 - np.exp(-(tau**2) * 4)) * np.sin(2 * np.pi * hz * tau)

    return value


@dataclass
class Truth:
    """Angles along the span: bending and in-plane by a tip load, a second shape, a tip torque."""

    bending: Amplitude = field(default_factory=lambda: swing(0.35, 1.3, rest=0.12))
    second: Amplitude = field(default_factory=lambda: swing(0.04, 3.1))
    twist: Amplitude = nothing
    inplane: Amplitude = nothing
    psi0: float = 0.0
    root_rate: Callable[[np.ndarray], np.ndarray] | None = None

    def angles(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """phi, theta, psi at (T, PIECES + 1) stations."""
        x = np.linspace(0.0, 1.0, PIECES + 1)
        tip_load, higher = 2 * x - x**2, x * (1 - x) * (2.3 - 3.1 * x) * 2.0
        torque, torque_slope = 0.6 * x + 0.4 * np.sin(np.pi * x / 2), None
        phi = self.bending(t)[:, None] * tip_load + self.second(t)[:, None] * higher
        theta = self.twist(t)[:, None] * torque
        torque_slope = (0.6 + 0.2 * np.pi * np.cos(np.pi * x / 2)) / SPAN_M
        slope = self.twist(t)[:, None] * torque_slope * np.tan(phi) / np.cos(theta)
        psi = self.psi0 + cumulative(slope) + self.inplane(t)[:, None] * tip_load
        return phi, theta, psi

    def points(self, t: np.ndarray, markers: list[tuple[float, float, float]]) -> np.ndarray:
        """Section points (s, x, z) in body axes, shape (T, K, 3)."""
        D = attitude(*self.angles(t))
        line = cumulative(D[..., 1, :].swapaxes(1, 2)).swapaxes(1, 2)
        points = []
        for s, x, z in markers:
            at, D_at = along(line, s), along(D, s)
            points.append(at + np.einsum("tij,i->tj", D_at, [x, 0.0, z]))
        return np.stack(points, axis=1)

    def rates(self, t: np.ndarray, s: float) -> np.ndarray:
        """What a gyro at s measures, local axes, rad/s, shape (T, 3)."""
        h = 1e-4
        D = [along(attitude(*self.angles(t + k * h)), s) for k in (-1, 0, 1)]
        skew = -((D[2] - D[0]) / (2 * h)) @ D[1].swapaxes(1, 2)
        rate = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
        if self.root_rate is not None:
            rate = rate + np.einsum("tij,tj->ti", D[1], self.root_rate(t))
        return rate


def cumulative(f: np.ndarray) -> np.ndarray:
    """Integral from the root along the last axis."""
    h = SPAN_M / PIECES
    total = np.cumsum(0.5 * h * (f[..., 1:] + f[..., :-1]), axis=-1)
    return np.concatenate([np.zeros_like(total[..., :1]), total], axis=-1)


def along(values: np.ndarray, s: float) -> np.ndarray:
    """Linear interpolation at arc length s of (T, PIECES + 1, ...)."""
    at = s / SPAN_M * PIECES
    i = min(int(at), PIECES - 1)
    return values[:, i] + (at - i) * (values[:, i + 1] - values[:, i])


CAMERA = Camera(
    f_x_px=600.0,
    f_y_px=602.0,
    c_x_px=322.0,
    c_y_px=238.0,
    k1=-0.12,
    k2=0.03,
    p1=0.001,
    p2=-0.0005,
    tilt_deg=-14.0,
    pan_deg=1.0,
    roll_deg=-0.5,
    r_in_body_m=(0.03, -0.02, -0.3),
    calibrated=True,
)


def make_config(
    pods: tuple[float, ...] = (0.6, 1.2),
    stations: tuple[float, ...] = (0.6, 1.2, 1.5),
    *,
    side: str = "right",
    psi0_deg: float = 0.0,
    camera: Camera | None = CAMERA,
    **estimator: object,
) -> Config:
    markers = [(s, x) for s in stations for x in (0.09, -0.09)]
    return Config(
        wing=Wing(span_m=SPAN_M, side=side, psi0_deg=psi0_deg),
        pods=tuple(Pod(id=i, s_m=s) for i, s in enumerate(pods)),
        markers=tuple(Marker(id=i, s_m=s, x_m=x, z_m=-0.01) for i, (s, x) in enumerate(markers)),
        camera=camera,
        estimator=Estimator(**{"gyro_lag_s": "filter", **estimator}),
    )


def project(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Pixels of body points (..., 3), written out once more; NaN behind the camera."""
    angles = np.radians([camera.roll_deg, camera.tilt_deg, 90.0 + camera.pan_deg])
    D = turn(1, angles[0]) @ turn(2, angles[1]) @ turn(3, angles[2])
    p = (points - np.array(camera.r_in_body_m)) @ D.T
    with np.errstate(invalid="ignore", divide="ignore"):
        a, b = p[..., 1] / p[..., 0], p[..., 2] / p[..., 0]
    r2 = a * a + b * b
    g = 1 + camera.k1 * r2 + camera.k2 * r2**2 + camera.k3 * r2**3
    u = camera.c_x_px + camera.f_x_px * (
        a * g + 2 * camera.p1 * a * b + camera.p2 * (r2 + 2 * a * a)
    )
    v = camera.c_y_px + camera.f_y_px * (
        b * g + camera.p1 * (r2 + 2 * b * b) + 2 * camera.p2 * a * b
    )
    pixel = np.stack([u, v], axis=-1)
    pixel[p[..., 0] <= 0] = np.nan
    return pixel


class ListSink:
    """Keeps what the pipeline writes."""

    def __init__(self) -> None:
        self.records: dict[str, list] = {}
        self.order: list[tuple[str, int]] = []

    def write(self, record: Record, arrival_ns: int) -> None:
        topic = topic_of(record)
        self.records.setdefault(topic, []).append(record)
        self.order.append((topic, arrival_ns))

    def estimates(self, kind: str) -> list[WingShapeEstimate]:
        return self.records.get(f"/wing/right/estimate_{kind}", [])

    def events(self) -> list[Event]:
        return self.records.get("/event", [])

    def health(self, source: str) -> dict[str, int]:
        found: list[Health] = [r for r in self.records["/health"] if r.source == source]
        return found[-1].counters


@dataclass
class Flight:
    """A truth, sensors of stated quality, and what arrives when."""

    config: Config
    truth: Truth
    duration_s: float = 12.0
    seed: int = 0
    bias_dps: float = 0.5
    gyro_noise_dps: float = 0.08
    lag_s: float = LAG_S
    read_jitter_s: float = 0.0004
    always_late_s: float = 0.0
    drop_fraction: float = 0.005
    pixel_noise_px: float = 0.3
    latency_s: tuple[float, float] = (0.035, 0.09)
    camera_offset_s: float = 0.0
    is_seen: Callable[[float, int], bool] = lambda t, k: True
    is_alive: Callable[[float, int], bool] = lambda t, j: True

    def events(self) -> list[tuple[int, object]]:
        """(arrival, record) in order of arrival."""
        rng = np.random.default_rng(self.seed)
        found: list[tuple[int, object]] = []
        for j, pod in enumerate(self.config.pods):
            found += self._samples(rng, j, pod)
        if self.config.camera is not None:
            found += self._tracks(rng)
        return sorted(found, key=lambda item: item[0])

    def _samples(self, rng, j: int, pod: Pod) -> list[tuple[int, object]]:
        drift = 1 + 30e-6 * (j - 0.5)
        t = np.arange(0.003 * j, self.duration_s, 0.01 * drift)
        rate = self.truth.rates(t - self.lag_s, pod.s_m)
        bias = np.radians(self.bias_dps) * rng.uniform(-1, 1, 3)
        rate = rate + bias + np.radians(self.gyro_noise_dps) * rng.standard_normal(rate.shape)
        rate = rate @ np.array(pod.R_sensor_from_local).T
        read = t + self.read_jitter_s * rng.standard_normal(len(t))
        read = read + rng.exponential(self.always_late_s, len(t)) if self.always_late_s else read
        read = np.maximum.accumulate(read)
        samples = []
        for i in range(len(t)):
            if rng.random() < self.drop_fraction or not self.is_alive(t[i], j):
                continue
            t_ns = EPOCH_NS + round(1e9 * read[i])
            samples.append((t_ns, ImuSample(t_ns, pod.name, i, rate[i])))
        return samples

    def marker_points(self, t: np.ndarray) -> np.ndarray:
        placed = [(m.s_m, m.x_m, m.z_m) for m in self.config.markers]
        points = self.truth.points(t, placed)
        return points * [1, -1, 1] if self.config.wing.side == "left" else points

    def tip(self, t_ns: np.ndarray) -> np.ndarray:
        t = (np.asarray(t_ns) - EPOCH_NS) * 1e-9
        tip = self.truth.points(t, [(SPAN_M, 0.0, 0.0)])[:, 0]
        return tip * [1, -1, 1] if self.config.wing.side == "left" else tip

    def _tracks(self, rng) -> list[tuple[int, object]]:
        camera = self.config.camera
        t = np.arange(0.012, self.duration_s, 1 / 30)
        pixel = project(camera, self.marker_points(t))
        inside = (pixel >= 0).all(-1) & (pixel < [camera.width_px, camera.height_px]).all(-1)
        pixel = pixel + self.pixel_noise_px * rng.standard_normal(pixel.shape)
        late = rng.uniform(*self.latency_s, len(t))
        tracks = []
        for i in range(len(t)):
            seen = np.array([self.is_seen(t[i], k) for k in range(pixel.shape[1])]) & inside[i]
            record = MarkerTracks(
                EPOCH_NS + round(1e9 * (t[i] - self.camera_offset_s)),
                camera.name,
                i,
                np.where(seen[:, None], pixel[i], np.nan),
                np.where(seen, self.pixel_noise_px, np.nan),
                seen,
            )
            tracks.append((EPOCH_NS + round(1e9 * (t[i] + late[i])), record))
        return tracks


def fly(config: Config, events: list[tuple[int, object]]) -> ListSink:
    """Run the pipeline over events."""
    sink = ListSink()
    pipeline = Pipelines(config, sink)
    for arrival_ns, record in events:
        if isinstance(record, ImuSample):
            pipeline.on_imu(record, arrival_ns)
        else:
            pipeline.on_tracks(record, arrival_ns)
    pipeline.close()
    return sink


def within(flight: Flight, rows: list[WingShapeEstimate], after_s: float) -> list:
    """Rows between ``after_s`` and the end of the samples."""
    start, stop = (EPOCH_NS + s * 1e9 for s in (after_s, flight.duration_s))
    return [r for r in rows if start < r.t_ns < stop]


def tip_errors(flight: Flight, rows: list[WingShapeEstimate], after_s: float) -> np.ndarray:
    """Tip error vectors, m, of the rows later than ``after_s``."""
    late = within(flight, rows, after_s)
    return np.array([r.line_in_body_m[-1] for r in late]) - flight.tip([r.t_ns for r in late])


def tip_nees(flight: Flight, rows: list[WingShapeEstimate], after_s: float) -> float:
    """Mean squared vertical tip error over its variance."""
    late = within(flight, rows, after_s)
    error = np.array([r.line_in_body_m[-1, 2] for r in late])
    error -= flight.tip([r.t_ns for r in late])[:, 2]
    return float(np.mean((error / np.array([r.tip_sigma_m[2] for r in late])) ** 2))
