"""The recipes of CONTRIBUTING.md, followed by a program: diffs applied to a copy of the tree.

A recipe is a section of third level under "Recipes". Its ``diff`` blocks are what a person would
type: a path, hunks without line numbers, and context lines that stand in the file exactly once.
"""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from tests.pages import ROOT, code_blocks, read

NEW_FILE = "/dev/null"


@dataclass(frozen=True)
class Recipe:
    """One section: what it changes, scripts it runs, and tests that show that it worked."""

    name: str
    changes: dict[str, list[list[str]]]
    scripts: list[str]
    tests: list[list[str]]

    def apply(self, tree: Path) -> None:
        """Change a copy of the tree."""
        for path, hunks in self.changes.items():
            place = tree / path
            old = place.read_text("utf-8").splitlines() if place.exists() else None
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text("\n".join(changed(path, old, hunks)) + "\n", "utf-8")


def recipes() -> list[Recipe]:
    """Return every recipe of CONTRIBUTING.md."""
    text = read(Path("CONTRIBUTING.md"))
    (part,) = re.findall(r"^## Recipes\n(.*?)(?=^## |\Z)", text, flags=re.DOTALL | re.MULTILINE)
    sections = re.split(r"^### ", part, flags=re.MULTILINE)[1:]
    return [recipe(section) for section in sections]


def recipe(section: str) -> Recipe:
    """Return one recipe."""
    name = section.splitlines()[0].strip()
    changes: dict[str, list[list[str]]] = {}
    for block in code_blocks(section, "diff"):
        head, *rest = re.split(r"^@@.*\n", block, flags=re.MULTILINE)
        (path,) = re.findall(r"^\+\+\+ (\S+)$", head, flags=re.MULTILINE)
        is_new = f"--- {NEW_FILE}" in head
        if is_new == (ROOT / path).exists():
            msg = f"recipe '{name}': {path} {'exists' if is_new else 'does not exist'}"
            raise ValueError(msg)
        changes.setdefault(path, []).extend(hunk.splitlines() for hunk in rest)
    tests = re.findall(r"`\.venv/bin/python -m pytest ([^`]+)`", section)
    scripts = re.findall(r"`\.venv/bin/python (\S+\.py)`", section)
    return Recipe(name, changes, scripts, [shlex.split(line) for line in tests])


def changed(path: str, old: list[str] | None, hunks: list[list[str]]) -> list[str]:
    """Return a file's lines after the hunks; context must stand there exactly once."""
    lines = [] if old is None else list(old)
    for hunk in hunks:
        before = [line[1:] for line in hunk if not line.startswith("+")]
        after = [line[1:] for line in hunk if not line.startswith("-")]
        places = [i for i in range(len(lines) + 1) if lines[i : i + len(before)] == before]
        if old is not None and len(places) != 1:
            shown = "\n".join(before)
            msg = f"{path}: these lines stand there {len(places)} times, wanted once:\n{shown}"
            raise ValueError(msg)
        at = places[0] if old is not None else len(lines)
        lines[at : at + len(before)] = after
    return lines


def promised() -> dict[str, tuple[int, int]]:
    """Return what the table says: files opened, and the most that is allowed, by recipe."""
    rows = re.findall(
        r"^\| \[([^]]+)\]\([^)]*\) \| (\d+) \| (\d+) \|$",
        read(Path("CONTRIBUTING.md")),
        flags=re.MULTILINE,
    )
    return {name: (int(files), int(most)) for name, files, most in rows}
