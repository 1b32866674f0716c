"""The written pages of the project, for the tests that hold them true."""

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
