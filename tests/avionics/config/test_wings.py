"""``[[wings]]``: several wings in one flight, and the short form for one."""

import hashlib
from pathlib import Path

import pytest

from avionics.config import Config, WingsConfig, one_wing
from avionics.config.load import (
    default_config_text,
    load_config,
    parse_config,
    parse_config_text,
)
from avionics.errors import ConfigError

LENS = {"f_x_px": 600.0, "f_y_px": 600.0, "c_x_px": 319.5, "c_y_px": 239.5}


def wing(name: str, pod: int, **more) -> dict:
    return {
        "name": name, "side": name, "span_m": 1.5, "pods": [{"id": pod, "s_m": 0.6}],
        "markers": [{"id": 0, "s_m": 1.2}], "camera": {"name": f"eye {name}", **LENS},
    } | more  # fmt: skip


def two(left: dict | None = None, right: dict | None = None, **shared) -> dict:
    wings = [wing("left", 0) | (left or {}), wing("right", 1) | (right or {})]
    return {"wings": wings, **shared}


def test_the_short_form_stays_what_it_was() -> None:
    # The SHA-256 that logs of the packaged configuration have carried before there were wings.
    config = parse_config_text(default_config_text(), origin="packaged")
    assert config.digest() == "cfce947fb0529db7931094334989b8ba32cfa73e7e96964bcae84144efe1068a"
    assert config.wing_configs == (config,)


def test_every_wing_has_a_configuration_of_its_own_and_what_all_share() -> None:
    config = parse_config(two(estimator={"form": "paper"}), origin="test")
    assert isinstance(config, WingsConfig)
    left, right = config.wing_configs
    assert (left.wing.name, left.wing.side, left.pod_names) == ("left", "left", ("0",))
    assert (right.wing.name, right.wing.side, right.pod_names) == ("right", "right", ("1",))
    assert [one.camera and one.camera.name for one in (left, right)] == ["eye left", "eye right"]
    assert left.estimator == right.estimator == config.estimator
    assert left.estimator.form == "paper"
    assert [pod.id for pod in config.pods] == [0, 1]
    assert [camera.name for camera in config.cameras] == ["eye left", "eye right"]
    assert config.for_wing("right") == right
    with pytest.raises(ConfigError, match=r"wing 'middle': .* one of left, right"):
        config.for_wing("middle")


def test_a_flight_of_wings_is_stored_and_read_again() -> None:
    config = parse_config(two(), origin="test")
    again = parse_config(config.model_dump(mode="json"), origin="log")
    assert again == config
    assert again.digest() == config.digest()


def test_one_of_wings_is_the_short_form() -> None:
    tables = wing("left", 0)
    short = {
        "wing": {key: tables[key] for key in ("name", "side", "span_m")},
        **{key: tables[key] for key in ("pods", "markers", "camera")},
    }
    one = parse_config({"wings": [tables]}, origin="test")
    assert isinstance(one, Config)
    assert one == parse_config(short, origin="test")


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (two(wing={"span_m": 1.5}), r"wing.toml: .*\[wing\] stands beside \[\[wings\]\]; .*move"),
        (two(pods=[{"id": 3, "s_m": 0.1}]), r"\[pods\] stands beside \[\[wings\]\]"),
        (two(camera=LENS), r"\[camera\] stands beside \[\[wings\]\]"),
        (two(left={"name": "right"}), "wings: every name must be unique, found right, right"),
        (two(right={"pods": [{"id": 0, "s_m": 1.0}]}), "pods of all wings: every id must be uni"),
        (two(left={"camera": {"name": "eye right", **LENS}}), "cameras: every name .* eye right"),
        (two(left={"pods": [{"id": 0, "s_m": 1.7}]}), r"'wings\.0': s_m = 1\.7 of id 0 lies"),
        (two(left={"name": "a/b"}), r"key 'wings\.0\.name'"),
        (two(right={"chord": 1}), r"unknown key 'wings\.1\.chord'"),
        (two(right={"estimator": {}}), r"unknown key 'wings\.1\.estimator'"),
        ({"wings": [{"span_m": 1.5}]}, r"key 'wings\.0\.name' is missing"),
        ({"wings": []}, "key 'wings'"),
        ({"wings": {"name": "left"}}, "key 'wings'"),
    ],
)
def test_what_contradicts_itself_is_refused_by_file_and_key(tables: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse_config(tables, origin="wing.toml")


def test_the_imu_at_the_root_is_one_for_all_and_no_pod_sits_on_its_place() -> None:
    link = {"kind": "i2c", "bus": 3}
    config = parse_config(two(root={"link": link}), origin="test")
    assert all(one.root == config.root for one in config.wing_configs)
    again = parse_config(config.model_dump(mode="json"), origin="log")
    assert again.root == config.root
    assert "root" not in parse_config(two(), origin="test").model_dump(mode="json")
    taken = {"pods": [{"id": 9, "s_m": 1.0, "link": link}]}
    with pytest.raises(ConfigError, match=r"pods 9 and root: link\.address: both answer at 0x28"):
        parse_config(two(right=taken, root={"link": link}), origin="test")
    with pytest.raises(ConfigError, match=r"'root\.R_sensor_from_body': is not a rotation"):
        parse_config(
            two(root={"R_sensor_from_body": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}), origin="t"
        )


def test_marker_ids_are_those_of_their_wing() -> None:
    left, right = parse_config(two(), origin="test").wing_configs
    assert left.markers[0].id == right.markers[0].id == 0


def test_one_key_of_one_wing_is_changed_by_its_name(tmp_path: Path) -> None:
    file = tmp_path / "two.toml"
    file.write_text(
        '[[wings]]\nname = "left"\nspan_m = 1.5\n[[wings]]\nname = "right"\nspan_m = 1.6\n',
        encoding="utf-8",
    )
    config = load_config(file, ("wings.left.span_m=1.4",))
    assert [one.wing.span_m for one in config.wing_configs] == [1.4, 1.6]
    for pair in ("wings.middle.span_m=1", "wings.left=1"):
        with pytest.raises(ConfigError, match=r"wants wings\.NAME\.key=value, with NAME one of"):
            load_config(file, (pair,))


def test_each_camera_has_its_own_calibration_file(tmp_path: Path) -> None:
    lens = "[camera]\nf_x_px = 600.0\nf_y_px = 600.0\nc_x_px = 319.5\nc_y_px = 239.5\n"
    lines = []
    for name, tilt in (("left", -10.0), ("right", -12.0)):
        text = f'{lens}name = "{name}"\ntilt_deg = {tilt}\n'
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
        digest = hashlib.sha256(text.encode()).hexdigest()
        lines += [
            "[[wings]]", f'name = "{name}"', "span_m = 1.5",
            f'calibration = {{ path = "{name}.toml", sha256 = "{digest}" }}',
        ]  # fmt: skip
    file = tmp_path / "two.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    assert [camera.tilt_deg for camera in load_config(file).cameras] == [-10.0, -12.0]


def test_who_takes_one_wing_names_those_it_was_given() -> None:
    config = parse_config(two(), origin="test")
    with pytest.raises(ConfigError, match=r"rig serve takes one wing, .* left, right"):
        one_wing(config, "rig serve")
    left = config.for_wing("left")
    assert one_wing(left, "rig serve") is left
