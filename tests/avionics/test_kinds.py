"""The kinds of estimate are written once."""

from typing import get_args

from avionics.kinds import STYLES, EstimateKind, in_order, style_of


def test_every_kind_of_a_record_has_its_style() -> None:
    assert tuple(STYLES) == get_args(EstimateKind)
    assert len({style.label for style in STYLES.values()}) == len(STYLES)
    assert len({style.colour for style in STYLES.values()}) == len(STYLES)


def test_a_kind_of_a_newer_log_keeps_its_name_and_comes_last() -> None:
    assert in_order(["other", "gs", "another", "crg", "rg"]) == [
        "rg",
        "crg",
        "gs",
        "another",
        "other",
    ]
    assert style_of("other").label == "other"
    assert style_of("rg") is STYLES["rg"]
