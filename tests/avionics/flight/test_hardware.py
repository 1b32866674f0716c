"""From a configuration's links to drivers: what a CAN bus of pods and a camera are told."""

from typing import get_args

import can
import numpy as np
import pytest

from avionics.config import Camera, Pod
from avionics.config.links import GStreamerCamera, JetsonWhiteBalance
from avionics.flight import hardware
from drivers.cameras.gstreamer import JETSON_WHITE_BALANCE
from drivers.can.pod.codec import decode
from drivers.can.pod.messages import Sample
from drivers.clock import SteadyClock
from sim_bus.buses.can_pod import SimPod
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.realtime import PacedClock
from tests.drivers.wing_bench import Swing
from tests.opening import open_imus

CHANNEL = "triggered pods"


def pods(*triggered: bool) -> list[Pod]:
    link = {"kind": "can", "interface": "virtual", "channel": CHANNEL}
    return [
        Pod.model_validate({"id": n, "s_m": 0.5, "link": {**link, "node": n, "triggered": wanted}})
        for n, wanted in enumerate(triggered)
    ]


def test_triggered_links_make_the_sync_sample_all_pods() -> None:
    clock = PacedClock()
    simulated = [
        SimPod(
            n,
            SimBno055(Swing(), np.random.default_rng(n), power_on_ns=clock.now_ns()),
            can.Bus(interface="virtual", channel=CHANNEL),
            clock,
            uid=bytes([n + 1]) * 12,
        )
        for n in range(2)
    ]
    with can.Bus(interface="virtual", channel=CHANNEL) as ear:
        for pod in simulated:
            clock.on_advance(pod.step)
        try:
            imus = open_imus(pods(True, True), clock)
            try:
                heard: set[int] = set()
                give_up_ns = clock.now_ns() + 20_000_000_000
                while heard != {0, 1} and clock.now_ns() < give_up_ns:
                    imus.read(0.1)
                    while (frame := ear.recv(0)) is not None:
                        message = decode(frame.arbitration_id, bytes(frame.data))
                        if isinstance(message, Sample) and message.triggered:
                            heard.add(message.node)
                assert heard == {0, 1}
                assert any("trigger_skew_us" in group for group in imus.health().values())
            finally:
                imus.close()
        finally:
            clock.close()
            for pod in simulated:
                pod.close()


def test_what_a_pipeline_of_ones_own_would_ignore_is_refused() -> None:
    assert get_args(JetsonWhiteBalance) == JETSON_WHITE_BALANCE
    with pytest.raises(ValueError, match="white_balance is for the Jetson's own line"):
        GStreamerCamera(pipeline="videotestsrc", white_balance="shade")


def test_a_camera_gets_what_the_configuration_fixes(monkeypatch) -> None:
    lines = []

    class Process:
        def __init__(self, line: str, clock, **options) -> None:
            lines.append(line)

        def open(self) -> None:
            pass

    monkeypatch.setattr(hardware, "FrameProcess", Process)
    source = GStreamerCamera(exposure_us=2000, gain=4, white_balance="shade")
    lens = {"f_x_px": 500.0, "f_y_px": 500.0, "c_x_px": 320.0, "c_y_px": 240.0}
    hardware.open_camera(Camera(**lens, source=source), SteadyClock())
    for part in ('exposuretimerange="2000000 2000000"', 'gainrange="4 4"', "wbmode=8"):
        assert part in lines[0]
