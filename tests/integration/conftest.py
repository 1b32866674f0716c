"""The command line as a person or a program calls it, inside this process."""

import contextlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from avionics.cli import main


@dataclass(frozen=True)
class Done:
    """How a command ended."""

    status: int
    out: str
    err: str


Command = Callable[..., Done]


@pytest.fixture
def avionics(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Run `avionics ARGUMENTS` and return exit status, stdout and stderr."""

    def call(*arguments: object) -> Done:
        monkeypatch.setattr(sys, "argv", ["avionics", *(str(a) for a in arguments)])
        status = 0
        try:
            main()
        except SystemExit as stop:
            status = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        captured = capsys.readouterr()
        return Done(status, captured.out, captured.err)

    return call


@pytest.fixture(scope="session")
def short_flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated flight of ten seconds, flown once for all tests."""
    path = tmp_path_factory.mktemp("flight") / "sim.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            sys, "argv", ["avionics", "sim", "--duration", "10", "--seed", "3", "-o", str(path)]
        )
        with contextlib.suppress(SystemExit):
            main()
    assert path.exists(), "the simulated flight failed"
    return path
