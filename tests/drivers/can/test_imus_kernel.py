"""Pods on a real SocketCAN: time in UML, and a minute of a busy bus."""

import subprocess
import time

import can
import numpy as np
import pytest

from drivers.bno055.registers import GYR_DATA
from drivers.can.imus import CanImus
from drivers.can.pod.codec import encode, filters
from drivers.can.pod.messages import Axes, Kind, Sample
from drivers.can.socketcan import SocketCanPort
from drivers.clock import SteadyClock
from sim_bus.buses.can_pod import SimPod
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.realtime import PacedClock
from tests import machine
from tests.drivers.wing_bench import GOOD, Swing

pytestmark = pytest.mark.uml


@pytest.mark.parametrize("ppm", [-100.0, 100.0])
def test_drifting_pod_is_mapped_within_a_millisecond(vcan, ppm, record_property) -> None:
    clock = PacedClock()
    chip = SimBno055(Swing(), np.random.default_rng(1), grade=GOOD, power_on_ns=clock.now_ns())
    bus = can.Bus(interface="socketcan", channel=vcan)
    pod = SimPod(0, chip, bus, clock, clock_ppm=ppm)
    read, true_ns = pod.imu_read, []

    def remember(register, length):
        if register <= GYR_DATA < register + length and length >= 6:
            true_ns.append(pod._now_ns)
        return read(register, length)

    pod.imu_read = remember
    clock.on_advance(pod.step)
    imus = CanImus(
        SocketCanPort(vcan, SteadyClock(), identifiers=filters()), {0: "0"}, SteadyClock()
    )
    imus.open(5.0)
    found, end = [], time.monotonic() + 12.0
    while time.monotonic() < end:
        sample = imus.read(0.05)
        if sample is not None and time.monotonic() > end - 8.0:
            found.append(sample.t_ns)
    health = imus.health()["pod 0"]
    clock.close()
    imus.close()
    pod.close()
    truth = np.array(true_ns)
    errors_us = np.array([(t - truth[np.abs(truth - t).argmin()]) * 1e-3 for t in found])
    record_property("p99_us", float(np.percentile(np.abs(errors_us), 99)))
    assert len(found) > 600
    assert np.percentile(np.abs(errors_us), 99) < 1000, f"median {np.median(errors_us):.0f} us"
    assert health["drift_ppb"] == pytest.approx(ppm * 1e3, abs=30e3)


@pytest.mark.parametrize("seconds", [8, pytest.param(60, marks=pytest.mark.proof)])
def test_800_frames_a_second_lose_nothing(
    vcan, seconds, tmp_path, machine_speed: float, record_property
) -> None:
    pods, log, rate_hz = 4, tmp_path / "bus.log", machine.rate_hz(100, machine_speed)
    wanted_hz = pods * 2 * rate_hz
    with log.open("w", encoding="ascii") as stream:
        for tick in range(seconds * rate_hz):
            stamp_us = 1_000_000 + tick * 1_000_000 // rate_hz
            for node in range(pods):
                for frame in (
                    Axes(Kind.GYRO, node, tick % 256, 1, 2, 3),
                    Sample(node, tick % 256, stamp_us % (1 << 24)),
                ):
                    number, data = encode(frame)
                    seconds_text = f"{stamp_us // 10**6}.{stamp_us % 10**6:06d}"
                    stream.write(f"({seconds_text}) {vcan} {number:03X}#{data.hex().upper()}\n")
    imus = CanImus(
        SocketCanPort(vcan, SteadyClock()), {n: str(n) for n in range(pods)}, SteadyClock()
    )
    # A program of its own sends, as fast as the wing would.
    player = subprocess.Popen(["canplayer", "-I", str(log)])
    busy_s, start_s, received = time.process_time(), time.monotonic(), 0
    try:
        while player.poll() is None:
            for _ in range(10):
                received += imus.read(0.02) is not None
        sent_hz = wanted_hz * seconds / (time.monotonic() - start_s)
        while imus.read(0.05) is not None:
            received += 1
    finally:
        player.kill()
        player.wait()
    busy_s = time.process_time() - busy_s
    health = imus.health()
    imus.close()
    record_property("samples_of", f"{received} of {pods * seconds * rate_hz}")
    record_property("reader_cpu", busy_s / seconds)
    record_property("sent_hz", f"{sent_hz:.0f} of {wanted_hz}")
    assert health[f"can {vcan}"].get("rx_dropped", 0) == 0
    for node in range(pods):
        assert health[f"pod {node}"]["samples"] == seconds * rate_hz
        assert health[f"pod {node}"].get("samples_lost", 0) == 0
    assert sent_hz > 0.9 * wanted_hz
