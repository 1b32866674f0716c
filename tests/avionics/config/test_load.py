"""How files and overrides become a configuration, and how each mistake is reported."""

import hashlib
from pathlib import Path

import pytest

from avionics.config.load import apply_overrides, load_config, parse_config, parse_config_text
from avionics.errors import ConfigError

WING = "[wing]\nspan_m = 1.5\n"
CAMERA = "[camera]\nf_x_px = 500\nf_y_px = 500\nc_x_px = 320\nc_y_px = 240\n"


@pytest.fixture
def write(tmp_path: Path):
    def make(content: str | bytes, name: str = "wing.toml") -> Path:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return make


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"\xff\xfe[wing]", "is not text in UTF-8"),
        ("[wing\nspan_m = 1.5", "is not valid TOML: .*line 1"),
        ("", "key 'wing' is missing"),
        (WING + "spann = 2\n", "unknown key 'wing.spann'; remove it or correct its spelling"),
        ('[wing]\nspan_m = "long"\n', r"key 'wing.span_m': .*number.* \(found 'long'\)"),
        ("[wing]\nspan_m = -1\n", r"key 'wing.span_m': .*greater than 0 \(found -1\)"),
        ("[wing]\nspan_m = inf\n", "key 'wing.span_m': .*finite"),
        (WING + "[[pods]]\nid = 0\ns_m = 2.0\n", "s_m = 2.0 of id 0 lies beyond span_m = 1.5"),
        (WING + 2 * "[[pods]]\nid = 3\ns_m = 1\n", r"pods: ids \[3, 3\] are not unique"),
        (
            WING + "[[pods]]\nid = 0\ns_m = 1\nR_sensor_from_local = [[1,0,0],[0,1,0],[0,0,-1]]\n",
            "key 'pods.0.R_sensor_from_local': is not a rotation matrix",
        ),
    ],
)
def test_mistake_names_file_key_and_remedy(write, content, why: str) -> None:
    path = write(content)
    with pytest.raises(ConfigError, match=why) as error:
        load_config(path)
    assert str(error.value).startswith(f"{path}: ")


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read \(No such file"):
        load_config(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(tmp_path)


def test_several_mistakes_are_told_at_once(write) -> None:
    path = write(WING + "a = 1\nb = 2\n[estimator]\ngate_sigma = 0\n")
    with pytest.raises(ConfigError) as error:
        load_config(path)
    lines = str(error.value).splitlines()
    assert len(lines) == 3
    assert all(line.startswith(f"{path}: ") for line in lines)


def test_override_is_toml_or_else_text() -> None:
    changed = apply_overrides(
        {"estimator": {"form": "general"}},
        ("estimator.form=paper", "estimator.gate_sigma = 4.5", "recorder.images=false",
         "estimator.bending_modes=auto", "estimators=['crg', 'gs']"),
    )  # fmt: skip
    assert changed == {
        "estimator": {"form": "paper", "gate_sigma": 4.5, "bending_modes": "auto"},
        "recorder": {"images": False},
        "estimators": ["crg", "gs"],
    }


def test_override_leaves_the_tables_given_alone() -> None:
    tables = {"wing": {"span_m": 1.5}}
    apply_overrides(tables, ("wing.span_m=2",))
    assert tables == {"wing": {"span_m": 1.5}}


@pytest.mark.parametrize(
    ("pair", "why"),
    [("estimator.form", "wants key=value"), ("=paper", "wants key=value"),
     ("wing.span_m.x=1", "'span_m' is not a table")],
)  # fmt: skip
def test_override_that_leads_nowhere_is_refused(pair: str, why: str) -> None:
    with pytest.raises(ConfigError, match=f"--set {pair}: {why}"):
        apply_overrides({"wing": {"span_m": 1.5}}, (pair,))


def test_calibration_replaces_the_camera_it_was_made_for(write) -> None:
    text = "[camera]\nf_x_px = 507.5\nk1 = -0.05\n"
    write(text, "lens.toml")
    digest = hashlib.sha256(text.encode()).hexdigest()
    path = write(f'calibration = {{ path = "lens.toml", sha256 = "{digest}" }}\n{WING}{CAMERA}')
    camera = load_config(path).camera
    assert (camera.f_x_px, camera.f_y_px, camera.k1) == (507.5, 500.0, -0.05)
    write(text + "k2 = 0.01\n", "lens.toml")
    with pytest.raises(ConfigError, match=rf"lens\.toml: SHA-256 is .*expects {digest}"):
        load_config(path)


def test_calibration_without_a_digest_is_refused(write) -> None:
    path = write(f'calibration = {{ path = "lens.toml" }}\n{WING}')
    with pytest.raises(ConfigError, match="'calibration' wants exactly the keys path and sha256"):
        load_config(path)


def test_configuration_survives_its_own_tables_and_its_digest_tells_it_from_others() -> None:
    config = parse_config_text(WING + CAMERA, origin="here")
    again = parse_config(config.model_dump(mode="json"), origin="log")
    assert again == config
    assert again.digest() == config.digest()
    other = parse_config_text(WING + CAMERA, ("camera.tilt_deg=-6",), origin="here")
    assert other.digest() != config.digest()
