"""What the documentation site needs beyond its pages: the root's pages, sources, equations.

README, CONTRIBUTING, CHANGELOG and the figures live where a repository has them and are pages here
too. A link to a source file leads to a copy of it in the site. Equations become MathML when the
site is built, so that a page loads no script for them.
"""

import html
import posixpath
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
# Pages outside docs/, and what they are called in the site.
ROOT_PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "benchmarks/RESULTS.md": "results.md",
    "examples/README.md": "examples.md",
}
LINK = re.compile(r"(\]\()([^)\s#]+)(#[^)\s]*)?(\))")
EQUATION = re.compile(
    r'<(span|div) class="arithmatex">\s*\\([(\[])(.*?)\\[)\]]\s*</\1>', flags=re.DOTALL
)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the root's pages and every source that a page links to."""
    for source, name in ROOT_PAGES.items():
        files.append(File.generated(config, name, content=(ROOT / source).read_text("utf-8")))
    for file in list(files.documentation_pages()):
        for target in LINK.finditer(_without_code(file.content_string)):
            _add_source(files, config, file.src_uri, target[2])
    return files


def _add_source(files: Files, config: MkDocsConfig, page: str, target: str) -> None:
    path = _in_repository(page, target)
    if path is None or path in ROOT_PAGES or path.startswith("docs/"):
        return
    name = _site_name(path)
    if (ROOT / path).is_file() and files.get_file_from_path(name) is None:
        files.append(File.generated(config, name, abs_src_path=str(ROOT / path)))


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Point links at the places that their targets have in the site."""
    here = page.file.src_uri

    def moved(link: re.Match[str]) -> str:
        path = _in_repository(here, link[2])
        if path is None:
            return link[0]
        place = posixpath.relpath(_site_name(path), posixpath.dirname(here) or ".")
        return f"{link[1]}{place}{link[3] or ''}{link[4]}"

    return LINK.sub(moved, markdown)


def on_page_content(html_text: str, **_: Any) -> str:
    """Turn equations into MathML."""

    def rendered(equation: re.Match[str]) -> str:
        display = "inline" if equation[2] == "(" else "block"
        return convert(html.unescape(equation[3]), display=display)

    return EQUATION.sub(rendered, html_text)


def _in_repository(page: str, target: str) -> str | None:
    """Return where a page's link leads in the repository; None for what is no file there."""
    if "://" in target or target.startswith("mailto:"):
        return None
    sources = {name: source for source, name in ROOT_PAGES.items()}
    folder = posixpath.dirname(sources.get(page, f"docs/{page}"))
    path = posixpath.normpath(posixpath.join(folder, target))
    return path if (ROOT / path).exists() else None


def _site_name(path: str) -> str:
    """Return the name in the site of a file of the repository."""
    if path in ROOT_PAGES:
        return ROOT_PAGES[path]
    return path.removeprefix("docs/") if path.startswith("docs/") else f"source/{path}.txt"


def _without_code(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
