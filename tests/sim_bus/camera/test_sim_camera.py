"""Pictures against the truth that made them, found by code that knows nothing of the camera's."""

import numpy as np
import pytest

from avionics.config import Config
from sim_bus.buses.faults import Fault, FaultPlan
from sim_bus.camera.picture import Light, Painter
from sim_bus.camera.sim_camera import SimCamera
from sim_bus.clock import SimClock
from sim_bus.wing.build import make_wing
from sim_bus.wing.scenario import Picture, load_scenario

pytestmark = pytest.mark.slow

S = 1_000_000_000
QUIET = Picture(read_noise=0.0, photons_per_count=1e9, texture=0.0, flicker=0.0, drop=0.0)


def camera(
    config: Config, *faults: Fault, look: Picture | None = None, seed: int = 0,
    plan: FaultPlan | None = None, **changes,
):  # fmt: skip
    scenario = load_scenario("default")
    clock = SimClock()
    wing = make_wing(config, scenario, rng=np.random.default_rng(0))
    return clock, SimCamera(
        config.camera.model_copy(update=changes), wing, config.markers, clock,
        look=QUIET if look is None else look, rng=np.random.default_rng(seed),
        faults=plan or FaultPlan(list(faults), np.random.default_rng(0)),
    )  # fmt: skip


def frames(clock: SimClock, source: SimCamera, until_s: float) -> list:
    found = []
    while clock.now_ns() < until_s * S:
        clock.advance(5_000_000)
        while (frame := source.read(0)) is not None:
            found.append((frame, clock.now_ns()))
    return found


def centroid(image: np.ndarray, near: np.ndarray, half: int = 6) -> np.ndarray:
    u, v = np.rint(near).astype(int)
    part = image[v - half : v + half + 1, u - half : u + half + 1].astype(float)
    part = np.clip(part - 60.0, 0, None)
    rows, columns = np.mgrid[v - half : v + half + 1, u - half : u + half + 1]
    return np.array([(part * columns).sum(), (part * rows).sum()]) / part.sum()


def test_lights_are_where_the_truth_says(config: Config) -> None:
    clock, source = camera(config)
    errors = []
    for frame, _ in frames(clock, source, 8.0)[150::10]:
        pixel, visible = source.marker_pixels(frame.t_ns)
        errors += [
            np.linalg.norm(centroid(frame.image, p) - p)
            for p, seen in zip(pixel, visible, strict=True)
            if seen and 20 < p[1] < 450
        ]
    assert len(errors) > 20
    # Saturated centroids in a window that cuts the halo; the mean over the exposure against its
    # middle.
    assert np.median(errors) < 0.06
    assert max(errors) < 0.3


def test_frames_come_late_and_in_order(config: Config) -> None:
    look = Picture()
    clock, source = camera(config, look=look)
    found = frames(clock, source, 10.0)
    ages_s = np.array([now - f.t_ns for f, now in found]) * 1e-9
    assert ages_s.min() >= 0.035
    assert ages_s.max() <= 0.150 + 0.006
    assert 0.045 < np.median(ages_s) < 0.065
    indices = [f.index for f, _ in found]
    assert indices == sorted(indices)
    assert len(found) == pytest.approx(299, abs=6)
    assert np.diff([f.t_ns for f, _ in found]).min() > 0.9 * S / 30


def test_offset_moves_the_stamp_not_the_picture(config: Config) -> None:
    shifted = QUIET.model_copy(update={"time_offset_s": 0.04})
    (clock_a, a), (clock_b, b) = camera(config), camera(config, look=shifted)
    one, other = (frames(c, s, 6.0)[-1][0] for c, s in ((clock_a, a), (clock_b, b)))
    assert other.t_ns - one.t_ns == 40_000_000
    assert (other.image == one.image).all()


def test_motion_blurs_over_the_exposure() -> None:
    painter = Painter(64, 64, QUIET, np.random.default_rng(0))
    centre = np.array([32.0, 32.0])
    still, moving = (
        painter.paint([Light(centre + np.outer(np.linspace(-x, x, 7), [1, 0]), 100, 1.5)])
        for x in (0.0, 6.0)
    )
    assert moving.max() < 0.75 * still.max()
    assert (moving[32, 24:41] > 55).sum() > (still[32, 24:41] > 55).sum() + 5


def test_bright_lights_saturate_and_bloom() -> None:
    painter = Painter(64, 64, QUIET, np.random.default_rng(0))
    image = painter.paint([Light(np.array([[32.0, 32.0]]), 900.0, 2.0)])
    assert (image == 255).sum() > 10
    # Ten pixels out, the core of sigma 2 has gone; what is left is halo.
    assert image[32, 42] > image[2, 2] + 10


def test_noise_has_its_size() -> None:
    look = Picture(texture=0.0, background=60.0)
    painter = Painter(320, 240, look, np.random.default_rng(0))
    a, b = (painter.paint([]).astype(float) for _ in range(2))
    # The vignette darkens the corners; shot noise follows the mean level.
    wanted = np.hypot(look.read_noise, np.sqrt(a.mean() / look.photons_per_count))
    assert (a - b).std() / np.sqrt(2) == pytest.approx(wanted, rel=0.1)


@pytest.mark.parametrize("kind", ["camera_drop", "camera_dead"])
def test_lost_frames_leave_a_gap_in_the_index(config: Config, kind: str) -> None:
    clock, source = camera(config, Fault(kind, "camera", 1 * S, 2 * S))
    indices = [f.index for f, _ in frames(clock, source, 3.0)]
    assert max(np.diff(indices)) == pytest.approx(31, abs=1)


@pytest.mark.parametrize("kind", ["camera_drop", "camera_dead"])
@pytest.mark.parametrize("is_watched", [True, False], ids=["watched", "not watched"])
def test_frames_return_after_a_fault_of_open_end(
    config: Config, kind: str, is_watched: bool
) -> None:
    plan = FaultPlan([], np.random.default_rng(0))
    clock, source = camera(config, plan=plan)

    def count(until_s: float) -> int:
        if is_watched:
            return len(frames(clock, source, until_s))
        clock.advance_to(round(until_s * S))
        return len(list(source.take_exposures(clock.now_ns())))

    # GIVEN a camera that delivers
    assert count(1.0) > 20
    # WHEN a fault is switched on whose end lies days away, and off a second later
    plan.switch_on(Fault(kind, "camera", clock.now_ns(), clock.now_ns() + 10**6 * S))
    during = count(2.0)
    plan.switch_off(kind, "camera", clock.now_ns())
    # THEN it is silent meanwhile, but for what was on its way, and delivers at once afterwards
    assert during <= 3
    assert count(3.0) > 20


def test_dead_camera_keeps_a_reader_no_longer_than_it_waits(config: Config) -> None:
    clock, source = camera(config, Fault("camera_dead", "camera", -S, 10**6 * S))
    before_ns = clock.now_ns()
    assert source.read(0.5) is None
    assert clock.now_ns() - before_ns == S // 2


def test_frozen_camera_repeats_its_picture_under_new_stamps(config: Config) -> None:
    noisy = Picture(drop=0.0)
    clock, source = camera(config, Fault("camera_freeze", "camera", 5 * S, 6 * S), look=noisy)
    found = [f for f, _ in frames(clock, source, 7.0)]
    frozen = [f for f in found if 5 * S <= f.t_ns < 6 * S]
    assert len(frozen) == pytest.approx(30, abs=1)
    assert all((f.image == frozen[0].image).all() for f in frozen)
    assert not (found[-1].image == frozen[0].image).all()


def test_late_fault_delays(config: Config) -> None:
    clock, source = camera(config, Fault("camera_late", "camera", 1 * S, 2 * S, value=0.3))
    ages = {f.index: now - f.t_ns for f, now in frames(clock, source, 3.0)}
    assert ages[45] > 0.3 * S
    assert ages[15] < 0.2 * S


def test_hidden_markers_are_dark_and_said_to_be(config: Config) -> None:
    clock, source = camera(config, Fault("marker_hidden", "camera", 1 * S, 2 * S, markers=(0, 5)))
    frame = next(f for f, _ in frames(clock, source, 2.0) if f.t_ns > 1.2 * S)
    pixel, visible = source.marker_pixels(frame.t_ns)
    assert visible.tolist() == [False, True, True, True, True, False]
    for p, seen in zip(pixel, visible, strict=True):
        u, v = np.rint(p).astype(int)
        assert (frame.image[v, u] > 200) == seen


def test_false_light_and_illumination(config: Config) -> None:
    clock, source = camera(
        config,
        Fault("false_light", "camera", 1 * S, 2 * S),
        Fault("illumination", "camera", 1 * S, 2 * S, value=2.0),
    )
    found = [f for f, _ in frames(clock, source, 2.0)]
    before, after = found[5].image, found[45].image
    assert before[237, 320] < 60 < 200 < after[237, 320]
    assert after[20, 20] == pytest.approx(2 * before[20, 20], abs=2)


def test_rolling_shutter_exposes_lower_rows_later(config: Config) -> None:
    _, whole = camera(config)
    _, rolling = camera(config, row_time_s=3e-5)
    t_ns = 5 * S
    early, late = whole.marker_pixels(t_ns)[0], rolling.marker_pixels(t_ns)[0]
    delay_s = (late[:, 1] - 239.5) * 3e-5
    for k, delay in enumerate(delay_s):
        then = whole.marker_pixels(t_ns + round(delay * 1e9))[0][k]
        assert late[k] == pytest.approx(then, abs=0.02)
    assert np.abs(late - early).max() > 0.05


def test_same_seed_gives_the_same_frames(config: Config) -> None:
    runs = []
    for _ in range(2):
        clock, source = camera(config, look=Picture(), seed=4)
        runs.append([(f.t_ns, now, f.image.tobytes()) for f, now in frames(clock, source, 1.0)])
    assert runs[0] == runs[1]
