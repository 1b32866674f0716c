"""GIVEN a left and a right wing of one aircraft whose root rolls and pitches WHEN they fly in one
log THEN each has its own pipeline, and the root's motion is no shape of either."""

import json
from pathlib import Path

import numpy as np
import pytest

from avionics.analysis.replay import replay
from avionics.config import FlightConfig
from avionics.config.load import load_config
from avionics.flight.pipelines import Pipelines
from avionics.flight.runner import run_lockstep
from avionics.recording import LoggedRecord, LogReader, LogWriter
from avionics.recording.schema.encode import encode
from avionics.records import EncodedFrame, Health, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import ImuSample
from sim_bus.rig import open_sim_rig
from sim_bus.wing.scenario import parse_scenario

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/two-wings.toml"
WINGS = ("right", "left")
# A quarter of the pixels: half the time.
SMALL = {"width_px": 320, "height_px": 240, "fps": 20.0, "f_x_px": 302.0, "f_y_px": 302.0,
         "c_x_px": 159.5, "c_y_px": 119.5}  # fmt: skip
SECONDS = 9.0
SETTLED_S = 4.0
ROLLING = {
    "name": "rolling",
    "picture": {"led_sigma_px": 1.2},
    "root": [
        {"axis": "roll", "amplitude": 20.0, "hz": 0.4, "at_s": 0.5, "fade_s": 1.0},
        {"axis": "pitch", "amplitude": 8.0, "hz": 0.3, "at_s": 0.5, "fade_s": 1.0},
    ],
    "loads": [
        {"kind": "gust", "at_s": 1.0, "for_s": 8.0, "airspeed_m_s": 8.0, "sigma_m_s": 0.5,
         "peak_m_s": 1.2, "every_s": 3.0},
    ],
}  # fmt: skip


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The flight, as `avionics sim` writes it."""
    changes = [f"wings.{w}.camera.{key}={value}" for w in WINGS for key, value in SMALL.items()]
    config = load_config(EXAMPLE, tuple(changes))
    path = tmp_path_factory.mktemp("wings") / "two.mcap"
    with (
        open_sim_rig(config, parse_scenario(ROLLING, origin="test"), seed=1) as rig,
        LogWriter(path, config) as writer,
    ):
        run_lockstep(rig, config, writer, duration_s=SECONDS)
    return path


@pytest.fixture(scope="module")
def logged(log: Path) -> list[LoggedRecord]:
    return list(LogReader(log).messages(decode_images=False))


@pytest.fixture(scope="module")
def records(logged: list[LoggedRecord]) -> list:
    return [item.record for item in logged]


def rows_of(made: list, wing: str, kind: str) -> list[WingShapeEstimate]:
    rows = [one for one in made if isinstance(one, WingShapeEstimate)]
    return [row for row in rows if (row.wing, row.kind) == (wing, kind)]


def tip_errors_mm(rows: list[WingShapeEstimate], truths: list[Truth]) -> np.ndarray:
    """Distance of the tip from the true one after the filter has settled."""
    truths = [one for one in truths if one.wing == rows[0].wing]
    at_ns = np.array([one.t_ns for one in truths])
    rows = [row for row in rows if at_ns[0] + SETTLED_S * 1e9 < row.t_ns < at_ns[-1]]
    tips = np.array([one.line_in_body_m[-1] for one in truths])
    wanted = np.array([row.t_ns - at_ns[0] for row in rows])
    true = np.stack([np.interp(wanted, at_ns - at_ns[0], axis) for axis in tips.T], axis=1)
    return 1e3 * np.linalg.norm(np.array([r.line_in_body_m[-1] for r in rows]) - true, axis=1)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def fly_again(config: FlightConfig, logged: list[LoggedRecord], *, has_root: bool = True) -> list:
    """Return what the pipelines make of the samples and tracks of a flight."""
    made: list = []

    class Kept:
        def write(self, record, arrival_ns: int) -> None:
            made.append(record)

    cameras = [camera.name for camera in config.cameras]
    pods = {pod.name for pod in config.pods} | ({"root"} if has_root else set())
    pipelines = Pipelines(config, Kept())
    for _, record, arrival_ns in logged:
        if isinstance(record, ImuSample) and record.pod in pods:
            pipelines.on_imu(record, arrival_ns)
        elif isinstance(record, MarkerTracks) and record.camera in cameras:
            pipelines.on_tracks(record, arrival_ns)
        elif isinstance(record, EncodedFrame | Truth):
            # At the instant of a row, what comes behind a frame comes behind the row.
            pipelines.advance(arrival_ns)
    pipelines.close()
    return made


@pytest.mark.parametrize("wing", WINGS)
def test_each_wing_is_as_good_as_one_alone(records: list, wing: str) -> None:
    truths = [record for record in records if isinstance(record, Truth)]
    for kind, bound_mm in (("crg", 5.0), ("filtered", 2.5)):
        rows = rows_of(records, wing, kind)
        assert rms(tip_errors_mm(rows, truths)) < bound_mm
        # y points to the right: a left wing's tip has the other sign.
        assert np.sign(rows[-1].line_in_body_m[-1, 1]) == (1 if wing == "right" else -1)


@pytest.mark.parametrize("wing", WINGS)
def test_the_roots_rates_are_taken_off_both_wings(log, logged, records, wing: str) -> None:
    truths = [record for record in records if isinstance(record, Truth)]
    blind = fly_again(LogReader(log).config, logged, has_root=False)
    for kind, factor in (("rg", 4.0), ("crg", 20.0)):
        error, blind_error = (
            tip_errors_mm(rows_of(m, wing, kind), truths) for m in (records, blind)
        )
        # What is left of the gyros' bias drifts; the root's roll swings.
        assert np.std(error) * factor < np.std(blind_error)
        assert np.std(blind_error) > 30.0


def test_every_record_stands_once_and_in_order(logged: list[LoggedRecord]) -> None:
    arrivals_ns = [item.arrival_ns for item in logged]
    assert arrivals_ns == sorted(arrivals_ns)
    samples = [item.record for item in logged if isinstance(item.record, ImuSample)]
    assert {sample.pod for sample in samples} == {"root", "0", "1", "2", "3"}
    assert len({(sample.pod, sample.seq) for sample in samples}) == len(samples)
    ticks = [
        (row.t_ns, row.wing, row.kind)
        for row in (item.record for item in logged)
        if isinstance(row, WingShapeEstimate) and row.kind != "filtered"
    ]
    assert len(ticks) == 4 * SECONDS * 100
    at = [(wing, kind) for wing in WINGS for kind in ("rg", "crg")]
    for first in range(0, len(ticks), 4):
        assert [tick[1:] for tick in ticks[first : first + 4]] == at
        assert len({tick[0] for tick in ticks[first : first + 4]}) == 1


def test_sources_say_of_which_wing_they_speak(records: list) -> None:
    sources = {record.source for record in records if isinstance(record, Health)}
    assert {"root right", "root left", "camera right", "camera left", "pod 3"} <= sources
    assert not {"root", "camera", "estimator"} & sources


@pytest.mark.parametrize("images", [True, False])
def test_replay_repeats_every_record_bit_for_bit(
    log: Path, logged, tmp_path: Path, images: bool
) -> None:
    again = tmp_path / "again.mcap"
    replay(log, again, images=images)
    repeated = LogReader(again).messages(decode_images=False)
    kept = [m for m in logged if images or not isinstance(m.record, EncodedFrame)]
    for flown, flown_again in zip(kept, repeated, strict=True):
        assert flown_again[0] == flown[0]
        assert flown_again.arrival_ns == flown.arrival_ns
        assert encode(flown_again.record, 0) == encode(flown.record, 0)


@pytest.mark.parametrize("wing", WINGS)
def test_a_wing_is_estimated_alone_as_beside_the_other(log, logged, records, wing: str) -> None:
    alone = fly_again(LogReader(log).config.for_wing(wing), logged)
    for kind in ("rg", "crg", "filtered"):
        beside = {row.t_ns: row for row in rows_of(records, wing, kind)}
        rows = [row for row in rows_of(alone, wing, kind) if row.t_ns in beside]
        assert len(rows) > 0.98 * len(beside)
        assert all(encode(row, 0) == encode(beside[row.t_ns], 0) for row in rows)


def test_evaluate_and_report_speak_of_both_wings(avionics, log: Path, tmp_path: Path) -> None:
    done = avionics("evaluate", log, "--json")
    assert done.status == 0, done.err
    figures = json.loads(done.out)["wings"]
    assert list(figures) == list(WINGS)
    for wing in WINGS:
        # As one wing alone, at half its pixels a degree.
        assert figures[wing]["truth"] == "sim"
        assert figures[wing]["crg"]["eq17_px"]["median"] < 0.5
        assert figures[wing]["crg"]["eq17_px"]["p95"] < 1.25
        assert figures[wing]["crg"]["tip_mm"]["rmse"] < 5.0
        assert figures[wing]["tracks"]["found"] > 0.9
    told = avionics("evaluate", log).out
    assert "wing right" in told
    assert "wing left" in told
    page = tmp_path / "report.html"
    assert avionics("report", log, "-o", page).status == 0
    text = page.read_text(encoding="utf-8")
    for wing in WINGS:
        for heading in ("What flew", "Error against the truth", "Tip deflection", "Gyros"):
            assert f"<h2>Wing {wing}: {heading}</h2>" in text
    assert text.count("<h2>Events</h2>") == 1


def test_tables_of_several_wings_carry_their_names(avionics, log: Path, tmp_path: Path) -> None:
    assert avionics("export", log, "-o", tmp_path).status == 0
    names = {path.stem for path in tmp_path.iterdir()}
    both = ("estimate_rg", "estimate_crg", "estimate_filtered", "truth", "tracks", "innovations")
    assert {f"{base}_{wing}" for base in both for wing in WINGS} <= names
    assert not names & {*both, "frames"}
    assert {"imu_0", "imu_3", "imu_root", "events", "health"} <= names
    with (tmp_path / "estimate_crg_left.csv").open(encoding="utf-8") as file:
        heads = file.readline()
    assert "bias_2_x_rad_s" in heads
    assert "bias_0_x_rad_s" not in heads


def test_info_names_the_wings(avionics, log: Path) -> None:
    told = avionics("info", log).out
    for wing in WINGS:
        assert f"wing '{wing}': span 1.5 m, 2 pods, 6 markers, camera '{wing}'" in told


def test_a_bench_serves_one_wing_and_asks_which(avionics, tmp_path: Path) -> None:
    words = ("rig", "serve", "default", EXAMPLE, "-o", tmp_path / "truth.mcap")
    done = avionics(*words)
    assert done.status != 0
    assert "rig serve takes one wing" in done.err
    assert "right, left; choose one with --wing NAME" in done.err
    done = avionics(*words, "--wing", "middle")
    assert done.status != 0
    assert "wing 'middle': " in done.err
    assert "one of right, left" in done.err


def test_the_doctor_looks_at_every_wing_and_at_the_root(avionics) -> None:
    done = avionics("doctor", EXAMPLE)
    assert done.status == 1
    for what in ("pod 0 on /dev/i2c-1", "pod 3 on virtual wing, node 2", "root on /dev/i2c-3"):
        assert what in done.out
    assert "pod 3 on virtual wing, node 2: no frame from node 2" in " ".join(done.out.split())
    for wing in WINGS:
        assert f"camera {wing}" in done.out
