"""The queue between the threads that wait for hardware and the core."""

import threading

import numpy as np

from avionics.flight import runner
from avionics.flight.rig import Rig
from drivers.samples import ImuSample
from sim_bus.clock import SimClock
from tests.avionics.wse.flight import make_config


def test_what_the_core_does_not_take_in_time_is_counted_and_order_is_kept(monkeypatch) -> None:
    monkeypatch.setattr(runner, "LIVE_QUEUE_RECORDS", 3)
    live = runner._Live(Rig(SimClock()), make_config(), threading.Event())
    for seq in range(5):
        live._put(ImuSample(seq, "0", seq, np.zeros(3)))
    taken = [live.next_record(wait=False) for _ in range(4)]
    assert [record and record.t_ns for record in taken] == [0, 1, 2, None]
    assert live.counters["records_lost_queue_full"] == 2
