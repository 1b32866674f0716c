"""What a configuration says to the filters."""

import numpy as np

from avionics.flight.filter_setup import choose_basis, paper_basis, settings_from_config
from tests.avionics.wse.flight import CAMERA, make_config


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


def test_noise_is_adapted_over_the_frame_time_of_the_camera() -> None:
    assert settings_from_config(make_config()).rules.frame_s == 0.033
    fast = CAMERA.model_copy(update={"fps": 120.0})
    assert settings_from_config(make_config(camera=fast)).rules.frame_s == 0.008


def test_states_follow_from_the_configuration() -> None:
    layout = settings_from_config(make_config((0.6, 1.2))).layout
    assert layout.labels[layout.bias][0] == "bias 0 x"
    assert layout.has_unobserved
    assert layout.has_offset
    # One pod leaves unobserved what looks like a time offset.
    assert not settings_from_config(make_config((0.6,))).layout.has_offset
    paper = settings_from_config(make_config(form="paper"))
    assert paper.layout.labels == ("phi 1", "theta 1")
    assert len(paper.paper_layout.labels) == 2 + 6
