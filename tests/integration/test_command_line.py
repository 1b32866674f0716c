"""The command line's contract: help, exit status, errors in one or two lines, no overwriting."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from avionics.cli.app import app


def commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every command and group, by the words that call it."""
    yield path
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))


COMMANDS = sorted(commands(typer.main.get_command(app)))


def test_command_line_is_complete() -> None:
    assert {("run",), ("rig", "fault", "on"), ("pos", "design")} <= set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_has_help_with_an_example(avionics, command) -> None:
    done = avionics(*command, "--help")
    assert done.status == 0
    assert " ".join(("avionics", *command)) in done.out.split("Example", 1)[1]
    assert "[]" not in done.out  # what is left of brackets that were taken for markup


def wrong(done, status: int, *words: str) -> None:
    assert done.status == status, done
    assert 1 <= len(done.err.strip().splitlines()) <= 3, done.err
    assert "Traceback" not in done.err
    for word in words:
        assert word in done.err, done.err


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("replay",), ("LOG.mcap", "avionics replay --help")),
        (("sim", "--duration", "-1"), ("--duration", "avionics sim --help")),
        (("sim", "--frobnicate"), ("--frobnicate",)),
        (("rig", "nosuch"), ("nosuch", "avionics rig --help")),
        (("rig", "run", "--limit", "0", "--", "true"), ("--limit", "avionics rig run --help")),
    ],
    ids=" ".join,
)
def test_wrong_command_line_is_one_plain_line(avionics, command, words) -> None:
    done = avionics(*command)
    assert len(done.err.strip().splitlines()) == 1
    wrong(done, 2, "avionics: ", *words)


@pytest.mark.parametrize("group", [("rig",), ("rig", "fault"), ("pos",)], ids=" ".join)
def test_group_without_a_command_shows_its_help(avionics, group) -> None:
    done = avionics(*group)
    assert done.status == 2
    assert "Example: avionics " + " ".join(group) in done.out + done.err


def test_unknown_configuration_key_names_file_and_key(avionics, tmp_path: Path) -> None:
    config = tmp_path / "wing.toml"
    config.write_text("[wing]\nspan_m = 1.5\nspann = 2\n")
    wrong(avionics("doctor", config), 1, str(config), "wing.spann")


def test_key_of_a_table_of_several_kinds_is_named_as_it_stands_in_the_file(
    avionics, tmp_path: Path
) -> None:
    config = tmp_path / "wing.toml"
    camera = "f_x_px = 500\nf_y_px = 500\nc_x_px = 320\nc_y_px = 240\n"
    source = 'source = { kind = "gstreamer", pipeline = "videotestsrc", gain = 2 }\n'
    config.write_text(f"[wing]\nspan_m = 1.5\n[camera]\n{camera}{source}", encoding="utf-8")
    done = avionics("run", config)
    wrong(done, 1, f"{config}: key 'camera.source': gain is for the Jetson's own line", "leave it")


def test_missing_configuration_names_the_path(avionics, tmp_path: Path) -> None:
    wrong(avionics("run", tmp_path / "none.toml"), 1, "none.toml")


def test_wrong_override_names_it(avionics) -> None:
    wrong(avionics("sim", "--set", "estimator.gate", "--duration", "1"), 1, "key=value")
    wrong(avionics("sim", "--set", "estimator.from=paper"), 1, "estimator.from")


def test_existing_output_is_refused_with_status_2(avionics, tmp_path: Path) -> None:
    taken = tmp_path / "taken.mcap"
    taken.write_bytes(b"precious")
    wrong(avionics("sim", "--duration", "1", "-o", taken), 2, "--force")
    assert taken.read_bytes() == b"precious"


def test_output_into_a_missing_folder(avionics, tmp_path: Path) -> None:
    wrong(avionics("sim", "--duration", "1", "-o", tmp_path / "no" / "x.mcap"), 1, "no")


@pytest.mark.parametrize("command", ["evaluate", "info", "export", "report"])
def test_missing_log(avionics, tmp_path: Path, command: str) -> None:
    output = () if command in ("evaluate", "info") else ("-o", tmp_path / "out")
    wrong(avionics(command, tmp_path / "none.mcap", *output), 1, "none.mcap")


@pytest.mark.parametrize("command", ["evaluate", "info", "export", "report"])
@pytest.mark.parametrize("content", [b"", b"not a log at all, but text"], ids=["empty", "text"])
def test_foreign_log(avionics, tmp_path: Path, command: str, content: bytes) -> None:
    log = tmp_path / "foreign.mcap"
    log.write_bytes(content)
    output = () if command in ("evaluate", "info") else ("-o", tmp_path / "out")
    wrong(avionics(command, log, *output), 1, "foreign.mcap")


def test_unknown_scenario_lists_the_known_ones(avionics, tmp_path: Path) -> None:
    done = avionics("sim", "--scenario", "hurricane", "-o", tmp_path / "x.mcap")
    wrong(done, 1, "hurricane", "default")


def test_hardware_that_is_not_there(avionics, tmp_path: Path) -> None:
    config = tmp_path / "wing.toml"
    config.write_text(
        '[wing]\nspan_m = 1.5\n[[pods]]\nid = 0\ns_m = 0.6\nlink = { kind = "i2c", bus = 251 }\n'
    )
    wrong(avionics("run", config, "--duration", "1", "-o", tmp_path / "x.mcap"), 1, "i2c-251")
    done = avionics("doctor", config)
    assert done.status == 1
    assert "i2c-251" in done.out
