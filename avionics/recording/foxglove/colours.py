"""Colours of what Foxglove draws, the same in the picture and in space."""

from foxglove_schemas_protobuf.Color_pb2 import Color

COLOURS = {
    "rg": Color(r=0.85, g=0.85, b=0.85, a=1.0),
    "crg": Color(r=0.95, g=0.25, b=0.2, a=1.0),
    "gs": Color(r=0.95, g=0.65, b=0.1, a=1.0),
    "truth": Color(r=0.2, g=0.75, b=0.3, a=1.0),
    "tracks": Color(r=0.25, g=0.75, b=1.0, a=1.0),
}
