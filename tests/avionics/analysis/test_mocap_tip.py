"""Motive exports: labelled markers in metres, drop-outs and ghosts."""

import numpy as np

from avionics.analysis.mocap_tip import tip_from_markers
from avionics.config import Config, Marker, Wing
from avionics.flight.filter_setup import marker_model
from avionics.wse.modes import ModeBasis

HEAD = "Format Version,1.23,Take Name,T,Export Frame Rate,240.0,Length Units,{unit}\n\n"
NAMES = (
    ",Type,Marker,Marker,Marker,Marker,Marker,Marker\n"
    ",Name,A:1,A:1,A:1,Unlabeled 7,Unlabeled 7,Unlabeled 7\n"
)
AXES = (
    ",ID,x,x,x,y,y,y\n,,Position,Position,Position,Position,Position,Position\n"
    "Frame,Time (Seconds),X,Y,Z,X,Y,Z\n"
)


def test_tip_is_unknown_while_none_of_its_own_markers_is_seen() -> None:
    # GIVEN markers along the wing, two of them at the tip, of which one or both are lost
    places = [(s, x) for s in (0.5, 1.0, 1.5) for x in (0.1, -0.1)]
    markers = tuple(Marker(id=i, s_m=s, x_m=x, z_m=0.0) for i, (s, x) in enumerate(places))
    config = Config(wing=Wing(span_m=1.5), markers=markers)
    model = marker_model(config, ModeBasis("quarter-sine", 1.5, 2, 1, 0))
    marker_m = np.array([model.points(np.array([0.3, 0.05, 0.02]))] * 3)
    marker_m[1, 5] = marker_m[2, 4:] = np.nan
    # WHEN the tip is fitted
    tip_m = tip_from_markers(config, markers, marker_m)
    # THEN one is enough, and none is not
    assert np.abs(tip_m[1] - tip_m[0]).max() < 1e-4
    assert np.isnan(tip_m[2]).all()
