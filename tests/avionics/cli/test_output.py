"""What a command reads, and what it shows while it works."""

import sys
from pathlib import Path

import pytest

from avionics.cli import output
from avionics.cli.output import progress_bar, read_log_path
from avionics.errors import AvionicsError


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
