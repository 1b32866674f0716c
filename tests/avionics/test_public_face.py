"""What ``import avionics`` offers: each name once, documented, and loaded when it is used."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import avionics


@pytest.mark.parametrize("name", avionics.__all__)
def test_every_name_is_there_and_documented(name: str) -> None:
    value = getattr(avionics, name)
    assert value.__name__ == name
    assert len(inspect.getdoc(value) or "") > 20
    assert f"``{name}``" in (avionics.__doc__ or "")


def test_nothing_else_is_public() -> None:
    assert dir(avionics) == sorted(avionics.__all__)
    assert not hasattr(avionics, "read_log")
    with pytest.raises(AttributeError, match="offers Config, Flight, LogReader"):
        _ = avionics.read_log


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(avionics.__file__).read_text(encoding="utf-8"))
    branch = next(node for node in tree.body if isinstance(node, ast.If))
    imported = [alias.name for node in branch.body for alias in node.names]  # type: ignore[attr-defined]
    places = {alias.name: node.module for node in branch.body for alias in node.names}  # type: ignore[attr-defined]
    assert sorted(imported) == sorted(avionics.__all__)
    assert places == avionics._PLACES


def test_importing_the_package_loads_nothing_else() -> None:
    code = "import sys; old = set(sys.modules); import avionics; print(*set(sys.modules) - old)"
    answer = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout.split()
    assert {name for name in answer if name.partition(".")[0] not in sys.stdlib_module_names} == {
        "avionics"
    }
