"""Data that repeat: what is passed on, refused, doubted, and called frozen in the end."""

from collections import Counter

import numpy as np
import pytest

from drivers.repeats import FROZEN_AFTER, REPEATS_BEFORE_CHECK, STALE_AFTER, Repeats

VALUES, ZERO = np.array([1, 2, 3], dtype=np.int32), np.zeros(3, dtype=np.int32)


def repeats(*, has_accel: bool = True) -> tuple[Repeats, Counter[str]]:
    counters: Counter[str] = Counter()
    return Repeats(has_accel=has_accel, counters=counters), counters


def test_a_few_repeats_pass_then_they_are_stale() -> None:
    one, counters = repeats()
    assert one.pass_on(VALUES, None)
    passed = [one.pass_on(VALUES, VALUES) for _ in range(10)]
    assert passed == [True] * (STALE_AFTER - 1) + [False] * (11 - STALE_AFTER)
    assert counters == {"repeated": 10, "stale": 11 - STALE_AFTER}
    assert one.pass_on(VALUES + 1, VALUES)
    assert one.pass_on(VALUES + 1, VALUES + 1)


def test_the_state_is_asked_after_a_few_repeats() -> None:
    one, _ = repeats()
    doubts = []
    for _ in range(REPEATS_BEFORE_CHECK):
        one.pass_on(VALUES, VALUES)
        doubts.append(one.is_doubtful)
    assert doubts == [False] * (REPEATS_BEFORE_CHECK - 1) + [True]


def test_frozen_data_are_waited_for_twice_as_long_when_a_reset_did_not_help() -> None:
    one, _ = repeats()
    for count in (FROZEN_AFTER, 2 * FROZEN_AFTER):
        one.forget()
        for n in range(count):
            assert not one.is_frozen, n
            one.pass_on(VALUES, VALUES)
        assert one.is_frozen
        one.wait_longer()


@pytest.mark.parametrize(("has_accel", "may_rest"), [(True, False), (False, True)])
def test_zeros_are_refused_unless_a_gyro_alone_may_be_at_rest(has_accel, may_rest) -> None:
    one, counters = repeats(has_accel=has_accel)
    assert not one.pass_on(ZERO, None)
    assert one.is_doubtful
    one.verified()
    assert one.pass_on(ZERO, ZERO) is may_rest
    assert counters["all_zero"] == (1 if may_rest else 2)
