"""Every program in examples/ runs and shows what it says."""

import importlib.util
import runpy
import sys
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tests.pages import ROOT, code_blocks, read

pytestmark = pytest.mark.slow
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"example_{name}", ROOT / f"examples/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    """Some seconds of the wing, flown by the example."""
    path = tmp_path_factory.mktemp("examples") / "flight.mcap"
    example("fly_simulated_wing").main([str(path), "--seconds", "7"])
    return path


def test_every_example_is_listed_and_tested() -> None:
    listed = read(Path("examples/README.md"))
    tested = Path(__file__).read_text(encoding="utf-8")
    for path in EXAMPLES:
        assert f"({path.name})" in listed
        assert f'example("{path.stem}")' in tested or f"examples/{path.name}" in tested


def test_log_is_read_as_arrays(log: Path, capsys) -> None:
    example("read_a_log").main(str(log))
    out = capsys.readouterr().out
    assert "pod 0: 700 samples, one every 10.00 ms, 0 lost" in out
    assert {line.split(":")[0] for line in out.splitlines()} >= {"rg", "crg", "filtered"}


def test_tracker_of_ones_own_agrees_with_the_logs(log: Path) -> None:
    apart = example("try_a_tracker").main(str(log), frames=20)
    assert len(apart) > 80
    assert np.median(apart) < 0.3


def test_notebook_runs_as_a_program(log: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    picture = tmp_path / "tip.png"
    monkeypatch.setattr(sys, "argv", ["notebook.py", str(log), str(picture)])
    runpy.run_path(str(ROOT / "examples/notebook.py"))
    assert picture.stat().st_size > 10_000
    assert "within two sigmas" in capsys.readouterr().out


def test_python_of_the_readme_runs(log: Path, capsys) -> None:
    (code,) = code_blocks(read(Path("README.md")), "python")
    assert len(code.strip().splitlines()) <= 10
    space: dict[str, Any] = {}
    exec(code.replace("out/demo.mcap", str(log)), space)
    assert len(space["table"]) == 700
    assert "gyro biases" in capsys.readouterr().out


def test_watch_sees_the_wing_at_rest(capsys) -> None:
    watch = example("watch_a_flight").main(["--seconds", "1.5"])
    # The wing hangs by its weight; after half a second the camera has fixed the shape.
    assert np.ptp(watch.heights_m[50:]) < 0.002
    assert "mm, made 0 ms after its instant" in capsys.readouterr().out


def test_own_driver_counts_a_damaged_line_and_goes_on(capsys) -> None:
    samples = example("own_driver").main()
    assert [b.seq - a.seq for a, b in pairwise(samples)].count(2) == 1
    assert np.degrees(samples[0].rate_rad_s[0]) == pytest.approx(30.0, abs=5.0)
    assert "1 missing in between, 1 lines damaged" in capsys.readouterr().out


def test_shape_of_angles_lifts_the_tip(capsys) -> None:
    tip = example("shape_of_angles").main()
    assert tip[2] < -0.25  # z points down
    assert 1.4 < tip[1] < 1.5
    assert "basis quarter-sine/2+1+0" in capsys.readouterr().out
