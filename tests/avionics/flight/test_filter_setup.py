"""What a configuration says to the filters."""

import numpy as np

from avionics.flight.filter_setup import choose_basis, paper_basis
from tests.avionics.wse.flight import make_config


def test_auto_modes_follow_pods_and_marker_stations() -> None:
    counts = {
        (pods, stations): choose_basis(make_config(pods, stations)).name.split("/")[1]
        for pods in ((1.2,), (0.6, 1.2), tuple(np.linspace(0.2, 1.4, 8)))
        for stations in ((1.4,), (0.6, 1.2, 1.5))
    }
    assert counts[(0.6, 1.2), (0.6, 1.2, 1.5)] == "3+2+2"
    assert counts[(1.2,), (1.4,)] == "1+1+1"
    assert counts[(1.2,), (0.6, 1.2, 1.5)] == "3+2+2"
    assert counts[tuple(np.linspace(0.2, 1.4, 8)), (1.4,)] == "4+2+1"


def test_paper_form_flies_one_mode_of_each_and_numbers_override() -> None:
    assert choose_basis(make_config(form="paper")) == paper_basis(make_config())
    assert choose_basis(make_config(form="paper")).name == "quarter-sine/1+1+0"
    assert choose_basis(make_config(bending_modes=2, inplane_modes=2)).name.endswith("/2+2+2")


def test_markers_at_one_station_are_counted_once() -> None:
    config = make_config((0.6,), (1.0, 1.005))
    assert choose_basis(config).bending == 1
