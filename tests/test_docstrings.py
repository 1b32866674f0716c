"""What a docstring lists is what the code has: fields of a class, arguments of a call."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MODULES = [
    path
    for package in ("avionics", "drivers", "sim_bus")
    for path in sorted((ROOT / package).rglob("*.py"))
    if not path.name.endswith("_pb2.py")
]
Call = ast.FunctionDef | ast.AsyncFunctionDef


def listed(node: ast.ClassDef | Call, section: str) -> set[str] | None:
    """Return the names in a section of a numpydoc docstring, None if it has no such section."""
    lines = (ast.get_docstring(node) or "").splitlines()
    heads = [i - 1 for i, line in enumerate(lines) if re.fullmatch("-{3,}", line)]
    for k, i in enumerate(heads):
        if lines[i] == section:
            end = heads[k + 1] if k + 1 < len(heads) else len(lines)
            names = [line.split(" : ")[0] for line in lines[i + 2 : end] if line[:1].strip()]
            return {name.strip(" *") for line in names for name in line.split(",")}
    return None


def arguments(call: Call) -> set[str]:
    spec = call.args
    every = [*spec.posonlyargs, *spec.args, *spec.kwonlyargs, spec.vararg, spec.kwarg]
    return {one.arg for one in every if one is not None} - {"self", "cls"}


def members(cls: ast.ClassDef) -> set[str]:
    """Return fields, properties and whatever methods assign to ``self``."""
    names = {node.name for node in cls.body if isinstance(node, Call)}
    names |= {n.id for node in cls.body for n in ast.walk(node) if isinstance(n, ast.Name)}
    return names | {n.attr for n in ast.walk(cls) if isinstance(n, ast.Attribute)}


def fields(cls: ast.ClassDef) -> set[str]:
    """Return the public fields of a dataclass."""
    if not any("dataclass" in ast.unparse(one) for one in cls.decorator_list):
        return set()
    targets = [node.target for node in cls.body if isinstance(node, ast.AnnAssign)]
    names = {target.id for target in targets if isinstance(target, ast.Name)}
    return {name for name in names if not name.startswith("_")}


def differences(tree: ast.Module) -> Iterator[str]:
    # What all classes of a module have in common may stand in the docstring of the module.
    common = set(re.findall(r"``(\w+)``", ast.get_docstring(tree) or ""))
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and (names := listed(node, "Attributes")) is not None:
            wrong = (names - members(node)) | (fields(node) - names - common)
            yield from (f"{node.name}: attribute {name}" for name in wrong)
        made = node
        if isinstance(node, ast.ClassDef):
            calls = [one for one in node.body if isinstance(one, Call)]
            made = next((one for one in calls if one.name == "__init__"), None)
        if isinstance(made, Call) and (names := listed(node, "Parameters")) is not None:
            wrong = names ^ arguments(made)
            yield from (f"{node.name}: parameter {name}" for name in wrong)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_docstrings_list_what_is_there(path: Path) -> None:
    assert not list(differences(ast.parse(path.read_text(encoding="utf-8"))))


def test_stale_docstring_is_found() -> None:
    code = (
        "@dataclass\nclass A:\n    '''A.\n\n    Attributes\n    ----------\n    gone : int\n"
        "        G.\n    '''\n    new: int\n"
        "def f(x, y):\n    '''F.\n\n    Parameters\n    ----------\n    x, z : int\n"
        "        X.\n    '''\n"
    )
    found = {"A: attribute gone", "A: attribute new", "f: parameter y", "f: parameter z"}
    assert set(differences(ast.parse(code))) == found
