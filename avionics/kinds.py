"""The kinds of estimate: name, label, colour and order of each, for logs, plots and viewers."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

EstimateKind = Literal["rg", "crg", "filtered", "smoothed", "gs"]

RG: Final = "rg"
"""RG-WSE: gyros alone, one row per tick."""
CRG: Final = "crg"
"""CRG-WSE as flown: one row per tick, from what had arrived by then."""
FILTERED: Final = "filtered"
"""CRG-WSE at each frame's exposure, after its update."""
SMOOTHED: Final = "smoothed"
"""CRG-WSE with the measurements after an instant taken into account too."""
GS: Final = "gs"
"""Distributed POS, one row per tick."""


@dataclass(frozen=True, slots=True)
class Style:
    """How something is named and drawn.

    Attributes
    ----------
    label : str
        For legends and tables.
    colour : str
        On white paper, ``#rrggbb``.
    screen_rgb : tuple of float, or None
        On the dark ground of a viewer, 0 to 1; None where viewers do not draw it.
    """

    label: str
    colour: str
    screen_rgb: tuple[float, float, float] | None = None


PAPER: Final = (RG, CRG)
"""Both estimators of Srikanth et al., which figures and pictures show side by side."""

STYLES: Final[dict[str, Style]] = {
    RG: Style("RG-WSE (gyros alone)", "#6b7785", (0.85, 0.85, 0.85)),
    CRG: Style("CRG-WSE (as flown)", "#c8102e", (0.95, 0.25, 0.2)),
    FILTERED: Style("CRG-WSE (filtered, at the exposures)", "#e08a00"),
    SMOOTHED: Style("CRG-WSE (smoothed)", "#7b3fa0"),
    GS: Style("distributed POS", "#008b8b", (0.95, 0.65, 0.1)),
}
"""Every kind of estimate, in the order of legends and tables."""

TRUTH: Final = Style("truth", "#1a7f37", (0.2, 0.75, 0.3))
TRACKS: Final = Style("markers as tracked", "#1f6feb", (0.25, 0.75, 1.0))


def style_of(kind: str) -> Style:
    """Return the style of a kind; one that this version does not know is grey under its name."""
    return STYLES[kind] if kind in STYLES else Style(kind, "#999999")


def in_order(kinds: Iterable[str]) -> list[str]:
    """Return kinds in the order of ``STYLES``, unknown ones behind them by name."""
    given = set(kinds)
    return [kind for kind in STYLES if kind in given] + sorted(given - set(STYLES))
