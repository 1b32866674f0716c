"""The line through the last bursts, and when in a burst its data were taken."""

import numpy as np
import pytest

from drivers.burst import LONGEST_LEAD_NS, BurstLine, agree, is_all_zero
from drivers.burst_time import SLOW_NS, BurstTime

MS = 1_000_000


def words(*values: int) -> np.ndarray:
    return np.array(values, dtype=np.int32)


def test_the_line_leads_on_with_the_slope_of_the_last_two() -> None:
    line = BurstLine()
    assert line.expected(0) is None
    line.remember(10 * MS, words(100, -50))
    assert line.expected(20 * MS).tolist() == [100, -50]
    line.remember(20 * MS, words(130, -40))
    assert line.expected(30 * MS).tolist() == [160, -30]
    assert line.expected(25 * MS).tolist() == [145, -35]


def test_across_a_gap_only_the_last_burst_is_expected() -> None:
    line = BurstLine()
    line.remember(0, words(0))
    line.remember(10 * MS, words(1000))
    assert line.expected(10 * MS + LONGEST_LEAD_NS + 1).tolist() == [1000]
    line.remember(10 * MS + LONGEST_LEAD_NS + 1, words(500))
    assert line.expected(50 * MS).tolist() == [500]
    line.forget()
    assert line.last is None
    assert line.expected(60 * MS) is None


def test_bursts_agree_within_the_limit_of_each_word() -> None:
    limit = words(10, 100)
    assert agree(words(0, 0), words(10, -100), limit)
    assert not agree(words(0, 0), words(11, 0), limit)
    assert not agree(words(0, 0), words(0, 101), limit)
    assert is_all_zero(words(0, 0))
    assert not is_all_zero(words(0, 1))


@pytest.mark.parametrize(("length", "address_bytes"), [(6, 3), (15, 1)])
def test_data_are_taken_behind_the_address(length, address_bytes) -> None:
    taken_ns, is_vague = BurstTime(length, address_bytes).taken_ns(1000 * MS, 1002 * MS)
    assert taken_ns == 1000 * MS + 2 * MS * address_bytes // (address_bytes + length)
    assert not is_vague


def test_burst_that_was_held_up_is_vague() -> None:
    one = BurstTime(6, 3)
    assert not one.taken_ns(0, 2 * MS)[1]
    assert not one.taken_ns(0, 2 * MS + SLOW_NS)[1]
    assert one.taken_ns(0, 2 * MS + SLOW_NS + 1)[1]
