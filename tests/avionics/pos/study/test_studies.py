"""Specifications, studies, reports and the command line, on flights shortened to seconds."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from avionics.cli import pos as cli
from avionics.config.load import read_toml
from avionics.errors import AvionicsError, ConfigError, DataSetError, OutputExistsError
from avionics.pos.study.design import analyse, cheapest_sensors, load_design, parse_design
from avionics.pos.study.design_page import write_design
from avionics.pos.study.drive import drive_spec, read_drive
from avionics.pos.study.report import write_report
from avionics.pos.study.results import digits, table_rows, write_parquet
from avionics.pos.study.runs import Study, run_study
from avionics.pos.study.spec import (
    FOLDER,
    READY,
    ChangeTable,
    Spec,
    load_spec,
    parse_spec,
)
from avionics.pos.study.warnings import warnings

pytestmark = pytest.mark.slow

CAR = Path(__file__).resolve().parents[5] / "shared/data/real/car-drive/2014-03-26-000-Data.csv"
ARCMIN = math.degrees(60.0)


def short_tables(name: str = "gong-table2") -> dict[str, Any]:
    """A ready specification over 40 s."""
    tables = read_toml(FOLDER / f"{name}.toml")
    tables["legs"] = [
        {"duration_s": 10},
        {"duration_s": 20, "turn_deg": 40, "variation_m_s": 10, "speed_change_m_s": 5},
        {"duration_s": 10},
    ]
    names = [segment["name"] for segment in tables["segments"]]
    tables["segments"] = [
        {"name": segment, "from_s": 25 + 5 * i, "to_s": 40} for i, segment in enumerate(names)
    ]
    tables["seeds"] = [1, 2]
    return tables


@pytest.fixture(scope="module")
def spec() -> Spec:
    return parse_spec(short_tables(), origin="short")


@pytest.fixture(scope="module")
def study(spec: Spec) -> Study:
    return run_study(
        "short",
        spec,
        "consistent",
        seeds=(1, 2),
        scenarios=spec.scenarios,
        change_seeds=(1,),
        with_bounds=True,
    )


@pytest.mark.parametrize("name", READY)
def test_ready_specifications_hold_both_profiles(name: str) -> None:
    spec = load_spec(name)
    assert set(spec.profiles) == {"as_published", "consistent"}
    assert spec.seeds == (1, 10)
    for published in spec.published:
        assert published.scenario in spec.scenarios
        methods = {method.name for method in spec.profiles["as_published"].methods}
        assert published.method in methods


@pytest.mark.parametrize("name", READY)
def test_every_change_changes_something(name: str) -> None:
    for profile in load_spec(name).profiles.values():
        plain = profile.changed(ChangeTable(name="none"))
        for change in profile.changes:
            assert profile.changed(change) != plain, change.name


def test_the_flight_is_the_papers() -> None:
    spec = load_spec("gong-table2")
    truth = spec.profiles["as_published"].truth
    plain, varied = (spec.trajectory(scenario, truth) for scenario in spec.scenarios)
    assert plain.t[-1] == 1300.0
    assert np.rad2deg(plain.euler[[15_000, 25_000, 80_000], 0]) == pytest.approx([70, 70, 130])
    assert np.linalg.norm(varied.velocity[20_000]) == pytest.approx(300.0)
    assert np.linalg.norm(varied.velocity[-1]) == pytest.approx(100.0)


def test_the_road_has_two_straight_legs_and_ends_at_rest() -> None:
    spec = load_spec("gong-table4")
    truth = spec.profiles["as_published"].truth.model_copy(update={"wobble": False})
    drive = spec.trajectory("drive", truth)
    for start, end in ((300, 700), (800, 1200)):
        heading = drive.euler[start * 100 : end * 100 + 1, 0]
        assert np.ptp(heading) < 1e-12
    assert drive.t[-1] == 1500.0
    speed = np.linalg.norm(drive.velocity, axis=1)
    assert speed.max() <= 20.0
    assert speed[-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"colour": 1}, "unknown key 'colour'"),
        ({"title": None}, "key 'title'"),
        ({"segments": [{"name": "A", "from_s": 10, "to_s": 99}]}, "does not lie inside"),
        ({"seeds": [5, 2]}, "first <= last"),
        ({"node": {"misalignment_deg": [0, 0, 0], "lever_arm_m": [0, 0, 0]}}, "exactly one"),
    ],
)
def test_errors_name_file_and_key(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match="mine") as caught:
        parse_spec({**short_tables(), **change}, origin="mine")
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) <= 2


def test_unknown_studies_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="'nosuch' is no study: give a"):
        load_spec("nosuch")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_spec(str(tmp_path / "missing.toml"))
    with pytest.raises(ConfigError, match="is no design"):
        load_design("nosuch")


def test_a_run_does_not_depend_on_its_company(spec: Spec) -> None:
    """Same seed, alone and among others, in another order: bit for bit."""
    both = run_study("s", spec, "as_published", seeds=(1, 2), scenarios=("no variation",))
    alone = run_study("s", spec, "as_published", seeds=(2,), scenarios=("no variation",))
    for line in alone.lines:
        other = both.line(line.scenario, line.method)
        assert other is not None
        np.testing.assert_array_equal(line.runs[0].rmse, other.runs[1].rmse)


def test_smoothed_lines_and_changes_are_there(study: Study) -> None:
    methods = {line.method for line in study.lines}
    assert {"IMU", "Gs", "As", "GA", "IMU smoothed", "GA smoothed"} <= methods
    assert {line.scenario for line in study.lines} == {"no variation", "with variation"}
    assert set(study.changes) == {c.name for c in study.spec.profiles["consistent"].changes}
    seldom = {line.method: line for line in study.changes["20 Hz updates"]}["IMU"]
    plain = study.line("no variation", "IMU")
    assert plain is not None
    assert np.all(seldom.mean("sigma") > plain.mean("sigma"))


def test_bounds_are_stated_for_every_method(study: Study) -> None:
    assert set(study.bounds) == {"IMU", "Gs", "As", "GA"}
    for method, bound in study.bounds.items():
        line = study.line("no variation", method)
        assert line is not None
        axes = slice(0, 2) if method == "As" else slice(0, 3)
        ratio = (line.mean("sigma") / bound)[axes]
        assert np.all((ratio > 0.7) & (ratio < 1.3)), (method, ratio)


def test_rows_show_paper_ours_and_spread(study: Study) -> None:
    rows = list(table_rows(study.spec, study.lines))
    imu = next(row for row in rows if row[:2] == ["no variation", "IMU"] and row[4] == "RMSE")
    assert imu[5:8] == ["0.6643", "0.5720", "2.167"]
    line = study.line("no variation", "IMU")
    assert line is not None
    assert imu[8] == digits(float(line.mean("rmse")[0]) * ARCMIN)


def test_parquet_holds_every_run(study: Study, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    count = write_parquet(study, tmp_path / "runs.parquet")
    table = parquet.read_table(tmp_path / "runs.parquet")
    assert table.num_rows == count
    lines = len(study.lines) * 2 + sum(len(lines) for lines in study.changes.values())
    assert count == lines * 3 * 2 * 3  # quantities, segments, axes
    assert set(table["seed"].to_pylist()) == {1, 2}


def test_the_page_stands_alone(study: Study, tmp_path: Path) -> None:
    first = tuple(line for line in study.lines if line.scenario == "no variation")
    one = replace(study, lines=first, trajectories=dict([*study.trajectories.items()][:1]))
    path = write_report([one], tmp_path)
    text = path.read_text(encoding="utf-8")
    assert "<svg" in text
    for outside in ('src="http', 'href="http', "<script", "@import"):
        assert outside not in text
    assert "What turns the differences on and off" in text
    assert (tmp_path / "figures" / "consistent-error-system.png").stat().st_size > 10_000


def test_a_wrong_model_is_called_out(spec: Spec) -> None:
    published = run_study("s", spec, "as_published", seeds=(1, 2), scenarios=("no variation",))
    told = list(warnings(published))
    assert any(text.startswith("As, no variation") for text in told)


def test_a_run_that_diverged_is_called_out_among_the_changes_too(study: Study) -> None:
    """GIVEN As 100 sigmas and 20 deg off on z with one change, THEN it says so, and of no other."""
    assert not any("diverged" in text for text in warnings(study))
    line = next(line for line in study.changes["20 Hz updates"] if line.method == "As")
    run = line.runs[0]
    rmse = run.rmse.copy()
    rmse[0, :, 2] = math.radians(20.0)
    lost = replace(line, runs=(replace(run, rmse=rmse, sigma=np.full_like(rmse, 1e-3)),))
    changes = {"20 Hz updates": (lost,)}
    told = [text for text in warnings(replace(study, changes=changes)) if "diverged" in text]
    assert len(told) == 1
    assert told[0].startswith("As diverged")
    assert "with 20 Hz updates z 20." in told[0]


def test_what_no_change_explains_is_said_on_the_page(spec: Spec, tmp_path: Path) -> None:
    profile = spec.profiles["as_published"]
    first = profile.model_copy(update={"methods": profile.methods[:1]})
    small = spec.model_copy(update={"profiles": {"as_published": first}})
    made = run_study("s", small, "as_published", seeds=(1,), scenarios=("no variation",))
    text = write_report([made], tmp_path).read_text(encoding="utf-8")
    assert "Unexplained: No change brings As" in text


def test_design_answers_with_the_cheapest_that_will_do() -> None:
    tables = read_toml(FOLDER / "wing-nodes.toml")
    tables["legs"] = [{"duration_s": 20, "turn_deg": 40}, {"duration_s": 20}]
    tables["segments"] = [{"name": "end", "from_s": 30, "to_s": 40}]
    tables["nodes"], tables["grades"] = tables["nodes"][:1], tables["grades"][:1]
    design = parse_design(tables, origin="short")
    cells = analyse(design)
    assert len(cells) == 4
    by_method = {cell.method: cell for cell in cells}
    assert np.all(by_method["GA"].sigma < by_method["Gs"].sigma)
    assert np.all(by_method["IMU"].smoothed_sigma <= by_method["IMU"].sigma)
    node, grade = design.nodes[0].name, design.grades[0].name
    loose = design.model_copy(update={"required_arcmin": (1e3, 1e3, 1e3)})
    tight = design.model_copy(update={"required_arcmin": (1e-6, 1e-6, 1e-6)})
    imu = by_method["IMU"].sigma * 1.01
    middle = design.model_copy(update={"required_arcmin": tuple(imu)})
    assert cheapest_sensors(loose, cells, node, grade) == "three gyros (Gs)"
    assert cheapest_sensors(middle, cells, node, grade).startswith("an IMU")
    assert cheapest_sensors(tight, cells, node, grade) == "nothing of this grade"


def test_design_page_has_its_picture(tmp_path: Path) -> None:
    tables = read_toml(FOLDER / "wing-nodes.toml")
    tables["legs"] = [{"duration_s": 20, "turn_deg": 40}]
    tables["segments"] = [{"name": "end", "from_s": 15, "to_s": 20}]
    tables["nodes"], tables["grades"] = tables["nodes"][:2], tables["grades"][:1]
    design = parse_design(tables, origin="short")
    path = write_design(design, "short", analyse(design), tmp_path)
    assert "What each node needs" in path.read_text(encoding="utf-8")
    assert (tmp_path / "design.png").exists()


def test_command_line_tells_the_requirement_and_warns_of_as(tmp_path: Path) -> None:
    text = (FOLDER / "wing-nodes.toml").read_text(encoding="utf-8")
    text = text.replace("duration_s = 100", "duration_s = 10").replace(
        "duration_s = 400", "duration_s = 10"
    )
    file = tmp_path / "short.toml"
    file.write_text(text.replace("from_s = 400, to_s = 700", "from_s = 30, to_s = 40"))
    result = CliRunner().invoke(cli.app, ["design", str(file), "-o", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    told = " ".join(result.output.split())
    assert "Required, one-sigma about x, y, z: 3, 3, 6 arcmin." in told
    assert "Do not count on the z sigmas of As." in told
    assert "Do not count" in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")


def test_command_line_runs_a_file_and_refuses_to_overwrite(tmp_path: Path) -> None:
    text = (FOLDER / "guo-table1.toml").read_text(encoding="utf-8")
    text = text.replace("duration_s = 200", "duration_s = 20").replace(
        "duration_s = 100", "duration_s = 20"
    )
    text = text.replace("duration_s = 400", "duration_s = 20").replace(
        "from_s = 600, to_s = 900", "from_s = 60, to_s = 80"
    )
    file, folder = tmp_path / "short.toml", tmp_path / "out"
    file.write_text(text, encoding="utf-8")
    command = ["run", str(file), "--seeds", "1:2", "--profile", "consistent", "-o", str(folder)]
    result = CliRunner().invoke(cli.app, [*command, "--no-explain"])
    assert result.exit_code == 0, result.output
    assert "1.844" in result.output  # the paper's y
    assert (folder / "index.html").exists()
    assert (folder / "consistent.parquet").exists()
    again = CliRunner().invoke(cli.app, command)
    assert isinstance(again.exception, OutputExistsError)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--seeds", "3"], "wants FIRST:LAST"),
        (["--seeds", "5:2"], "lies before"),
        (["--profile", "mine"], "profile 'mine' is not in the study"),
        (["--scenario", "upside down"], "scenario 'upside down' is not in the study"),
    ],
)
def test_wrong_choices_are_one_line(tmp_path: Path, arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(
        cli.app, ["run", "gong-table2", "-o", str(tmp_path / "o"), *arguments]
    )
    assert isinstance(result.exception, AvionicsError)
    assert words in str(result.exception)
    assert not (tmp_path / "o").exists()


def test_broken_recordings_are_named(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    with pytest.raises(DataSetError, match="cannot be read"):
        read_drive(path)
    path.write_text("millis,speed\n1,2\n", encoding="utf-8")
    with pytest.raises(DataSetError, match="holds 1 samples"):
        read_drive(path)
    path.write_text("millis,speed\n" + "1,2\n" * 600, encoding="utf-8")
    with pytest.raises(DataSetError, match="column 'rollrate' is missing"):
        read_drive(path)


@pytest.mark.skipif(not CAR.exists(), reason="the recorded car drive is not beside the project")
def test_the_car_drive_is_a_carrier() -> None:
    drive = read_drive(CAR)
    assert drive.trajectory.t[-1] == pytest.approx(215.9, abs=0.2)
    assert drive.track_error_m < 25.0
    speed = np.linalg.norm(drive.trajectory.velocity, axis=1)
    assert speed.min() >= 0.0
    assert 14.0 < speed.max() < 18.0  # 57.8 km/h
    spec = drive_spec(float(drive.trajectory.t[-1]))
    study = run_study(
        "car", spec, "consistent", seeds=(1,), scenarios=spec.scenarios, carrier=drive.trajectory
    )
    imu = study.line("drive", "IMU")
    assert imu is not None
    assert np.all(imu.mean("rmse") * ARCMIN < [0.15, 0.15, 0.5])
