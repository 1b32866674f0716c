"""The queue between the threads that wait for hardware and the core."""

import threading

import numpy as np

from avionics.flight import runner
from avionics.flight.pipelines import Pipelines
from avionics.flight.rig import Rig
from avionics.records import MarkerPrediction
from drivers.samples import Frame, ImuSample
from sim_bus.clock import SimClock
from tests.avionics.flight.test_pipelines import CAMERA, Kept, two_wings
from tests.avionics.wse.flight import make_config


def test_what_the_core_does_not_take_in_time_is_counted_and_order_is_kept(monkeypatch) -> None:
    monkeypatch.setattr(runner, "LIVE_QUEUE_RECORDS", 3)
    live = runner._Live(Rig(SimClock()), make_config(), threading.Event())
    for seq in range(5):
        live._put(ImuSample(seq, "0", seq, np.zeros(3)))
    taken = [live.next_record(wait=False) for _ in range(4)]
    assert [record and record.t_ns for record in taken] == [0, 1, 2, None]
    assert live.counters["records_lost_queue_full"] == 2


def test_each_camera_has_its_own_tracker_and_waits_for_no_other() -> None:
    config = two_wings()
    stop = threading.Event()
    live = runner._Live(Rig(SimClock()), config, stop)
    pipelines = Pipelines(config, Kept())
    image = np.zeros((CAMERA.height_px, CAMERA.width_px), dtype=np.uint8)
    names = ("eye left", "eye right", "eye middle")

    def predict(frame: Frame) -> MarkerPrediction:
        return pipelines.predict_markers(frame.t_ns, frame.camera)

    for name in names:
        live.offer_frame(Frame(0, name, 3, image), predict)
    # Both trackers have one waiting; a second frame is not tracked, whoever is to blame.
    live.offer_frame(Frame(1, "eye left", 4, image), predict)
    assert live.counters["frames_not_tracked"] == 1
    tracked = []
    with live.threads():
        while len(tracked) < 2:
            record = live.next_record()
            if record is not None:
                tracked.append((record.camera, record.frame_index))
    assert sorted(tracked) == [("eye left", 3), ("eye right", 3)]
