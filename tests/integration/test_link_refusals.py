"""The four commands that open pods accept and refuse the same files, with the same words."""

import pytest

from tests.avionics.config.test_link_checks import ACCEPTED, REFUSED

pytestmark = pytest.mark.slow

COMMANDS = {
    "run": ("run", "{file}"),
    "sim": ("sim", "{file}"),
    "doctor": ("doctor", "{file}"),
    "rig serve": ("rig", "serve", "default", "{file}", "--uart"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_every_command_refuses_a_file_with_the_same_words(
    avionics, tmp_path, monkeypatch, name
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "wing.toml"
    path.write_text(REFUSED[name][0], encoding="utf-8")
    said = set()
    for command in COMMANDS.values():
        done = avionics(*(part.format(file=path) for part in command))
        assert done.status == 1, done
        said.add(done.err)
    assert len(said) == 1, said
    (words,) = said
    assert words.startswith(f"avionics: {path}: ")
    assert len(words.splitlines()) == 1


@pytest.mark.parametrize("command", ["run", "doctor"])
@pytest.mark.parametrize("name", ["two multiplexers", "two lines", "own rates on CAN"])
def test_what_is_accepted_gets_as_far_as_the_devices(
    avionics, tmp_path, monkeypatch, name, command
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "wing.toml"
    path.write_text(ACCEPTED[name].replace("can0", "nosuch0"), encoding="utf-8")
    done = avionics(command, path)
    assert done.status == 1
    assert str(path) not in done.err
    said = done.err + done.out
    assert any(device in said for device in ("i2c", "ttyNONE", "nosuch0"))
