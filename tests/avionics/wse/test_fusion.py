"""Both estimators side by side: what they start from, what they use, what they forget."""

import numpy as np
import pytest

from avionics.flight.filter_setup import marker_model, settings_from_config
from avionics.wse.fusion import WingFusion
from avionics.wse.update import MarkerMeasurement
from tests.avionics.wse.flight import make_config

MS = 1_000_000
STEP = 10 * MS


def make_fusion() -> WingFusion:
    config = make_config()
    settings = settings_from_config(config)
    paper = settings.paper_rates.basis
    return WingFusion(settings, marker_model(config, settings.basis), marker_model(config, paper))


def feed(fusion: WingFusion, first: int, last: int, roll: float = 0.0) -> None:
    """Give samples of both pods, and run the filter as they come."""
    for i in range(first, last):
        for pod, s in enumerate(fusion.settings.pods_s):
            share = np.sin(np.pi * s / 3.0)
            fusion.inputs.add(pod, i * STEP, [roll * share, 0.0, 0.0])
        fusion.advance(i * STEP)


def frame(fusion: WingFusion, t_ns: int, phi: float) -> MarkerMeasurement:
    """Return what the camera shows of a wing bent in its first mode."""
    q = np.zeros(fusion.settings.basis.count)
    q[0] = phi
    pixel = marker_model(make_config(), fusion.settings.basis).view(q).pixel
    return MarkerMeasurement(t_ns, pixel, np.full(len(pixel), 0.3), np.ones(len(pixel), dtype=bool))


def test_before_the_gyros_nothing_is_known_but_the_prior() -> None:
    fusion = make_fusion()
    assert not fusion.has_begun
    assert fusion.can_use(0) is False
    layout = fusion.settings.layout
    forecast = fusion.forecast(STEP)
    assert not forecast.crg.x.any()
    assert pytest.approx(layout.start_P) == forecast.crg.P
    assert forecast.step is None
    assert forecast.update is None


def test_a_frame_waits_for_the_gyros_and_is_too_old_after_the_history() -> None:
    fusion = make_fusion()
    feed(fusion, 0, 100)
    assert fusion.known_ns == 99 * STEP
    assert fusion.can_use(fusion.known_ns + 1) is False
    assert fusion.can_use(fusion.known_ns) is True
    assert fusion.can_use(fusion.known_ns - fusion.settings.history_ns - 10 * STEP) is None


def test_the_first_good_frame_starts_both_estimators_at_its_exposure() -> None:
    fusion = make_fusion()
    # GIVEN a wing whose first mode bends at 0.2 rad/s WHEN a frame comes 0.2 s late
    feed(fusion, 0, 100, roll=0.2)
    exposure_ns = fusion.known_ns - 20 * STEP
    result = fusion.update(frame(fusion, exposure_ns, phi=0.12))
    # THEN the shape is that of the exposure then, and has moved on since
    assert result.t_ns == exposure_ns
    assert result.used.all()
    assert result.estimate.x[0] == pytest.approx(0.12, abs=2e-3)
    now = fusion.forecast(fusion.known_ns)
    assert now.update is result
    assert now.crg.x[0] == pytest.approx(0.12 + 0.2 * 0.2, abs=5e-3)
    assert now.rg.x[0] == pytest.approx(0.12 + 0.2 * 0.2, abs=5e-3)


def test_a_frame_without_markers_is_no_update_to_rest_on() -> None:
    fusion = make_fusion()
    feed(fusion, 0, 50)
    seen = frame(fusion, fusion.known_ns, phi=0.1)
    empty = MarkerMeasurement(
        seen.t_ns, np.full_like(seen.pixel, np.nan), seen.sigma, np.zeros_like(seen.found)
    )
    assert not fusion.update(empty).used.any()
    assert fusion.forecast(fusion.known_ns).update is None


def test_ahead_of_the_gyros_the_state_is_carried_by_the_last_rates() -> None:
    fusion = make_fusion()
    feed(fusion, 0, 50, roll=0.5)
    fusion.update(frame(fusion, fusion.known_ns, phi=0.1))
    forecast = fusion.forecast(fusion.known_ns + 2 * STEP)
    assert forecast.step is not None
    _, crg = fusion.at_ticks([forecast])
    assert crg.x[0, 0] == pytest.approx(forecast.crg.x[0] + 0.02 * 0.5, abs=2e-3)
    assert crg.P[0, 0, 0] > forecast.crg.P[0, 0]


@pytest.mark.parametrize(
    ("roll", "is_steady"), [(lambda i: 3.0, True), (lambda i: 3.0 * (-1) ** i, False)]
)
def test_turns_guessed_wrongly_are_remembered_by_pod_and_axis(roll, is_steady) -> None:
    fusion = make_fusion()
    feed(fusion, 0, 50, roll=roll(0))
    # WHEN every tick is forecast one step ahead, and the gyros then tell what was true
    for i in range(50, 90):
        fusion.forecast(fusion.known_ns + STEP)
        feed(fusion, i, i + 1, roll=roll(i))
    error = fusion.forecast(fusion.known_ns + STEP).turn_error
    assert error is not None
    assert error[:, 1:] == pytest.approx(0.0)
    if is_steady:
        assert error[:, 0] == pytest.approx(0.0, abs=1e-12)
    else:
        assert error[:, 0].min() > 1e-4


def test_a_restart_forgets_the_past() -> None:
    fusion = make_fusion()
    feed(fusion, 0, 50)
    fusion.update(frame(fusion, fusion.known_ns, phi=0.1))
    fusion.restart()
    assert not fusion.has_begun
    assert not fusion.estimate_at(60 * STEP).x.any()
    feed(fusion, 1000, 1050)
    assert fusion.known_ns == 1049 * STEP
    assert not fusion.estimate_at(fusion.known_ns).x.any()
