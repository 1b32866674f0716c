"""Colours of what Foxglove draws, the same in the picture and in space."""

from foxglove_schemas_protobuf.Color_pb2 import Color

from avionics.kinds import STYLES, TRACKS, TRUTH, Style


def colour_of(style: Style) -> Color:
    """Return the opaque colour of a style that viewers draw."""
    assert style.screen_rgb is not None
    red, green, blue = style.screen_rgb
    return Color(r=red, g=green, b=blue, a=1.0)


COLOURS = {
    **{kind: colour_of(style) for kind, style in STYLES.items() if style.screen_rgb is not None},
    "truth": colour_of(TRUTH),
    "tracks": colour_of(TRACKS),
}
