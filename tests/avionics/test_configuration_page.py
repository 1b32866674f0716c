"""docs/configuration.md is what the types say."""

import importlib.util
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_page_is_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location("maker", DOCS / "make_configuration.py")
    assert spec is not None
    assert spec.loader is not None
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    written = (DOCS / "configuration.md").read_text(encoding="utf-8")
    assert written == maker.page(), "run: python docs/make_configuration.py"


def test_every_key_is_described() -> None:
    page = (DOCS / "configuration.md").read_text(encoding="utf-8")
    bare = [line for line in page.splitlines() if line.startswith("| `") and line.endswith("|  |")]
    assert not bare
