"""The plugin in a foreign project: a process of this machine stands for the guest."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

# Is the guest's kernel as far as the plugin can see; named on the command line only.
STAND_IN = """
import os
import subprocess

from sim_bus.guests import guest
from sim_bus.guests import kinds as guests
from sim_bus.guests import pytest_plugin


def run(command, out, *, limit_s, cwd, environment):
    with (out / "stdout").open("w") as stdout, (out / "stderr").open("w") as stderr:
        done = subprocess.run(
            command, cwd=cwd, stdout=stdout, stderr=stderr, check=False,
            env={**os.environ, **environment, "RIG_OUT": str(out), "STAND_IN": "uml"},
        )
    if done.returncode == 99:
        (out / "guest-error").write_text("Kernel panic")
    return guest.GuestResult(done.returncode, out)


guests.RUNNERS["uml"] = run
pytest_plugin.guest_kind = lambda: os.environ.get("STAND_IN")
pytest_plugin._missing = lambda name: os.environ.get("MISSING") if name == "uml" else None
"""
TESTS = """
import os
import pytest

pytestmark = pytest.mark.uml


@pytest.mark.parametrize("word", ["plain", "a b", "x::y/z"])
def test_runs_in_the_guest(word, record_property):
    record_property("figure", 1.25)
    assert os.environ["STAND_IN"] == "uml"


def test_fails():
    assert "found" == "wanted"


def test_skips():
    pytest.skip("for a reason")
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "stand_in.py").write_text(STAND_IN)
    (tmp_path / "test_it.py").write_text(TESTS)
    return tmp_path


def run(project: Path, *words: str, **variables: str) -> "subprocess.CompletedProcess[str]":
    plugins = ("-p", "sim_bus.guests.pytest_plugin", "-p", "stand_in")
    outside = {k: v for k, v in os.environ.items() if k != "PYTEST_ADDOPTS"}
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-rs", *plugins, *words],
        cwd=project, capture_output=True, text=True, timeout=120, check=False,
        env={**outside, "TMPDIR": str(project), **variables},
    )  # fmt: skip


def test_reports_come_back_one_by_one(project: Path) -> None:
    done = run(project, "-m", "uml", "-v")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "3 passed" in done.stdout
    assert "1 failed" in done.stdout
    assert "1 skipped" in done.stdout
    assert "test_runs_in_the_guest[x::y/z] PASSED" in done.stdout
    assert "'found' == 'wanted'" in done.stdout
    assert "for a reason" in done.stdout
    assert "figure = 1.25" in done.stdout


def test_what_finds_the_tests_is_passed_on(project: Path) -> None:
    # GIVEN tests that only an option, a configuration and a search path on the command line find
    (project / "test_it.py").unlink()
    (project / "conf").mkdir()
    (project / "conf" / "own.ini").write_text("[pytest]\nmarkers = slow: of this file\n")
    (project / "lib").mkdir()
    (project / "lib" / "helper.py").write_text("HERE = 1\n")
    (project / "check_it.py").write_text(
        "import pytest\nimport helper\npytestmark = [pytest.mark.uml, pytest.mark.slow]\n"
        "def test_it(request):\n    assert request.config.inipath.name == 'own.ini'\n"
    )
    # WHEN they run THEN the guest finds them under the same names
    done = run(
        project, "-m", "uml", "-o", "python_files=check_*.py", "-c", "conf/own.ini",
        "--rootdir", ".", "--strict-markers", "check_it.py", PYTHONPATH=str(project / "lib"),
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout


def test_unselected_tier_is_skipped_with_the_way_to_select_it(project: Path) -> None:
    done = run(project)
    assert done.returncode == 0, done.stdout
    assert "5 skipped" in done.stdout
    assert "select it with -m uml" in done.stdout


def test_missing_tier_is_skipped_with_its_remedy(project: Path) -> None:
    done = run(project, "-m", "uml", MISSING="linux.uml not found; apt-get install it")
    assert done.returncode == 0, done.stdout
    assert "5 skipped" in done.stdout
    assert "apt-get install it" in done.stdout


def test_promised_tier_that_is_missing_fails(project: Path) -> None:
    done = run(project, "-m", "uml", "--require= uml", MISSING="linux.uml not found; install it")
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "promised tier 'uml' cannot run here: linux.uml not found" in done.stderr


def test_promised_tier_that_nobody_knows_fails(project: Path) -> None:
    done = run(project, "--require=nonsense")
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "no such tier" in done.stderr
    assert "uml" in done.stderr


def test_guest_that_dies_fails_what_it_did_not_report(project: Path) -> None:
    (project / "test_it.py").write_text(
        "import os, pytest\npytestmark = pytest.mark.uml\n"
        "def test_before(): pass\n"
        "def test_dies(): os._exit(99)\n"
        "def test_after(): pass\n"
    )
    done = run(project, "-m", "uml", "-v")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "test_before PASSED" in done.stdout
    assert "1 passed" in done.stdout
    assert "2 failed" in done.stdout
    assert "Kernel panic" in done.stdout


def test_death_within_the_only_test_is_no_success(project: Path) -> None:
    (project / "test_it.py").write_text(
        "import os, pytest\npytestmark = pytest.mark.uml\ndef test_dies(): os._exit(0)\n"
    )
    done = run(project, "-m", "uml")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "reported no end of this test" in done.stdout


def test_guest_whose_pytest_does_not_start_says_why(project: Path) -> None:
    (project / "conftest.py").write_text(
        "import os\nif 'STAND_IN' in os.environ: raise RuntimeError('no such device here')\n"
    )
    done = run(project, "-m", "uml")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "5 failed" in done.stdout
    assert "pytest in the guest ended with status 4" in done.stdout
    assert "no such device here" in done.stdout
