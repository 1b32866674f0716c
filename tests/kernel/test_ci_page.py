"""docs/ci.md does what it says: its own test runs in a foreign project through `rig run`."""

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from sim_bus.guests import uml
from sim_bus.guests.uml import APT_LINE, missing

pytestmark = pytest.mark.slow

PAGE = Path(__file__).resolve().parents[2] / "docs" / "ci.md"


def _block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found.group(1)


def test_page_names_the_packages_that_the_tool_names() -> None:
    packages = APT_LINE.removeprefix("apt-get install ")
    assert f"apt-get install -y {packages}" in _block("yaml")


def test_job_runs_where_those_packages_exist() -> None:
    assert "container: debian:" in _block("yaml")  # Ubuntu has no user-mode-linux
    assert "python3-venv" in _block("yaml")  # Debian's image has no Python at all


@pytest.mark.parametrize(
    ("blocks", "flags", "is_used"),
    [
        (1 << 20, 0, True),
        (1 << 20, os.ST_NOEXEC, False),  # Docker's
        (16 << 10, 0, False),  # 64 MiB
    ],
)
def test_guest_memory_is_where_programs_may_run_and_it_has_room(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, blocks: int, flags: int, is_used: bool
) -> None:
    shared = tmp_path / "shm"
    shared.mkdir()
    monkeypatch.setattr(uml, "SHARED_MEMORY", shared)
    found = SimpleNamespace(f_bavail=blocks, f_frsize=4096, f_flag=flags)
    monkeypatch.setattr(os, "statvfs", lambda _: found)
    assert uml.memory_folder(tmp_path, 768) == (shared if is_used else tmp_path)


@pytest.mark.skipif(missing() is not None, reason=f"tier uml: {missing()}")
def test_job_runs_in_a_project_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "test_can.py").write_text(_block("python"), encoding="utf-8")
    command = _block("yaml").strip().splitlines()[-1].split("run: ", 1)[1]
    programs = {
        ".venv/bin/avionics": [sys.executable, "-m", "avionics"],
        ".venv/bin/python": [sys.executable],
    }
    words = [part for word in command.split() for part in programs.get(word, [word])]
    done = subprocess.run(
        words, cwd=tmp_path, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout
