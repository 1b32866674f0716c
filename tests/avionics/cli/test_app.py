"""How an error reaches the person at the terminal: one line on stderr and an exit status."""

import sys
from collections.abc import Callable

import pytest
import typer

from avionics.cli.app import app as cli
from avionics.errors import ConfigError, OutputExistsError, RecordingError, StorageError
from drivers.errors import BusTimeoutError, DeviceNotFoundError

MODULE = sys.modules["avionics.cli.app"]


@pytest.fixture
def run(monkeypatch, capsys) -> Callable[[object], tuple[int, str]]:
    """Run `main` with commands that end in some way; return status and stderr."""

    def call(ending: object) -> tuple[int, str]:
        def commands(*, standalone_mode: bool) -> object:
            assert not standalone_mode
            if isinstance(ending, BaseException):
                raise ending
            return ending

        monkeypatch.setattr(MODULE, "app", commands)
        with pytest.raises(SystemExit) as stop:
            MODULE.main()
        code = stop.value.code
        return (0 if code is None else int(code)), capsys.readouterr().err

    return call


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (ConfigError("wing.toml: unknown key 'a'"), 1, "wing.toml: unknown key 'a'"),
        (RecordingError("x.mcap: is no log"), 1, "x.mcap: is no log"),
        (StorageError("disk is full"), 1, "disk is full"),
        (OutputExistsError("x.mcap exists"), 2, "x.mcap exists"),
        (DeviceNotFoundError("/dev/i2c-1 does not exist"), 1, "/dev/i2c-1 does not exist"),
        (BusTimeoutError("pod 1: no answer"), 1, "pod 1: no answer"),
        (PermissionError(13, "Permission denied", "out.csv"), 1, "out.csv: Permission denied"),
        (OSError("no number"), 1, "no number"),
        (typer.Abort(), 130, "interrupted"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (typer.BadParameter("wants a number"), 2, "wants a number; see avionics --help"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_error_is_one_line_and_a_status(run, error, status: int, line: str) -> None:
    code, said = run(error)
    assert code == status
    assert said.startswith("avionics: ")
    assert said.endswith(f"{line}\n")
    assert said.count("\n") == 1


def test_success_and_a_commands_own_status_pass_through(run) -> None:
    assert run(None) == (0, "")
    assert run(1) == (1, "")
    assert run(130) == (130, "avionics: interrupted\n")


def test_fault_of_the_program_is_not_hidden(monkeypatch) -> None:
    def commands(*, standalone_mode: bool) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(MODULE, "app", commands)
    with pytest.raises(ZeroDivisionError):
        MODULE.main()


def test_every_command_stands_under_a_heading_of_the_help() -> None:
    assert {one.rich_help_panel for one in cli.registered_commands} == {
        "Fly", "Work with logs and data sets",
    }  # fmt: skip
    assert {one.rich_help_panel for one in cli.registered_groups} == {"Test and study"}
