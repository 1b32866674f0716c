"""Words of the command line that become numbers, names and folders."""

from pathlib import Path

import pytest

from avionics.cli.configuration import given_or_packaged
from avionics.cli.faults import ask_bench, numbers
from avionics.cli.pos import _choice, _seeds
from avionics.errors import AvionicsError, ConfigError
from drivers.errors import DriverError


def test_numbers_with_commas() -> None:
    assert numbers("0, 2,2") == {0, 2}
    assert numbers("") == frozenset()
    with pytest.raises(AvionicsError, match="'0;1': wants numbers with commas"):
        numbers("0;1")


def test_bench_that_is_not_there_is_said_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises((AvionicsError, DriverError), match="start one with `avionics rig serve`"):
        ask_bench(tmp_path / "none.sock", {"do": "status"})


def test_seeds_are_first_and_last() -> None:
    assert _seeds(None, (1, 3)) == range(1, 4)
    assert _seeds("4:4", (1, 3)) == range(4, 5)


@pytest.mark.parametrize(
    ("text", "why"),
    [("3", "FIRST:LAST"), ("1:2:3", "FIRST:LAST"), ("a:b", "FIRST:LAST"), ("5:2", "lies before")],
)
def test_wrong_seeds_are_refused(text: str, why: str) -> None:
    with pytest.raises(AvionicsError, match=f"--seeds {text}: .*{why}"):
        _seeds(text, (1, 3))


def test_choice_is_one_or_all_of_what_a_study_has() -> None:
    assert _choice("all", ("a", "b"), "profile") == ("a", "b")
    assert _choice("b", ("a", "b"), "profile") == ("b",)
    with pytest.raises(AvionicsError, match="profile 'c' is not in the study; it has a, b"):
        _choice("c", ("a", "b"), "profile")


def test_without_a_file_the_packaged_wing_is_taken_and_may_be_changed(tmp_path: Path) -> None:
    assert given_or_packaged(None, ()).markers
    assert given_or_packaged(None, ("estimator.form=paper",)).estimator.form == "paper"
    with pytest.raises(ConfigError, match=r"packaged configuration: .*estimator\.form"):
        given_or_packaged(None, ("estimator.form=best",))
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read"):
        given_or_packaged(tmp_path / "none.toml", ())
