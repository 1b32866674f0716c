"""What import contracts do not say: no circles, short modules; and that the contracts are full."""

import ast
import re
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("drivers", "avionics", "sim_bus")
PURE = {"calibration", "pos", "wse"}
PURE_FOREIGN = {"cv2", "numba", "numpy", "scipy"}
# No driver, log or clock behind them; the errors of data sets are raised by the calibration;
# compiler.py and cache.py make and keep the machine code of the filters.
HARMLESS = PURE | {"cache", "compiler", "errors"}


def modules() -> dict[str, Path]:
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = path
    return found


MODULES = modules()


def imports(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            names.update(
                f"{base}.{alias.name}" if f"{base}.{alias.name}" in MODULES else base
                for alias in node.names
            )
    return names


def contract(name: str) -> dict[str, list[str]]:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (found,) = (c for c in settings["tool"]["importlinter"]["contracts"] if name in c["name"])
    return dict(found)


def test_contract_of_pure_mathematics_forbids_every_other_folder() -> None:
    ours = {name.split(".")[1] for name in MODULES if re.match(r"avionics\.[a-z]", name)}
    wanted = {f"avionics.{name}" for name in ours - HARMLESS} | {"drivers"}
    assert wanted <= set(contract("mathematics is pure")["forbidden_modules"])


def test_contract_of_pure_mathematics_forbids_every_other_library() -> None:
    tops = {i.split(".")[0] for path in MODULES.values() for i in imports(path)}
    foreign = tops - set(sys.stdlib_module_names) - set(PACKAGES) - PURE_FOREIGN - {"tomli", ""}
    assert foreign <= set(contract("mathematics is pure")["forbidden_modules"])


def test_no_circular_imports() -> None:
    graph = {n: {i for i in imports(p) if i in MODULES and i != n} for n, p in MODULES.items()}
    done: set[str] = set()
    path: list[str] = []

    def visit(name: str) -> None:
        if name in done:
            return
        assert name not in path, " -> ".join([*path[path.index(name) :], name])
        path.append(name)
        for target in sorted(graph[name]):
            visit(target)
        path.pop()
        done.add(name)

    for name in sorted(graph):
        visit(name)


def test_modules_stay_short() -> None:
    long = {
        n: count
        for n, p in MODULES.items()
        if (count := len(p.read_text(encoding="utf-8").splitlines())) > 320
        and not re.search(r"_pb2$", n)
    }
    assert not long, f"split by responsibility: {long}"
