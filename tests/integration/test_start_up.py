"""What a command does not use it does not load: half of a short command's time is loading."""

import json
import subprocess
import sys

import pytest

MATHEMATICS = {"numpy", "scipy", "filterpy", "numba", "cv2", "avionics.config"}
DRAWING = {"matplotlib", "pyarrow"}
HARDWARE = {"can", "cantools", "serial", "smbus2", "sim_bus", "drivers.polled_imus"}


def loaded(code: str) -> set[str]:
    """Return the modules that a new interpreter holds after running some code."""
    said = f"import json, sys\n{code}\nprint(json.dumps(list(sys.modules)), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", said], capture_output=True, text=True, check=True, timeout=120
    )
    return set(json.loads(done.stderr))


@pytest.mark.parametrize("arguments", [["--help"], ["replay", "--help"], ["pos", "--help"]])
def test_help_loads_no_mathematics(arguments: list[str]) -> None:
    code = (
        f"sys.argv = ['avionics', *{arguments}]\n"
        "from avionics.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass"
    )
    modules = loaded(code)
    assert "avionics.cli.pos" in modules
    assert not modules & (MATHEMATICS | DRAWING | HARDWARE | {"mcap"})


def test_reading_a_log_loads_neither_scipy_nor_opencv() -> None:
    modules = loaded("import avionics.analysis.info")
    assert "avionics.recording.reader" in modules
    assert not modules & ({"scipy", "filterpy", "numba", "cv2"} | DRAWING | HARDWARE)


def test_replaying_loads_neither_trackers_nor_hardware() -> None:
    modules = loaded("import avionics.analysis.replay")
    assert "avionics.flight.pipeline" in modules
    assert not modules & ({"cv2", "numba", "avionics.tracking"} | DRAWING | HARDWARE)
