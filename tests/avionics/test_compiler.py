"""Compiled functions are kept in the user's cache, follow every source, and do without a cache."""

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("numba")

from avionics import compiler

pytestmark = pytest.mark.slow

PACKAGE = {
    "__init__.py": (
        "from pathlib import Path\n"
        "from avionics.compiler import cached_compiler\n"
        "compiled = cached_compiler('wing', Path(__file__).parent.glob('*.py'))\n"
    ),
    "inner.py": "from wing import compiled\n@compiled\ndef inner(x):\n    return x + 1.0\n",
    "outer.py": (
        "from wing import compiled\nfrom wing.inner import inner\n"
        "@compiled\ndef outer(x):\n    return 2.0 * inner(x)\n"
    ),
}
CALL = (
    "from wing.outer import outer\nvalue = outer(3.0)\n"
    "print(value, sum(outer.stats.cache_hits.values()))"
)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "wing"
    folder.mkdir()
    for name, text in PACKAGE.items():
        (folder / name).write_text(text)
    return folder


def call(package: Path, **environment: str) -> tuple[float, int, str]:
    """Return the value, how many functions came out of the cache, and what was said."""
    done = subprocess.run(
        [sys.executable, "-B", "-c", CALL],
        env={**os.environ, "PYTHONPATH": f"{package.parent}:{Path.cwd()}", **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    value, hits = done.stdout.split()
    return float(value), int(hits), done.stderr


def test_second_process_finds_the_machine_code_in_the_cache(package, tmp_path: Path) -> None:
    home = str(tmp_path / "cache")
    assert call(package, XDG_CACHE_HOME=home) == (8.0, 0, "")
    assert call(package, XDG_CACHE_HOME=home) == (8.0, 1, "")
    assert list(Path(home).rglob("wing-avionics/compiled/wing-*/**/*.nbc"))
    assert sorted(path.name for path in package.iterdir()) == sorted(PACKAGE)


def test_change_of_a_called_function_is_seen(package: Path, tmp_path: Path) -> None:
    home = str(tmp_path / "cache")
    assert call(package, XDG_CACHE_HOME=home)[0] == 8.0
    (package / "inner.py").write_text(PACKAGE["inner.py"].replace("1.0", "5.0"))
    assert call(package, XDG_CACHE_HOME=home)[0] == 16.0


def test_numbas_own_setting_of_the_folder_is_kept(package: Path, tmp_path: Path) -> None:
    place = tmp_path / "elsewhere"
    call(package, NUMBA_CACHE_DIR=str(place), XDG_CACHE_HOME=str(tmp_path / "unused"))
    assert list(place.rglob("*.nbc"))
    assert not (tmp_path / "unused").exists()


def test_without_a_cache_it_compiles_and_warns_once(package: Path, tmp_path: Path) -> None:
    nowhere = tmp_path / "file"
    nowhere.touch()
    value, hits, said = call(package, HOME=str(nowhere), XDG_CACHE_HOME="")
    assert (value, hits) == (8.0, 0)
    assert len(said.splitlines()) == 1
    assert str(nowhere) in said


def test_file_cut_off_in_the_cache_is_made_again(package: Path, tmp_path: Path) -> None:
    home = str(tmp_path / "cache")
    call(package, XDG_CACHE_HOME=home)
    for kind in ("*.nbc", "*.nbi"):
        for path in Path(home).rglob(kind):
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        assert call(package, XDG_CACHE_HOME=home) == (8.0, 0, "")
    assert call(package, XDG_CACHE_HOME=home) == (8.0, 1, "")


def test_index_is_written_while_no_other_process_may(monkeypatch, tmp_path: Path) -> None:
    """Two that read and write it at once could make it name the other's machine code."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    written_in_lock = []

    @contextmanager
    def watched(folder: Path):
        yield
        written_in_lock.extend(path.suffix for path in folder.iterdir())

    monkeypatch.setattr(compiler, "locked", watched)

    @compiler.cached_compiler("test", [Path(__file__)])
    def double(x):
        return 2.0 * x

    assert double(2.0) == 4.0
    assert sorted(written_in_lock) == [".nbc", ".nbi"]
