"""The firmware's core as a library: where it is kept, and what happens without a cache."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sim_bus.buses import pod_library
from sim_bus.buses.pod_library import build_library

pytestmark = pytest.mark.slow


def test_library_is_kept_in_the_users_cache(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(pod_library, "_build_folder", pod_library._build_folder.__wrapped__)
    library = build_library()
    assert library.parent == tmp_path / "wing-avionics" / "pod"
    made_at = library.stat().st_mtime_ns
    assert build_library() == library
    assert library.stat().st_mtime_ns == made_at
    assert [path.name for path in library.parent.iterdir()] == [library.name]


def test_without_a_cache_it_is_built_for_the_process_alone(tmp_path: Path) -> None:
    nowhere, temporary = tmp_path / "file", tmp_path / "tmp"
    nowhere.touch()
    temporary.mkdir()
    code = "from sim_bus.buses.pod_library import *; print(load_library(), build_library())"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "XDG_CACHE_HOME": str(nowhere), "TMPDIR": str(temporary)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert str(temporary) in done.stdout
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert not list(temporary.iterdir())
