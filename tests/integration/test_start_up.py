"""What a command does not use it does not load: half of a short command's time is loading."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

MATHEMATICS = {"numpy", "scipy", "numba", "cv2", "avionics.config"}
DESK = {"matplotlib", "pyarrow", "numba", "filterpy", "scipy.stats", "cantools"}
HARDWARE = {"can", "cantools", "serial", "smbus2", "sim_bus", "drivers.polled_imus"}
MAIN = (
    "sys.argv = ['avionics', *{}]\nfrom avionics.cli import main\n"
    "try:\n    main()\nexcept SystemExit:\n    pass"
)


def loaded(code: str) -> tuple[set[str], str]:
    """Return the modules that a new interpreter holds after running some code, and its errors."""
    said = f"import json, sys\n{code}\nprint(json.dumps(list(sys.modules)), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", said], capture_output=True, text=True, check=True, timeout=120
    )
    *errors, modules = done.stderr.splitlines()
    return set(json.loads(modules)), "\n".join(errors)


@pytest.mark.parametrize(
    "arguments", [["--version"], ["--help"], ["replay", "--help"], ["pos", "--help"]]
)
def test_help_and_version_load_no_mathematics(arguments: list[str]) -> None:
    modules, _ = loaded(MAIN.format(arguments))
    assert "avionics.cli.pos" in modules
    assert not modules & (MATHEMATICS | DESK | HARDWARE | {"mcap"})


@pytest.mark.parametrize(
    "command",
    [
        ["run", "CONFIG"],
        ["doctor", "CONFIG"],
        ["sim", "CONFIG"],
        ["rig", "serve", "default", "CONFIG"],
        ["replay", "LOG", "--config", "CONFIG", "-o", "OUT"],
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_wrong_configuration_is_refused_before_anything_heavy_loads(
    command: list[str], tmp_path: Path
) -> None:
    files = {name: str(tmp_path / name.lower()) for name in ("CONFIG", "LOG", "OUT")}
    Path(files["CONFIG"]).write_text("[wing]\nspan_m = 1.5\nspann = 2\n", encoding="utf-8")
    Path(files["LOG"]).touch()
    modules, said = loaded(MAIN.format([files.get(word, word) for word in command]))
    assert "unknown key 'wing.spann'" in said
    heavy = {"scipy", "cv2", "mcap", "google.protobuf", "rich.table"}
    assert not modules & (heavy | DESK | HARDWARE)


def test_run_loads_nothing_of_the_desk_before_it_opens_its_devices(tmp_path: Path) -> None:
    config = tmp_path / "wing.toml"
    port = tmp_path / "tty"
    config.write_text(
        f'[wing]\nspan_m = 1.5\n[[pods]]\nid = 0\ns_m = 0.6\nlink = {{ kind = "uart", '
        f'port = "{port}" }}\n[[markers]]\nid = 0\ns_m = 1.4\n'
        "[camera]\nf_x_px = 500\nf_y_px = 500\nc_x_px = 320\nc_y_px = 240\n",
        encoding="utf-8",
    )
    log = tmp_path / "flight.mcap"
    modules, said = loaded(MAIN.format(["run", str(config), "-o", str(log)]))
    assert f"{port} does not open" in said
    assert {"avionics.flight.runner", "avionics.tracking", "avionics.recording"} <= modules
    assert not modules & (DESK | {"sim_bus"})


def test_reading_a_log_loads_neither_scipy_nor_opencv() -> None:
    modules, _ = loaded("import avionics.analysis.info")
    assert "avionics.recording.reader" in modules
    assert not modules & ({"scipy", "cv2"} | DESK | HARDWARE)


def test_replaying_loads_neither_trackers_nor_hardware() -> None:
    modules, _ = loaded("import avionics.analysis.replay")
    assert "avionics.flight.pipeline" in modules
    assert not modules & ({"cv2", "avionics.tracking"} | DESK | HARDWARE)


def test_evaluating_loads_nothing_of_the_desk() -> None:
    modules, _ = loaded("import avionics.analysis.evaluate")
    assert not modules & ({"cv2"} | DESK | HARDWARE)
