"""The written pages of the project, for the tests that hold them true."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(
    path.relative_to(ROOT)
    for pattern in ("*.md", "docs/**/*.md", "benchmarks/*.md", "examples/*.md")
    for path in ROOT.glob(pattern)
)


def read(page: Path) -> str:
    """Return a page's text."""
    return (ROOT / page).read_text(encoding="utf-8")


def link_targets(text: str) -> list[str]:
    """Return where the links and pictures of a page lead, code left out."""
    prose = re.sub(
        r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    )
    return re.findall(r"\]\(([^)\s]+)\)", prose)


def code_blocks(text: str, language: str) -> list[str]:
    """Return the fenced code blocks of one language."""
    found = re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    return list(found)


def code_places(text: str) -> list[str]:
    """Return the places in the code that a page names, written ``folder/file.py::name``."""
    return re.findall(r"`([\w/]+\.py::[\w.]+)`", text)


def place_exists(place: str) -> bool:
    """Return whether a file defines a function, a class, a method of one, or a constant."""
    path, _, name = place.partition("::")
    if not (ROOT / path).exists():
        return False
    scope = ast.parse((ROOT / path).read_text(encoding="utf-8")).body
    for part in name.split("."):
        found = [node for node in scope if part in _defined(node)]
        if not found:
            return False
        scope = getattr(found[0], "body", [])
    return True


def _defined(node: ast.stmt) -> set[str]:
    if isinstance(node, ast.Assign):
        return {target.id for target in node.targets if isinstance(target, ast.Name)}
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        return {node.target.id}
    return {str(getattr(node, "name", ""))}
