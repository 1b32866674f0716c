from pathlib import Path

import numpy as np
import pytest

from avionics.errors import ConfigError
from sim_bus.wing import rod_dynamics as drive
from sim_bus.wing.loads import ScenarioLoads
from sim_bus.wing.scenario import load_scenario, packaged_scenarios, parse_scenario


def loads(*tables: dict) -> ScenarioLoads:
    scenario = parse_scenario({"name": "test", "loads": list(tables)}, origin="test")
    return ScenarioLoads(
        scenario.loads, rest_tip_m=np.array([0.0, 1.49, 0.13]), node_y_m=np.linspace(0, 1.49, 5),
        rng=np.random.default_rng(0),
    )  # fmt: skip


def table_of(source: ScenarioLoads, t_s: np.ndarray) -> np.ndarray:
    table = np.zeros((t_s.size, drive.GUST + 5))
    source.fill(table, t_s)
    return table


def test_packaged_scenarios_are_all_there() -> None:
    assert set(packaged_scenarios()) == {"default", "faults", "gust", "moving_root", "oblique"}
    for name in packaged_scenarios():
        assert load_scenario(name).name == name


def test_unknown_key_names_file_and_key(tmp_path: Path) -> None:
    path = tmp_path / "flight.toml"
    path.write_text('name = "x"\n[wing]\nmas_per_m = 1.0\n')
    with pytest.raises(ConfigError, match=r"flight\.toml: unknown key 'wing\.mas_per_m'"):
        load_scenario(path)


def test_missing_and_broken_files_say_so(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="give a TOML file or one of default, faults"):
        load_scenario("defualt")
    path = tmp_path / "flight.toml"
    path.write_text("name = ")
    with pytest.raises(ConfigError, match="not valid TOML"):
        load_scenario(path)


def test_unknown_fault_kind_is_refused() -> None:
    with pytest.raises(ConfigError, match="'nack' is unknown"):
        parse_scenario({"name": "x", "faults": [{"kind": "nack", "at_s": 1}]}, origin="x")


def test_force_rises_holds_and_lets_go() -> None:
    source = loads(
        {"kind": "force", "at_s": 1.0, "for_s": 2.0, "newtons": 5.0, "direction": (3.0, 0.0, 4.0)}
    )
    found = table_of(source, np.array([0.9, 1.25, 2.0, 2.99, 3.01]))[:, drive.TIP_FORCE :][:, :3]
    assert found[0] == pytest.approx([0, 0, 0])
    assert 0 < found[1, 2] < 4.0
    assert found[2] == pytest.approx([3.0, 0.0, 4.0])
    assert found[3] == pytest.approx([3.0, 0.0, 4.0])
    assert found[4] == pytest.approx([0, 0, 0])


def test_force_without_direction_is_refused() -> None:
    source = loads({"kind": "force", "at_s": 0, "for_s": 1, "newtons": 1, "direction": (0, 0, 0)})
    with pytest.raises(ValueError, match="must have a length"):
        table_of(source, np.array([0.5]))


def test_sweep_grows_in_frequency_within_its_bounds() -> None:
    source = loads(
        {"kind": "sweep", "at_s": 0, "for_s": 40, "from_hz": 0.2, "to_hz": 6.0, "speed_m_s": 1.6,
         "accel_m_s2": 14.0, "amplitude_m": 0.4}
    )  # fmt: skip
    t_s = np.arange(0, 40, 1e-3)
    table = table_of(source, t_s)
    wave = table[:, drive.HANDLE] - 0.13
    crossings = t_s[:-1][np.diff(np.sign(wave)) > 0]
    periods = np.diff(crossings)
    assert periods[0] == pytest.approx(1 / 0.2, rel=0.35)
    assert 1 / periods[-1] == pytest.approx(6.0, rel=0.05)
    assert np.abs(wave).max() <= 0.4 + 1e-9
    # A slow change of amplitude adds a little to the bound of a sine.
    assert np.abs(table[:, drive.HANDLE_SPEED]).max() < 1.1 * 1.6
    assert np.abs(np.diff(wave, 2)).max() / 1e-6 < 1.2 * 14.0
    assert np.linalg.norm(table[2000, drive.GUIDE : drive.GUIDE + 3]) == pytest.approx(1.0)


def test_sweep_lets_go_at_its_end() -> None:
    source = loads({"kind": "sweep", "at_s": 1, "for_s": 5})
    hold = table_of(source, np.array([0.5, 3.0, 5.99, 6.01]))[:, drive.HOLD]
    assert hold == pytest.approx([0.0, 300.0, 300.0, 0.0])


def test_turbulence_has_its_strength_and_differs_along_the_span() -> None:
    source = loads({"kind": "gust", "at_s": 0, "for_s": 1000, "sigma_m_s": 0.8, "length_m": 3.0})
    gust = -table_of(source, np.arange(5, 900, 0.05))[:, drive.GUST :]
    assert gust.std() == pytest.approx(0.8, rel=0.1)
    assert np.corrcoef(gust[:, 0], gust[:, -1])[0, 1] < 0.5


def test_one_minus_cosine_gust_lifts() -> None:
    source = loads(
        {"kind": "gust", "at_s": 0, "for_s": 60, "airspeed_m_s": 10, "peak_m_s": 2.0,
         "gradient_m": 5.0, "every_s": 8.0}
    )  # fmt: skip
    table = table_of(source, np.array([8.0, 8.5, 9.0, 9.5]))
    # The table's gust points down.
    assert table[:, drive.GUST] == pytest.approx([0.0, -2.0, 0.0, 0.0], abs=1e-9)
    assert table[1, drive.AIRSPEED] == pytest.approx(10.0)
