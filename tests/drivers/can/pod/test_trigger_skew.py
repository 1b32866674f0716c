"""The skew of triggered samples is the spread of the pods' delays, in any order of frames."""

import pytest

from drivers.can.pod.messages import Sample, SyncReply
from drivers.can.pod.trigger_skew import TriggerSkew


def mark(node: int, t_us: int, *, triggered: bool = True) -> Sample:
    return Sample(node, 0, t_us % (1 << 24), triggered=triggered)


def reply(node: int, seq: int, t_us: int) -> SyncReply:
    return SyncReply(node, seq % 256, t_us % (1 << 32), 0)


@pytest.mark.parametrize("sample_first", [True, False])
def test_spread_of_one_sync_is_kept(sample_first: bool) -> None:
    skew = TriggerSkew()
    start_us = (1 << 32) - 300  # both stamps roll over
    for seq in range(600):
        for node, delay_us in ((0, 400), (1, 430 + (seq == 300) * 90), (2, 405)):
            t_us = start_us + seq * 10_000 + node * 77_777
            if sample_first:
                skew.on_sample(mark(node, t_us + delay_us))
            skew.on_reply(reply(node, seq, t_us))
            if not sample_first:
                skew.on_sample(mark(node, t_us + delay_us))
    assert skew.worst_us == 120


def test_delays_of_different_syncs_are_not_compared() -> None:
    skew = TriggerSkew()
    for seq, node, delay_us in ((0, 0, 400), (1, 1, 900)):
        skew.on_reply(reply(node, seq, seq * 10_000))
        skew.on_sample(mark(node, seq * 10_000 + delay_us))
    assert skew.worst_us == 0


def test_samples_of_the_sync_before_and_of_the_own_timer_do_not_count() -> None:
    skew = TriggerSkew()
    skew.on_sample(mark(0, 400))
    skew.on_reply(reply(0, 1, 10_000))
    skew.on_sample(mark(1, 10_900))
    skew.on_reply(reply(1, 1, 10_000))
    skew.on_sample(mark(0, 12_000, triggered=False))
    assert skew.worst_us == 0
    skew.on_sample(mark(0, 10_500))
    assert skew.worst_us == 400
