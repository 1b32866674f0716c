"""``.ci/half-speed`` hands on what it is given and gives back what comes of it."""

import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).parents[1] / ".ci" / "half-speed"


def half_speed(*words: str, given: str = "") -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [str(SCRIPT), *words], input=given, capture_output=True, text=True, timeout=60, check=False
    )


def test_command_runs_on_two_cpus_with_its_input_and_status() -> None:
    script = "import os, sys; print(len(os.sched_getaffinity(0)), sys.stdin.read()); sys.exit(7)"
    done = half_speed("python3", "-c", script, given="said")
    assert done.returncode == 7, done.stderr
    count, said = done.stdout.split()
    assert int(count) <= 2
    assert said == "said"
    assert "half-speed: CPUs" in done.stderr


def test_half_of_a_cpu_is_left() -> None:
    script = (
        "import time; a, b = time.perf_counter(), time.process_time()\n"
        "while time.process_time() - b < 0.4: pass\n"
        "print(0.4 / (time.perf_counter() - a))"
    )
    done = half_speed("python3", "-c", script)
    assert float(done.stdout) < 0.75, done.stderr


@pytest.mark.parametrize("words", [(), ("--quota",)])
def test_without_a_command_it_explains_itself(words: tuple[str, ...]) -> None:
    done = half_speed(*words)
    assert done.returncode == 2
    assert "Run a command on two CPUs" in done.stdout
