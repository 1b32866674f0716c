"""Pods on CAN: time within bounds, every loss accounted, hostile frames without effect."""

import random

import can
import numpy as np
import pytest

from avionics.config.chips import Bno055Settings
from drivers.bno055.registers import GYR_DATA
from drivers.can.imus import CanImus
from drivers.can.pod.codec import encode
from drivers.can.pod.messages import Axes, Identity, Kind, Sample, Sync
from drivers.errors import DeviceNotFoundError
from sim_bus.buses.can_pod import SimCanBus
from sim_bus.clock import SimClock
from tests.drivers.wing_bench import SECOND

pytestmark = pytest.mark.slow

RAW = Bno055Settings(mode="gyronly")


@pytest.mark.parametrize("clock_ppm", [-100.0, 100.0])
@pytest.mark.parametrize("local_start_us", [0, (1 << 32) - 2_000_000])
def test_sample_times_are_within_100_us(bench, clock_ppm, local_start_us) -> None:
    one = bench("can", chip=RAW, clock_ppm=clock_ppm, local_start_us=local_start_us)
    one.imus.open()
    one.fly(3.0)
    (pod,) = one.pods
    read, true_ns = pod.imu_read, []

    def remember(register, length):
        if register == GYR_DATA:
            true_ns.append(pod._now_ns)
        return read(register, length)

    pod.imu_read = remember
    samples = one.fly(20.0)
    assert len(samples) == pytest.approx(2000, abs=3)
    errors_ns = [
        t - min(true_ns, key=lambda x: abs(x - t)) for t in (s.t_ns for s in samples[1::17])
    ]
    assert np.abs(errors_ns).max() < 100_000
    assert one.imus.health()["pod 0"]["drift_ppb"] == pytest.approx(clock_ppm * 1e3, abs=2e3)


def test_pod_that_refuses_a_setting_is_not_flown(bench) -> None:
    one = bench("can", chip=Bno055Settings(rate_hz=250.0))
    with pytest.raises(DeviceNotFoundError, match=r"pod 0: RATE_HZ = 250: OUT_OF_RANGE, reads"):
        one.imus.open()


def test_an_open_pod_has_confirmed_its_settings(bench) -> None:
    one = bench("can", pods=2, chip=Bno055Settings(mode="gyronly", gyro_bandwidth_hz=230))
    one.imus.open()
    assert all(configurator.is_done for configurator in one.imus._configurators.values())
    for chip in one.chips:
        assert chip.mode == 3
        assert chip._pages[1][0x0A] >> 3 == 1  # 230 Hz


def test_two_pods_sample_at_once_when_the_sync_triggers_them(bench) -> None:
    one = bench("can", pods=2, chip=RAW, trigger_hz=100.0, clock_ppm=60.0)
    one.fly(2.0)
    samples = one.fly(2.0)
    by_pod = {p: np.array([s.t_ns for s in samples if s.pod == p]) for p in ("0", "1")}
    count = min(len(t) for t in by_pod.values())
    assert count > 190
    skew_ns = np.abs(by_pod["0"][:, None] - by_pod["1"][None, :]).min(axis=1)
    assert np.median(skew_ns) <= 200_000
    assert one.imus.health()[one.imus.name]["trigger_skew_us"] <= 200
    assert one.imus.health()["pod 1"]["drift_ppb"] == pytest.approx(60e3, abs=5e3)


def test_the_account_of_losses_closes(bench) -> None:
    # GIVEN 5 % of all frames lost WHEN flown THEN sent = received + counted
    one = bench("can", chip=RAW)
    one.imus.open()
    one.fly(1.0)
    one.fault("frame_drop", 0, 0.0, 10.0, probability=0.05)
    samples = one.fly(12.0)
    health = one.imus.health()["pod 0"]
    seqs = [s.seq for s in samples]
    missing = seqs[-1] - seqs[0] + 1 - len(seqs)
    assert health["samples_lost"] + health["samples_incomplete"] >= missing > 30
    assert one.pods[0].dropped > 60


class Scripted:
    """A receiver and a hand that writes frames on its bus."""

    def __init__(self, **options) -> None:
        self.clock = SimClock(SECOND)
        channel = f"scripted-{id(self)}"
        self.hand = SimCanBus(channel, self.clock)
        self.imus = CanImus(SimCanBus(channel, self.clock), {1: "a"}, self.clock, **options)

    def put(self, arbitration_id: int, data: bytes, **more) -> None:
        message = can.Message(arbitration_id=arbitration_id, data=data, is_extended_id=False)
        for name, value in more.items():
            setattr(message, name, value)
        self.hand.send(message)

    def sample(self, seq: int, *, scale: int = 0, **more) -> None:
        self.clock.advance(10_000_000)
        self.put(*encode(Axes(Kind.GYRO, 1, seq % 256, 100, -200, 300)))
        t_us = self.clock.now_ns() // 1000 % (1 << 24)
        self.put(*encode(Sample(1, seq % 256, t_us, scale=scale, **more)))

    def read(self):
        found = []
        while (sample := self.imus.read(0)) is not None:
            found.append(sample)
        return found

    def close(self) -> None:
        self.imus.close()
        self.hand.shutdown()


@pytest.fixture
def scripted():
    one = Scripted(sync_period_s=0.0)
    yield one
    one.close()


def test_hostile_frames_change_nothing_but_counters(scripted) -> None:
    rng = random.Random(8)
    scripted.sample(0)
    assert len(scripted.read()) == 1
    for _ in range(20_000):
        scripted.put(rng.randrange(0x400), rng.randbytes(rng.randrange(9)))
        if rng.random() < 0.05:
            scripted.put(0x101, b"\0" * 8, is_extended_id=True)
        if rng.random() < 0.05:
            scripted.put(0x101, b"", is_remote_frame=True)
    assert scripted.read() == []
    scripted.sample(1)
    (sample,) = scripted.read()
    assert sample.seq == 1
    group = next(iter(scripted.imus.health().values()))
    assert group["bad_frames"] > 1000
    assert group["foreign_frames"] > 10_000


def test_the_scale_travels_with_every_sample(scripted) -> None:
    for code, dps in enumerate([r / 32768 for r in (2000, 1000, 500, 250, 125)] + [1 / 16]):
        scripted.sample(code, scale=code)
        (sample,) = scripted.read()
        assert sample.rate_rad_s == pytest.approx(np.radians([100 * dps, -200 * dps, 300 * dps]))
    scripted.sample(6, scale=6)
    assert scripted.read() == []
    assert scripted.imus.health()["pod a"]["bad_scale"] == 1


def test_losses_over_whole_turns_of_the_counter_are_counted(scripted) -> None:
    for seq in range(20):
        scripted.sample(seq)
        scripted.read()
    scripted.clock.advance(600 * 10_000_000)
    scripted.sample(620)
    samples = scripted.read()
    assert samples[-1].seq == 620
    assert scripted.imus.health()["pod a"]["samples_lost"] == 600


def test_a_frame_of_a_sample_that_is_lost_costs_that_sample_only(scripted) -> None:
    scripted.sample(0)
    scripted.clock.advance(10_000_000)
    scripted.put(*encode(Sample(1, 1, 0)))  # its gyro frame is missing
    scripted.sample(2)
    assert [s.seq for s in scripted.read()] == [0, 2]
    assert scripted.imus.health()["pod a"]["samples_incomplete"] == 1


def test_duplicate_id_and_refusal_are_told(scripted) -> None:
    scripted.put(*encode(Identity(1, 1, b"abcdef")))
    scripted.put(*encode(Identity(1, 1, b"xyzxyz")))
    scripted.put(*encode(Identity(1, 0, bytes((9, 1, 0, 0, 1, 0)))))
    scripted.put(*encode(Identity(1, 0, bytes((1, 1, 0, 0, 1, 1)))))
    scripted.read()
    messages = [e.message for e in scripted.imus.take_events()]
    assert any("two pods share this number" in m for m in messages)
    assert any(m == "layout version 9, expected 1" for m in messages)
    assert any(m == "refuses to run: duplicate node" for m in messages)


def test_another_master_is_told_once() -> None:
    one = Scripted()
    for seq in range(5):
        one.put(*encode(Sync(seq)))
    one.read()
    events = one.imus.take_events()
    assert [e.level for e in events] == ["error"]
    one.close()


def test_silent_pod_is_told_once_and_when_it_returns(scripted) -> None:
    scripted.sample(0)
    scripted.read()
    for _ in range(3):
        scripted.clock.advance(2 * SECOND)
        scripted.read()
    scripted.sample(1)
    scripted.read()
    assert [e.message for e in scripted.imus.take_events()] == [
        "no samples for 1 s",
        "samples again",
    ]


class FailingBus(can.BusABC):
    """A bus whose every call fails while ``broken``."""

    def __init__(self, error: Exception) -> None:
        super().__init__(channel="failing")
        self.error: Exception | None = error
        self.waiting: list[can.Message] = []

    def _recv_internal(self, timeout):
        if self.error is not None:
            raise self.error
        return (self.waiting.pop(0), False) if self.waiting else (None, False)

    def send(self, msg, timeout=None) -> None:
        if self.error is not None:
            raise self.error


@pytest.mark.parametrize(
    "error",
    [
        can.CanOperationError("link is down", 100),
        OSError(19, "No such device"),
        ValueError("invalid literal for int() with base 16: 'zz'"),
        UnicodeDecodeError("ascii", b"\xff", 0, 1, "ordinal not in range"),
    ],
)
def test_reader_outlives_any_error_of_the_bus(error) -> None:
    clock, bus = SimClock(SECOND), FailingBus(error)
    imus = CanImus(bus, {1: "a"}, clock)
    for _ in range(50):
        assert imus.read(0.01) is None
    bus.error = None
    for message in (encode(Axes(Kind.GYRO, 1, 0, 1, 2, 3)), encode(Sample(1, 0, 0))):
        bus.waiting.append(
            can.Message(arbitration_id=message[0], data=message[1], is_extended_id=False)
        )
    assert imus.read(0.01) is not None
    levels = [e.level for e in imus.take_events()]
    assert levels == ["warning", "info"]
    imus.close()
