"""Every program in examples/ runs and shows what it says."""

import importlib.util
import sys
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.pages import ROOT, read

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"example_{name}", ROOT / f"examples/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_every_example_is_listed_and_tested() -> None:
    listed = read(Path("examples/README.md"))
    tested = Path(__file__).read_text(encoding="utf-8")
    for path in EXAMPLES:
        assert f"({path.name})" in listed
        assert f'example("{path.stem}")' in tested


def test_flown_wing_is_scored(tmp_path: Path, capsys) -> None:
    example("fly_simulated_wing").main([str(tmp_path / "flight.mcap"), "--seconds", "7"])
    lines = capsys.readouterr().out.splitlines()
    assert {line.split()[0] for line in lines} >= {"rg", "crg", "filtered"}


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
