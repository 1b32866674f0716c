"""What a newcomer meets first: links that lead somewhere, steps that exist, one version."""

import importlib.util
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from avionics.cli.app import app
from tests.pages import PAGES, ROOT, code_places, link_targets, place_exists, read

EXTERNAL = ("http://", "https://", "mailto:")


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_links_of_a_page_lead_somewhere(page: Path) -> None:
    broken = []
    for target in link_targets(read(page)):
        if target.startswith(EXTERNAL):
            continue
        path, _, anchor = target.partition("#")
        place = (ROOT / page).parent / path if path else ROOT / page
        if not place.exists() or (anchor and anchor not in anchors(place.read_text("utf-8"))):
            broken.append(target)
    assert not broken


def anchors(text: str) -> set[str]:
    """The anchors that GitHub gives to a page's headings."""
    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


def test_workflow_runs_every_step_of_ci_and_no_other() -> None:
    steps = re.findall(r"^make (.+)$", read(Path(".ci/run")), flags=re.MULTILINE)
    workflow = yaml.safe_load(read(Path(".github/workflows/ci.yml")))
    (job,) = workflow["jobs"].values()
    assert job["strategy"]["matrix"]["target"] == steps
    assert {"run": "make ${{ matrix.target }}"} in job["steps"]


def test_issue_forms_are_complete() -> None:
    forms = sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml"))
    for form in (f for f in forms if f.name != "config.yml"):
        content = yaml.safe_load(form.read_text("utf-8"))
        assert {"name", "description", "body"} <= set(content), form
        asked = [item for item in content["body"] if item["type"] != "markdown"]
        assert len({item["id"] for item in asked}) == len(asked), form


def test_one_version_everywhere() -> None:
    (version,) = re.findall(r'^version = "(.+)"$', read(Path("pyproject.toml")), flags=re.MULTILINE)
    cited = yaml.safe_load(read(Path("CITATION.cff")))
    assert cited["version"] == version
    assert str(cited["date-released"]) in read(Path("CHANGELOG.md"))
    assert version in read(Path("CHANGELOG.md"))


@pytest.mark.parametrize("page", [p for p in PAGES if code_places(read(p))], ids=str)
def test_places_that_a_page_names_are_in_the_code(page: Path) -> None:
    assert [p for p in code_places(read(page)) if not place_exists(p)] == []


def test_method_names_the_place_of_every_equation_of_the_paper() -> None:
    """Each section with a displayed equation lists where it stands."""
    sections = re.split(r"^#{2,3} ", read(Path("docs/method.md")), flags=re.MULTILINE)
    with_equations = [s for s in sections if "```math" in s]
    assert len(with_equations) >= 6
    assert [s.splitlines()[0] for s in with_equations if not code_places(s)] == []


def test_picture_of_the_wing_is_drawn_from_the_packaged_configuration(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("picture", ROOT / "docs/make_wing_picture.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.main(tmp_path / "wing.svg")
    assert (tmp_path / "wing.svg").read_text("utf-8").count("<path") > 50


def command_lines(text: str) -> list[list[str]]:
    """The words of every `avionics` command line in a page's blocks, comments left out."""
    fenced = re.findall(r"^```\w*\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    lines = "\n".join([*fenced, *re.findall(r"^ {4}(.+)$", text, flags=re.MULTILINE)])
    found = re.findall(r"^\s*(?:\S*bin/)?avionics ((?:[^\n\\#]|\\\n)+)", lines, flags=re.MULTILINE)
    return [shlex.split(line.replace("\\\n", " ").rstrip(" &")) for line in found]


@pytest.mark.parametrize("page", [p for p in PAGES if command_lines(read(p))], ids=str)
def test_command_lines_of_a_page_exist_with_their_options(page: Path) -> None:
    for words in command_lines(read(page)):
        command: Any = typer.main.get_command(app)
        rest = list(words)
        while rest and rest[0] in getattr(command, "commands", {}):
            command = command.commands[rest.pop(0)]
        assert not hasattr(command, "commands"), f"no such command: avionics {' '.join(words)}"
        mine = rest[: rest.index("--")] if "--" in rest else rest
        known = {name for p in command.params for name in (*p.opts, *p.secondary_opts)} | {"--help"}
        unknown = {w for w in mine if re.match(r"--?[a-z]", w)} - known
        assert not unknown, f"avionics {' '.join(words)}: {unknown}"
