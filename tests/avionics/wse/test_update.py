"""The measurement update on markers whose place in the picture is known."""

from dataclasses import replace

import numpy as np
import pytest

from avionics.config.load import default_config_text, parse_config_text
from avionics.flight.filter_setup import marker_model
from avionics.wse.adaptive_noise import AdaptiveNoise, UpdateRules
from avionics.wse.gyro_step import Motion
from avionics.wse.markers import MarkerModel
from avionics.wse.state import Estimate, StateLayout
from avionics.wse.update import MarkerMeasurement, MarkerUpdate

ROW_S = 3e-5  # 480 rows in 14 ms, as small rolling shutters have it


@pytest.fixture
def model(basis) -> MarkerModel:
    config = parse_config_text(default_config_text(), (), origin="packaged")
    return marker_model(config, basis)


def rolling(model: MarkerModel, q: np.ndarray, rate: np.ndarray, row_s: float) -> np.ndarray:
    """Return where a rolling shutter images the markers: each when its own row is exposed."""
    pixel = model.view(q).pixel
    for _ in range(50):
        delay_s = row_s * (pixel[:, 1] - 0.5 * (model.camera.height - 1))
        each = [model.view(q + rate * delay).pixel[k] for k, delay in enumerate(delay_s)]
        pixel = np.array(each)
    return pixel


def estimate(model, q, rate, pixel, *, row_s: float) -> np.ndarray:
    """Return the amplitudes after one frame of precise markers, begun at the right ones."""
    count = len(pixel)
    layout = StateLayout(model.basis, (), prior=np.ones(len(q)))
    rules = UpdateRules(gate=1e6, adapt=False)
    update = MarkerUpdate(model, layout, rules, np.ones(len(q)), row_time=row_s)
    measurement = MarkerMeasurement(0, pixel, np.full(count, 1e-3), np.ones(count, dtype=bool))
    result = update.apply(
        Estimate(q, 0.01 * np.eye(len(q))),
        replace(AdaptiveNoise(0.0), is_started=True),
        measurement,
        Motion(rate, np.zeros(len(q))),
    )
    assert result.used.all()
    return result.estimate.x


def test_row_time_is_taken_out_of_the_amplitudes_to_second_order(model, q) -> None:
    # GIVEN a wing in motion WHEN rows are exposed one after another THEN the frame shows the
    # amplitudes at its middle row; without the row time they are bent by what moved meanwhile
    q, rate = 0.3 * q, np.array([2.0, -1.0, 0.5, 1.5, -0.5, 0.4])

    def error(row_s: float, assumed_s: float) -> float:
        x = estimate(model, q, rate, rolling(model, q, rate, row_s), row_s=assumed_s)
        return float(np.abs(x - q).max())

    once, half = error(ROW_S, ROW_S), error(ROW_S / 2, ROW_S / 2)
    assert once / half == pytest.approx(4.0, rel=0.15)
    assert once < 0.1 * error(ROW_S, 0.0)
