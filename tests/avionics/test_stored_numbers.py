"""The estimates of a stored flight are those of the day it was stored, on every machine."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from avionics.config.load import apply_overrides, parse_config
from avionics.flight.pipelines import Pipelines
from avionics.records import MarkerTracks, WingShapeEstimate
from drivers.samples import ImuSample

STORED = Path(__file__).parents[1] / "data/short_flight.json"
EVERY = 25


class Rows:
    """A sink that keeps the estimates."""

    def __init__(self) -> None:
        self.by_kind: dict[str, list[WingShapeEstimate]] = {}

    def write(self, record, arrival_ns) -> None:
        if isinstance(record, WingShapeEstimate):
            self.by_kind.setdefault(record.kind, []).append(record)


def numbers(values) -> np.ndarray:
    return np.array(values, dtype=float)


def fly(stored: dict, form: str) -> dict[str, list[WingShapeEstimate]]:
    rows = Rows()
    described = apply_overrides(stored["config"], (f"estimator.form={form}",))
    pipeline = Pipelines(parse_config(described, origin=STORED.name), rows)
    for kind, arrival_ns, t_ns, source, number, *values in stored["events"]:
        if kind == "imu":
            pipeline.on_imu(ImuSample(t_ns, source, number, numbers(values[0])), arrival_ns)
        else:
            pixel, sigma, found = values
            tracks = MarkerTracks(
                t_ns, source, number, numbers(pixel), numbers(sigma), np.array(found), "led"
            )
            pipeline.on_tracks(tracks, arrival_ns)
    pipeline.close()
    return rows.by_kind


@pytest.mark.parametrize("form", ["general", "paper"])
def test_estimates_are_the_stored_ones(form: str) -> None:
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    made = fly(stored, form)
    assert set(made) == {"rg", "crg", "filtered"}
    for kind, expected in stored["expected"][form].items():
        rows = made[kind][EVERY::EVERY]
        assert [row.t_ns for row in rows] == [row["t_ns"] for row in expected]
        assert len(rows) > 2
        for row, wanted in zip(rows, expected, strict=True):
            for found, name in (
                (row.phi_rad, "phi_rad"),
                (row.theta_rad, "theta_rad"),
                (row.line_in_body_m[-1], "tip_in_body_m"),
                (row.tip_sigma_m, "tip_sigma_m"),
                (row.marker_px, "marker_px"),
            ):
                assert_allclose(found, numbers(wanted[name]), rtol=1e-6, atol=1e-9, err_msg=name)
