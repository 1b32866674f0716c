"""Every recipe of CONTRIBUTING.md works as it stands, and opens no more files than it says."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.compile_proto import compile_records
from tests.pages import ROOT
from tests.recipes import Recipe, promised, recipes

RECIPES = recipes()
# What a task may take; the table of CONTRIBUTING.md may promise less.
MOST = {"imu": 5, "state": 6, "tracker": 3, "topic": 6, "command": 2}
COPIED = ("avionics", "drivers", "sim_bus", "tests", "docs", "firmware", "examples")
IGNORED = shutil.ignore_patterns("__pycache__", "*.mcap", "build", ".*")


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda r: r.name)
def test_recipe_opens_no_more_files_than_it_says(recipe: Recipe) -> None:
    files, most = promised()[recipe.name]
    assert len(recipe.changes) == files <= most
    assert most == next((n for word, n in MOST.items() if word in recipe.name.lower()), most)


@pytest.fixture(scope="module")
def tree(tmp_path_factory) -> Path:
    """A copy of the tree in which every recipe was followed, one after the other."""
    tree = tmp_path_factory.mktemp("recipes")
    for name in COPIED:
        shutil.copytree(ROOT / name, tree / name, ignore=IGNORED)
    for path in (*ROOT.glob("*.toml"), *ROOT.glob("*.md"), ROOT / "Makefile"):
        shutil.copy(path, tree)
    for recipe in RECIPES:
        recipe.apply(tree)
    compile_records(tree)
    assert run(tree, "-c", "import avionics; print(avionics.__file__)").startswith(str(tree))
    for script in sorted({script for recipe in RECIPES for script in recipe.scripts}):
        run(tree, script)
    return tree


def run(tree: Path, *command: str) -> str:
    """Run Python in the copy and return what it printed."""
    done = subprocess.run(
        [sys.executable, *command],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("recipe", RECIPES, ids=lambda r: r.name)
def test_followed_recipe_passes_the_tests_that_it_names(tree: Path, recipe: Recipe) -> None:
    assert recipe.tests
    for arguments in recipe.tests:
        out = run(tree, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments)
        # With -k the thing that was added is what was tested.
        assert " passed" in out


@pytest.mark.slow
def test_all_recipes_followed_pass_the_linter(tree: Path) -> None:
    opened = sorted({p for r in RECIPES for p in r.changes if p.endswith(".py")})
    run(tree, "-m", "ruff", "check", "--no-cache", *opened)
    run(tree, "-m", "ruff", "format", "--no-cache", "--check", *opened)
