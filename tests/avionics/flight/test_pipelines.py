"""Which pipeline a record of several wings goes to; what flies is in tests/integration."""

import numpy as np
import pytest

from avionics.config import WingsConfig
from avionics.config.load import parse_config
from avionics.flight.pipelines import Pipelines
from avionics.records import Event, Health, MarkerTracks, WingShapeEstimate
from avionics.topics import Record
from drivers.samples import ImuSample
from tests.avionics.wse.flight import CAMERA

MS = 1_000_000
LENS = {name: getattr(CAMERA, name) for name in ("f_x_px", "f_y_px", "c_x_px", "c_y_px")}


class Kept:
    """Keeps what is written, in order."""

    def __init__(self) -> None:
        self.records: list[Record] = []

    def write(self, record: Record, arrival_ns: int) -> None:
        self.records.append(record)


def two_wings(**estimator: object) -> WingsConfig:
    wings = [
        {
            "name": name, "side": name, "span_m": 1.5, "pods": [{"id": pod, "s_m": 1.0}],
            "markers": [{"id": 0, "s_m": 0.9}, {"id": 1, "s_m": 1.5}],
            "camera": {"name": f"eye {name}", **LENS},
        }
        for name, pod in (("left", 4), ("right", 7))
    ]  # fmt: skip
    config = parse_config({"wings": wings, "estimator": estimator}, origin="test")
    assert isinstance(config, WingsConfig)
    return config


def sample(pod: str, t_ns: int) -> ImuSample:
    return ImuSample(t_ns, pod, t_ns // (10 * MS), np.array([0.1, 0.0, 0.0]))


def tracks(camera: str, t_ns: int) -> MarkerTracks:
    nowhere = np.full((2, 2), np.nan)
    return MarkerTracks(t_ns, camera, 0, nowhere, nowhere[:, 0], np.zeros(2, dtype=bool))


def counters(sink: Kept) -> dict[str, dict[str, int]]:
    """The last account of every source."""
    return {r.source: r.counters for r in sink.records if isinstance(r, Health)}


def flown(*records, until_ms: int = 1100) -> Kept:
    sink = Kept()
    pipelines = Pipelines(two_wings(), sink)
    for record in sorted(records, key=lambda one: one.t_ns):
        arrival_ns = record.t_ns + MS
        if isinstance(record, ImuSample):
            pipelines.on_imu(record, arrival_ns)
        else:
            pipelines.on_tracks(record, arrival_ns)
    pipelines.advance(until_ms * MS)
    pipelines.close()
    return sink


def test_a_pods_samples_go_to_its_wing_and_the_roots_to_all() -> None:
    at = range(0, 1000 * MS, 10 * MS)
    sink = flown(*(sample(pod, t) for pod in ("4", "root") for t in at))
    received = {source: c.get("received") for source, c in counters(sink).items()}
    assert received["pod 4"] == received["root left"] == received["root right"] == len(at)
    assert received["pod 7"] == 0
    assert sum(isinstance(r, ImuSample) for r in sink.records) == 2 * len(at)


def test_tracks_go_to_the_wing_of_their_camera() -> None:
    sink = flown(tracks("eye right", 100 * MS), tracks("eye right", 200 * MS))
    found = counters(sink)
    assert found["camera eye right"]["frames"] == 2
    assert found["camera eye left"]["frames"] == 0


def test_what_belongs_to_no_wing_is_recorded_and_counted() -> None:
    sink = flown(sample("5", 100 * MS), tracks("eye middle", 200 * MS))
    found = counters(sink)
    assert found["pod 5"] == {"unknown": 1}
    assert found["camera eye middle"] == {"unknown": 1}
    assert len([r for r in sink.records if isinstance(r, ImuSample | MarkerTracks)]) == 2
    with pytest.raises(ValueError, match="camera 'eye middle' belongs to no wing"):
        Pipelines(two_wings(), Kept()).predict_markers(0, "eye middle")


def test_each_camera_is_told_where_its_own_wings_markers_are() -> None:
    pipelines = Pipelines(two_wings(), Kept())
    # Both cameras look along +y: the left wing's markers are behind theirs.
    assert np.isnan(pipelines.predict_markers(0, "eye left").pixel).all()
    assert np.isfinite(pipelines.predict_markers(0, "eye right").pixel).all()


def test_rows_of_a_tick_stand_in_the_order_of_the_configuration() -> None:
    at = range(0, 300 * MS, 10 * MS)
    sink = flown(*(sample(pod, t) for pod in ("4", "7") for t in at), until_ms=300)
    rows = [(r.t_ns, r.wing, r.kind) for r in sink.records if isinstance(r, WingShapeEstimate)]
    ticks = sorted({t_ns for t_ns, _, _ in rows})
    kinds = [(wing, kind) for wing in ("left", "right") for kind in ("rg", "crg")]
    assert rows == [(t_ns, *kind) for t_ns in ticks for kind in kinds]
    assert len(ticks) > 25


def test_a_long_silence_restarts_every_wing_and_is_told_once() -> None:
    at = [*range(0, 300 * MS, 10 * MS), *range(100_000 * MS, 100_300 * MS, 10 * MS)]
    sink = flown(*(sample(pod, t) for pod in ("4", "7") for t in at), until_ms=100_300)
    told = [r for r in sink.records if isinstance(r, Event) and "nothing arrived" in r.message]
    assert [event.source for event in told] == ["estimator"]
    rows = [r for r in sink.records if isinstance(r, WingShapeEstimate)]
    assert len(rows) < 2 * 2 * 100
    assert {row.wing for row in rows if row.t_ns > 100_100 * MS} == {"left", "right"}
