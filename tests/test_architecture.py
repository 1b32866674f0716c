"""The import rule: drivers <- avionics <- sim_bus, mathematics pure, no circles."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("drivers", "avionics", "sim_bus")
PURE = ("avionics/wse", "avionics/pos", "avionics/calibration")
# Files, tables and pages of studies stand beside the filters they run.
STUDIES = "avionics.pos.study"
PURE_FOREIGN = {"numpy", "scipy", "cv2"}
PURE_OURS = (
    "avionics.errors",
    "avionics.records",
    "avionics.config",
    "avionics.wse",
    "avionics.calibration",
    "avionics.pos",
)
STDLIB_FORBIDDEN = {"time", "threading", "socket", "asyncio", "multiprocessing", "random"}


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
            assert node.level == 0, f"{path}: relative import"
            base = node.module or ""
            names.update(
                f"{base}.{alias.name}" if f"{base}.{alias.name}" in MODULES else base
                for alias in node.names
            )
    return names


def top(name: str) -> str:
    return name.split(".", maxsplit=1)[0]


@pytest.mark.parametrize("name", [n for n in MODULES if top(n) == "drivers"])
def test_drivers_know_nothing_above_them(name: str) -> None:
    assert {top(i) for i in imports(MODULES[name])}.isdisjoint({"avionics", "sim_bus"})


@pytest.mark.parametrize("name", [n for n in MODULES if top(n) == "avionics"])
def test_only_the_command_line_knows_the_simulator(name: str) -> None:
    if name.startswith("avionics.cli"):
        return
    assert "sim_bus" not in {top(i) for i in imports(MODULES[name])}


@pytest.mark.parametrize(
    "name",
    [
        n
        for n, p in MODULES.items()
        if p.relative_to(ROOT).as_posix().startswith(PURE) and not n.startswith(STUDIES)
    ],
)
def test_mathematics_is_pure(name: str) -> None:
    allowed = PURE_FOREIGN | ({"numba"} if name.startswith("avionics.pos") else set())
    for imported in imports(MODULES[name]):
        if top(imported) in PACKAGES:
            assert imported.startswith(PURE_OURS), f"{name} imports {imported}"
            continue
        is_stdlib = top(imported) not in FOREIGN_TOPS
        assert top(imported) in allowed or is_stdlib, f"{name} imports {imported}"
        assert top(imported) not in STDLIB_FORBIDDEN, f"{name} imports {imported}"


FOREIGN_TOPS = {
    "can",
    "cantools",
    "cv2",
    "filterpy",
    "google",
    "matplotlib",
    "mcap",
    "numba",
    "numpy",
    "pyarrow",
    "pydantic",
    "rich",
    "scipy",
    "serial",
    "smbus2",
    "typer",
    "yaml",
}


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
        and not n.endswith("_pb2")
    }
    assert not long, f"split by responsibility: {long}"
