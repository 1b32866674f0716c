"""What a command may write, and what it shows while it works."""

import sys
from pathlib import Path

import pytest

from avionics.cli import output
from avionics.cli.output import claim, progress_bar, read_log_path
from avionics.errors import AvionicsError, OutputExistsError


def test_new_file_in_a_folder_may_be_written(tmp_path: Path) -> None:
    path = tmp_path / "new.mcap"
    assert claim(path, force=False) == path
    assert not path.exists()


def test_existing_file_wants_force(tmp_path: Path) -> None:
    path = tmp_path / "old.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(OutputExistsError, match=r"old\.mcap exists; .*--force"):
        claim(path, force=False)
    assert claim(path, force=True) == path
    assert path.read_bytes() == b"precious"


@pytest.mark.parametrize("force", [False, True])
def test_folder_is_no_file_and_a_missing_folder_is_named(tmp_path: Path, force: bool) -> None:
    with pytest.raises(AvionicsError, match="is a folder"):
        claim(tmp_path, force=force)
    with pytest.raises(AvionicsError, match="nowhere is not a folder"):
        claim(tmp_path / "nowhere" / "x.mcap", force=force)


def test_log_to_read_is_a_file(tmp_path: Path) -> None:
    with pytest.raises(AvionicsError, match=r"none\.mcap: no such log"):
        read_log_path(tmp_path / "none.mcap")
    with pytest.raises(AvionicsError, match="no such log"):
        read_log_path(tmp_path)
    (tmp_path / "log.mcap").touch()
    assert read_log_path(tmp_path / "log.mcap") == tmp_path / "log.mcap"


@pytest.mark.parametrize("total", [None, 10.0])
def test_progress_shows_on_a_terminal_only_and_not_at_once(monkeypatch, capsys, total) -> None:
    now_s = [100.0]
    monkeypatch.setattr(output.time, "monotonic", lambda: now_s[0])
    with progress_bar("flying", total) as progress:
        now_s[0] += 10.0
        progress(1.0)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with progress_bar("flying", total) as progress:
        progress(1.0)
        assert capsys.readouterr().err == ""
        now_s[0] += 10.0
        progress(2.0)
    assert "flying" in capsys.readouterr().err
