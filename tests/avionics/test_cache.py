"""Where the user's cache lies, and what happens where it cannot be written."""

import threading
from pathlib import Path

import pytest

from avionics.cache import cache_folder, cache_path, locked


def test_cache_lies_in_the_folder_that_the_user_names(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = cache_folder("compiled/x")
    assert folder == tmp_path / "wing-avionics" / "compiled" / "x"
    assert folder.is_dir()
    assert not list(folder.iterdir())


@pytest.mark.parametrize("named", [None, "", "relative/cache"])
def test_without_a_proper_name_it_lies_in_the_home_folder(monkeypatch, tmp_path, named) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if named is not None:
        monkeypatch.setenv("XDG_CACHE_HOME", named)
    assert cache_path("pod") == tmp_path / ".cache" / "wing-avionics" / "pod"


def test_no_place_to_write_is_one_warning_and_no_folder(monkeypatch, tmp_path, caplog) -> None:
    (tmp_path / "file").touch()  # root may write everywhere but below a file
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert cache_folder("compiled") is None
    assert cache_folder("compiled") is None
    (warning,) = caplog.records
    assert str(tmp_path / "file") in warning.getMessage()
    assert "XDG_CACHE_HOME" in warning.getMessage()


def test_lock_keeps_another_out_until_it_is_released(tmp_path: Path) -> None:
    is_in = threading.Event()

    def enter() -> None:
        with locked(tmp_path):
            is_in.set()

    other = threading.Thread(target=enter)
    with locked(tmp_path):
        other.start()
        assert not is_in.wait(0.05)
    other.join(10.0)
    assert is_in.is_set()
