"""A flight computer: a plain install, without the libraries of the desk."""

import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, requires
from pathlib import Path

import pytest

from avionics.desk import LIBRARIES

pytestmark = pytest.mark.slow

NEVER = LIBRARIES | {"filterpy", "cantools"}
CALL = (
    f"import sys; sys.modules.update(dict.fromkeys({sorted(NEVER)}))\n"
    "sys.argv[0] = 'avionics'\nfrom avionics.cli import main\nmain()"
)


def on_a_board(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a command where the libraries of the desk cannot be imported."""
    return subprocess.run(
        [sys.executable, "-c", CALL, *map(str, arguments)],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


def test_plain_install_brings_none_of_them_not_even_through_others() -> None:
    wanted, seen = ["wing-avionics"], set()
    while wanted:
        name = wanted.pop()
        if name in seen:
            continue
        seen.add(name)
        try:
            lines = requires(name) or []
        except PackageNotFoundError:  # wanted by another Python or system
            continue
        plain = [line for line in lines if "extra ==" not in line]
        wanted += [re.split(r"[^\w.-]", line)[0].lower() for line in plain]
    assert {"numpy", "scipy", "pydantic"} <= seen
    assert not seen & NEVER


@pytest.mark.parametrize(
    "command",
    [
        ("info", "LOG"),
        ("evaluate", "LOG"),
        ("replay", "LOG", "--no-images", "-o", "OUT.mcap"),
        ("export", "LOG", "-o", "OUT"),
        ("recover", "LOG", "-o", "OUT.mcap"),
        ("rig", "doctor"),
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_what_a_board_does_works_without_the_desk(command, short_flight, tmp_path: Path) -> None:
    files = {"LOG": short_flight, "OUT.mcap": tmp_path / "out.mcap", "OUT": tmp_path / "out"}
    done = on_a_board(*(files.get(word, word) for word in command))
    assert done.returncode == 0 or command[0] == "rig", done.stderr  # a tier may be missing
    assert done.stderr == ""


@pytest.mark.parametrize("command", ["run", "doctor"])
def test_flying_fails_by_its_hardware_alone(command: str, tmp_path: Path) -> None:
    config = tmp_path / "wing.toml"
    link = f'link = {{ kind = "uart", port = "{tmp_path}/tty" }}'
    config.write_text(f"[wing]\nspan_m = 1.5\n[[pods]]\nid = 0\ns_m = 0.6\n{link}\n")
    done = on_a_board(command, config)
    assert done.returncode == 1
    assert "does not" in (done.stderr if command == "run" else done.stdout)
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("command", "library"),
    [
        (("sim", "--duration", "1", "-o", "OUT"), "numba"),
        (("rig", "serve", "default", "--uart", "-o", "OUT"), "numba"),
        (("report", "LOG", "-o", "OUT"), "matplotlib"),
        (("export", "LOG", "--format", "parquet", "-o", "OUT"), "pyarrow"),
        (("pos", "run", "gong-table2", "-o", "OUT"), "matplotlib"),
        (("pos", "design", "wing-nodes", "-o", "OUT"), "matplotlib"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, tuple) else value,
)
def test_what_needs_the_desk_says_so_in_one_line(
    command, library, short_flight, tmp_path: Path
) -> None:
    files = {"LOG": short_flight, "OUT": tmp_path / "out"}
    done = on_a_board(*(files.get(word, word) for word in command))
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert f'needs {library}: pip install "wing-avionics[desk]"' in line
    assert not files["OUT"].exists()
