"""The LED tracker on drawn pictures: accuracy, hidden markers, false lights, finding again."""

import numpy as np
import pytest

from avionics.tracking.centroid import refine
from avionics.tracking.led import LedTracker
from tests.avionics.tracking.conftest import (
    LEDS,
    Scene,
    config_for,
    draw,
    frame_of,
    prediction_at,
)

pytestmark = pytest.mark.slow

TRUE = np.array(LEDS)
BARS = [(LEDS[0], LEDS[1]), (LEDS[2], LEDS[3]), (LEDS[4], LEDS[5])]


def errors(tracks, true=TRUE) -> np.ndarray:
    return np.linalg.norm(tracks.pixel - true, axis=1)[tracks.found]


def locked(config, scene=None) -> LedTracker:
    tracker = LedTracker(config)
    scene = Scene(LEDS) if scene is None else scene
    for index in range(3):
        tracks = tracker.update(frame_of(scene, index), prediction_at(scene.leds))
    assert tracks.found.all()
    return tracker


@pytest.mark.parametrize("seed", range(4))
def test_clipped_leds_with_bars_are_found_to_a_quarter_of_a_pixel(config, seed: int) -> None:
    rng = np.random.default_rng(seed)
    true = TRUE + rng.uniform(-0.5, 0.5, TRUE.shape)
    bars = [(tuple(true[a]), tuple(true[b])) for a, b in ((0, 1), (2, 3), (4, 5))]
    scene = Scene([tuple(p) for p in true], bars=bars, seed=seed)
    shifted = true + rng.normal(0, 2, 2)
    tracks = LedTracker(config).update(frame_of(scene), prediction_at(shifted))
    assert tracks.found.all()
    assert errors(tracks, true).max() < 0.25


def test_bar_pulls_a_plain_centroid_but_not_the_refined_one() -> None:
    scene = Scene([LEDS[0]], bars=[(LEDS[0], LEDS[1])], bar_height=90, noise=0.0)
    image = draw(scene).astype(float)
    window = image[181:202, 60:82] - 30
    weight = np.clip(window, 0, None)
    plain_u = 60 + (weight.sum(axis=0) @ np.arange(22)) / weight.sum()
    u, v, sigma = refine(draw(scene), 70.0, 191.0, 45.0)
    assert plain_u - LEDS[0][0] > 0.5
    assert abs(u - LEDS[0][0]) < 0.12
    assert abs(v - LEDS[0][1]) < 0.12
    assert 0.05 < sigma < 0.3


def test_motion_blur_keeps_the_middle_of_the_exposure(config) -> None:
    scene = Scene(LEDS, blur_px=(0.5, 5.0))
    tracks = LedTracker(config).update(frame_of(scene), prediction_at(LEDS))
    assert tracks.found.all()
    assert errors(tracks).max() < 0.2


def test_colour_pictures_work(config) -> None:
    scene = Scene(LEDS, colour=True)
    tracks = LedTracker(config).update(frame_of(scene), prediction_at(LEDS))
    assert tracks.found.all()


def test_hidden_markers_are_not_found(config) -> None:
    tracker = locked(config)
    scene = Scene(LEDS, hidden=(1, 4), bars=BARS, seed=5)
    tracks = tracker.update(frame_of(scene, 9), prediction_at(TRUE + 0.7))
    assert tracks.found.tolist() == [True, False, True, True, False, True]
    assert np.isnan(tracks.pixel[1]).all()
    assert np.isnan(tracks.sigma_px[4])


def test_all_hidden_while_lights_wander_adopts_none(config) -> None:
    tracker = locked(config)
    rng = np.random.default_rng(1)
    for index in range(25):
        angle = index / 4
        others = [(120 + 60 * np.cos(angle), 120 + 50 * np.sin(angle)), (130.0, 40.0 + 6 * index)]
        scene = Scene(LEDS, hidden=range(6), others=others, bars=BARS, seed=index)
        tracks = tracker.update(frame_of(scene, index), prediction_at(TRUE + rng.normal(0, 0.5, 2)))
        near = np.linalg.norm(TRUE[:, None] - np.array(others)[None], axis=-1).min(axis=1) < 6
        assert not (tracks.found & ~near).any()


def test_marker_is_found_again_in_the_frame_of_its_return(config) -> None:
    tracker = locked(config)
    for index in range(40):
        tracker.update(frame_of(Scene(LEDS, hidden=(2, 3)), index), prediction_at(TRUE))
    tracks = tracker.update(frame_of(Scene(LEDS), 41), prediction_at(TRUE + 1.0))
    assert tracks.found.all()


def test_common_shift_beyond_the_filter_is_followed(config) -> None:
    tracker = locked(config)
    tracks = tracker.update(frame_of(Scene(LEDS)), prediction_at(TRUE + (3.0, -11.0)))
    assert tracks.found.all()
    assert errors(tracks).max() < 0.3


def test_identities_hold_when_two_leds_pass_each_other(config) -> None:
    tracker = locked(config)
    for index, gap in enumerate(np.linspace(50, 9.5, 25)):
        moving = TRUE.copy()
        moving[4] = moving[2] + (-9.5, -gap)
        moving[5] = moving[3] + (9.5, -gap)
        scene = Scene([tuple(p) for p in moving], seed=index)
        tracks = tracker.update(frame_of(scene, index), prediction_at(moving + 1.0))
        assert tracks.found.all(), index
        assert errors(tracks, moving).max() < 1.0


def test_touching_leds_are_two(config) -> None:
    near = TRUE.copy()
    near[4] = near[2] + (-8.2, 0.4)
    tracks = LedTracker(config).update(
        frame_of(Scene([tuple(p) for p in near])), prediction_at(near)
    )
    assert tracks.found[[2, 4]].all()
    assert errors(tracks, near).max() < 0.8


def test_marker_cut_by_the_edge_is_not_found(config) -> None:
    cut = TRUE.copy()
    cut[0] = (70.0, 238.6)
    tracks = LedTracker(config).update(frame_of(Scene([tuple(p) for p in cut])), prediction_at(cut))
    assert not tracks.found[0]
    assert tracks.found[1:].all()


def bending(amount: float) -> np.ndarray:
    """The pattern for a bent wing: outer markers move more."""
    weight = np.array([0.25, 0.25, 0.6, 0.6, 1.0, 1.0])[:, None]
    return TRUE + amount * weight * (0.05, 1.0)


def test_starts_by_itself_far_from_the_prediction(config) -> None:
    true = bending(38.0)
    fan = np.array([bending(a) for a in np.linspace(-60, 60, 25)])
    others = [(280.0, 30.0), (300.0, 200.0), (40.0, 40.0)]
    scene = Scene([tuple(p) for p in true], others=others, bars=[])
    tracks = LedTracker(config).update(
        frame_of(scene), prediction_at(bending(0.0), 60.0, hypotheses=fan)
    )
    assert tracks.found.all()
    assert errors(tracks, true).max() < 0.3


def test_lost_pattern_is_found_again_although_the_filter_is_sure(config) -> None:
    tracker = locked(config)
    true = bending(45.0)
    fan = np.array([bending(a) for a in np.linspace(-60, 60, 25)])
    scene = Scene([tuple(p) for p in true])
    found = [
        tracker.update(frame_of(scene, i), prediction_at(TRUE, 0.3, hypotheses=fan)).found.all()
        for i in range(12)
    ]
    assert any(found)


def test_empty_picture_finds_nothing(config) -> None:
    tracks = LedTracker(config).update(frame_of(Scene([])), prediction_at(LEDS))
    assert not tracks.found.any()


def test_predictions_behind_the_camera_take_no_part(config) -> None:
    expected = TRUE.copy()
    expected[3] = np.nan
    tracks = LedTracker(config).update(frame_of(Scene(LEDS)), prediction_at(expected))
    assert not tracks.found[3]
    assert tracks.found[[0, 1, 2, 4, 5]].all()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_markers_work(count: int) -> None:
    tracker = LedTracker(config_for(count))
    for index in range(3):
        tracks = tracker.update(
            frame_of(Scene(LEDS[:count]), index), prediction_at(TRUE[:count] + 1.0)
        )
    assert tracks.found.all()


def test_sigma_is_honest_on_drawn_pictures(config) -> None:
    normalised = []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        true = TRUE + rng.uniform(-0.5, 0.5, TRUE.shape)
        scene = Scene([tuple(p) for p in true], seed=seed, peak=float(rng.uniform(150, 600)))
        tracks = LedTracker(config).update(frame_of(scene), prediction_at(true))
        error = (tracks.pixel - true)[tracks.found]
        normalised.append(error / tracks.sigma_px[tracks.found][:, None])
    rms = np.sqrt(np.mean(np.concatenate(normalised) ** 2))
    assert rms < 1.3
