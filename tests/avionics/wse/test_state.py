"""The layout of the state: each part named once, in one order."""

import numpy as np
import pytest

from avionics.wse.modes import ModeBasis
from avionics.wse.state import RandomWalk, StateLayout

BASIS = ModeBasis("quarter-sine", 1.5, 2, 1, 0)
PRIOR = np.array([0.04, 0.01, 0.02])


def whole() -> StateLayout:
    return StateLayout(
        BASIS,
        ("a", "b"),
        prior=PRIOR,
        truncation=2e-3,
        bias=RandomWalk(0.02, 1e-5),
        has_unobserved=True,
        offset=RandomWalk(0.01, 1e-4),
    )


def test_parts_follow_each_other_without_gap_or_overlap() -> None:
    layout = whole()
    parts = (layout.amplitudes, layout.bias, layout.unobserved, layout.offset)
    covered = [i for part in parts for i in range(part.start, part.stop)]
    assert covered == list(range(layout.size)) == list(range(3 + 6 + 3 + 1))
    assert layout.logged == slice(0, 9)
    assert (layout.phi, layout.theta, layout.psi) == (slice(0, 2), slice(2, 3), slice(3, 3))


def test_every_state_has_its_label_start_variance_and_walk() -> None:
    layout = whole()
    assert len(layout.labels) == len(set(layout.labels)) == layout.size
    assert layout.labels[:5] == ("phi 1", "phi 2", "theta 1", "bias a x", "bias a y")
    assert layout.labels[layout.offset] == ("time offset",)
    start = layout.start_P.diagonal()
    assert start[layout.amplitudes] == pytest.approx(PRIOR)
    assert start[layout.bias] == pytest.approx(0.02**2)
    assert start[layout.unobserved] == pytest.approx(0.0)
    assert start[layout.offset] == pytest.approx(0.01**2)
    assert layout.walk[layout.amplitudes] == pytest.approx(2e-3**2)
    assert layout.walk[layout.bias] == pytest.approx(1e-5**2)
    assert layout.walk[layout.unobserved] == pytest.approx(0.0)
    assert layout.walk[layout.offset] == pytest.approx(1e-4**2)


def test_what_is_not_wanted_is_an_empty_slice() -> None:
    layout = StateLayout(BASIS, ("a", "b"), prior=PRIOR)
    assert layout.size == 3
    assert [layout.has_bias, layout.has_unobserved, layout.has_offset] == [False] * 3
    x = np.arange(3.0)
    assert x[layout.bias].size == x[layout.unobserved].size == x[layout.offset].size == 0
    # Without pods a bias that is wanted has no axes.
    assert not StateLayout(BASIS, (), prior=PRIOR, bias=RandomWalk(0.02)).has_bias
