"""The LED tracker on pictures of a real wing: rows of three LEDs, bloom, a second colour."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parents[3] / "benchmarks/trackers.py"


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    spec = importlib.util.spec_from_file_location("trackers_benchmark", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look themselves up there
    spec.loader.exec_module(module)
    if not module.PICTURES.exists():
        pytest.skip("the recorded LED pictures are not beside this checkout")
    return module


def test_every_led_of_every_row_is_followed(bench) -> None:
    score = bench.run("led", middle_only=False)
    assert score.found == score.of == 1470
    assert score.swapped == 0
    assert score.rms_px < 0.2
    assert score.label_px < 1.5  # made by hand


def test_the_middle_led_of_a_row_is_no_piece_of_a_bar(bench) -> None:
    score = bench.run("led", middle_only=True)
    assert score.found > 0.97 * score.of
    assert score.swapped == 0
    assert score.rms_px < 0.2
