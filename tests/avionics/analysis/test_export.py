import csv
from pathlib import Path

import numpy as np
import pytest

from avionics.analysis.export import export
from avionics.analysis.flight import read_flight
from avionics.config import Config
from avionics.config.load import default_config_text, parse_config
from avionics.errors import OutputExistsError, RecordingError
from avionics.recording import LogReader, LogWriter
from avionics.records import Event, Health, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import Frame, ImuSample

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib

ROWS = 5
ORIGIN_NS = 1_700_000_000_000_000_001
"""Beyond 2^53: a float would lose the last digits."""


def make_config() -> Config:
    tables = tomllib.loads(default_config_text())
    tables["truth_markers"] = [{"id": 8, "s_m": 0.9, "x_m": 0.05}]
    return parse_config(tables, origin="test")


def estimate(rng: np.random.Generator, t_ns: int, kind: str) -> WingShapeEstimate:
    has_bias = kind != "rg"
    return WingShapeEstimate(
        t_ns,
        "right",
        kind,
        "quarter-sine/2+1+0",
        rng.normal(size=2),
        rng.normal(size=1),
        np.empty(0),
        rng.normal(size=2),
        np.full(1, np.nan),
        np.empty(0),
        rng.normal(size=(2, 3)) if has_bias else np.full((2, 3), np.nan),
        rng.normal(size=(2, 3)) if has_bias else np.full((2, 3), np.nan),
        rng.normal(size=(7, 3)),
        rng.normal(size=3),
        rng.normal(size=(6, 2)),
        rng.normal(size=(6, 2)),
        0.8,
        np.array([True] * 5 + [False]),
    )


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "flight.mcap"
    rng = np.random.default_rng(11)
    found = np.array([True, False, True, True, True, True])
    with LogWriter(path, make_config()) as writer:
        for number in range(ROWS):
            t_ns = ORIGIN_NS + number * 10_000_000
            pixel = rng.normal(size=(6, 2)) * 100
            pixel[1] = np.nan
            for record in (
                ImuSample(t_ns, "0", number, rng.normal(size=3)),
                ImuSample(t_ns, "1", number, rng.normal(size=3), rng.normal(size=3)),
                Frame(t_ns, "root", number, np.zeros((8, 8), np.uint8)),
                MarkerTracks(t_ns, "root", number, pixel, np.where(found, 0.1, np.nan), found),
                *(estimate(rng, t_ns, kind) for kind in ("rg", "crg", "filtered")),
                Truth(t_ns, "right", "mocap", rng.normal(size=(1, 3))),
                Health(t_ns, "can0", {"frames": number}),
                Event(t_ns, "pod 1", "warning", 'silent, "again"'),
            ):
                writer.write(record, t_ns + 1000)
    return path


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_one_table_per_topic(log: Path, tmp_path: Path) -> None:
    written = export(read_flight(log), tmp_path / "out")
    assert {path.name: rows for path, rows in written.items()} == {
        "imu_0.csv": ROWS,
        "imu_1.csv": ROWS,
        "frames.csv": ROWS,
        "tracks.csv": ROWS * 6,
        "estimate_rg.csv": ROWS,
        "estimate_crg.csv": ROWS,
        "estimate_filtered.csv": ROWS,
        "innovations.csv": ROWS,
        "truth.csv": ROWS,
        "health.csv": ROWS,
        "events.csv": ROWS,
    }


def test_estimate_columns_are_those_of_the_contract(log: Path, tmp_path: Path) -> None:
    export(read_flight(log), tmp_path)
    names = ["phi_1_rad", "phi_2_rad", "theta_1_rad"]
    names += [f"bias_{pod}_{axis}_rad_s" for pod in (0, 1) for axis in "xyz"]
    names += [f"marker_{marker}_{axis}_px" for marker in range(6) for axis in "uv"]
    names += ["tip_x_m", "tip_y_m", "tip_z_m"]
    expected = ["t_ns", *names, *(f"{name}_sigma" for name in names)]
    assert list(read(tmp_path / "estimate_crg.csv")[0]) == expected
    without_bias = [name for name in expected if not name.startswith("bias")]
    assert list(read(tmp_path / "estimate_rg.csv")[0]) == without_bias


def test_tracks_columns_are_those_of_the_contract(log: Path, tmp_path: Path) -> None:
    export(read_flight(log), tmp_path)
    rows = read(tmp_path / "tracks.csv")
    assert list(rows[0]) == ["t_ns", "frame", "marker", "u_px", "v_px", "sigma_px", "found"]
    assert [row["marker"] for row in rows[:6]] == ["0", "1", "2", "3", "4", "5"]
    assert rows[1] == {
        "t_ns": str(ORIGIN_NS),
        "frame": "0",
        "marker": "1",
        "u_px": "",
        "v_px": "",
        "sigma_px": "",
        "found": "0",
    }


def test_numbers_come_back_exactly(log: Path, tmp_path: Path) -> None:
    export(read_flight(log), tmp_path)
    rows = read(tmp_path / "estimate_crg.csv")
    records = [i.record for i in LogReader(log).messages(["*/estimate_crg"])]
    for row, record in zip(rows, records, strict=True):
        assert int(row["t_ns"]) == record.t_ns
        assert float(row["phi_2_rad"]) == record.phi_rad[1]
        assert row["phi_2_rad"] == repr(float(record.phi_rad[1]))
        assert float(row["bias_1_y_rad_s"]) == record.bias_rad_s[1, 1]
        assert float(row["marker_3_v_px_sigma"]) == record.marker_sigma_px[3, 1]
        assert float(row["tip_z_m"]) == record.line_in_body_m[-1, 2]
        assert row["theta_1_rad_sigma"] == ""


def test_truth_names_its_markers_by_id(log: Path, tmp_path: Path) -> None:
    export(read_flight(log), tmp_path)
    assert list(read(tmp_path / "truth.csv")[0]) == [
        "t_ns",
        "marker_8_x_m",
        "marker_8_y_m",
        "marker_8_z_m",
    ]


def test_events_keep_their_words(log: Path, tmp_path: Path) -> None:
    export(read_flight(log), tmp_path)
    assert read(tmp_path / "events.csv")[0]["message"] == 'silent, "again"'


def test_parquet_holds_the_same(log: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    export(read_flight(log), tmp_path)
    export(read_flight(log), tmp_path, "parquet")
    table = parquet.read_table(tmp_path / "estimate_crg.parquet")
    rows = read(tmp_path / "estimate_crg.csv")
    assert table.column_names == list(rows[0])
    assert table["t_ns"].to_pylist() == [int(row["t_ns"]) for row in rows]
    assert table["phi_1_rad"].to_pylist() == [float(row["phi_1_rad"]) for row in rows]
    assert table["theta_1_rad_sigma"].null_count == ROWS


def test_existing_tables_are_refused(log: Path, tmp_path: Path) -> None:
    (tmp_path / "tracks.csv").write_text("precious")
    with pytest.raises(OutputExistsError, match="--force"):
        export(read_flight(log), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["tracks.csv"]
    export(read_flight(log), tmp_path, force=True)
    assert len(read(tmp_path / "tracks.csv")) == ROWS * 6


def test_a_file_in_place_of_the_directory_is_a_clear_error(log: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(RecordingError, match="is a file; give the name of a folder"):
        export(read_flight(log), tmp_path / "out")
