"""The C core as a shared library, on the simulated chip: samples, faults, time, refusals."""

import numpy as np
import pytest
from bench import Bench

from drivers.can.pod.messages import (
    Axes,
    ConfigKey,
    ConfigRequest,
    ConfigResult,
    FollowUp,
    Identity,
    Kind,
    Sync,
)

PERIOD_US = 10_000


def words(data: bytes) -> list[int]:
    return np.frombuffer(data, dtype="<i2").tolist()


def ask(bench: Bench, token: int, key: ConfigKey, value: int, wait_s: float = 1.0):
    bench.hear(ConfigRequest(bench.node, token, key, value))
    bench.run(wait_s)
    return next((m for m in bench.messages(Kind.CONFIG_REPLY) if m.token == token), None)


def test_rates_on_the_bus_are_the_chips_bit_for_bit() -> None:
    bench = Bench()
    bench.run(10.0)
    sent = [[m.x, m.y, m.z] for m in bench.messages(Kind.GYRO)]
    assert len(sent) > 900
    assert sent == [words(data) for data in bench.board.gyro_reads[-len(sent) :]]


def test_sequence_and_counter_close_the_account() -> None:
    bench = Bench()
    bench.run(5.0)
    marks = bench.messages(Kind.SAMPLE)
    assert [m.seq for m in marks] == [i % 256 for i in range(len(marks))]
    steps = np.diff([m.t_local_us for m in marks])
    assert set(steps.tolist()) == {PERIOD_US}
    bench.run(1.2)  # one more round of counter pages
    account = bench.counters()
    assert 0 <= len(bench.messages(Kind.SAMPLE)) - account["samples_sent"] <= 120
    assert not any(v for k, v in account.items() if k != "samples_sent")


def test_identity_tells_both_unique_ids() -> None:
    bench = Bench(uid=bytes(range(20, 32)))
    bench.run(2.0)
    parts = {m.part: m.payload for m in bench.messages(Kind.IDENTITY)}
    assert parts[1] + parts[2] == bytes(range(20, 32))
    assert (parts[3] + parts[4] + parts[5])[:16] == bench.chip.unique_id


def test_optional_streams_carry_the_burst() -> None:
    bench = Bench()
    bench.run(2.0)
    assert ask(bench, 1, ConfigKey.STREAMS, 3).result == ConfigResult.DONE
    bench.board.sent.clear()
    bench.run(1.0)
    by_kind = {k: bench.messages(k) for k in (Kind.GYRO, Kind.ACCEL, Kind.MAG, Kind.SAMPLE)}
    assert {len(v) for v in by_kind.values()} == {100}
    for gyro, accel, mag, mark in zip(*by_kind.values(), strict=True):
        assert gyro.seq == accel.seq == mag.seq == mark.seq
        assert mark.has_accel
        assert mark.has_mag
        # About 1 g and tens of microtesla: the words are not exchanged.
        assert 900 < np.linalg.norm([accel.x, accel.y, accel.z]) < 1100
        assert 100 < np.linalg.norm([mag.x, mag.y, mag.z]) < 1500


@pytest.mark.parametrize(("code", "range_dps"), list(enumerate([2000, 1000, 500, 250, 125])))
def test_range_is_set_in_the_chip_and_told_with_every_sample(code: int, range_dps: int) -> None:
    bench = Bench()
    bench.run(2.0)
    assert ask(bench, 9, ConfigKey.GYRO_RANGE_DPS, range_dps).result == ConfigResult.DONE
    bench.board.sent.clear()
    bench.run(0.5)
    assert {m.scale for m in bench.messages(Kind.SAMPLE)} == {code}
    assert bench.chip.gyro_rad_s_per_lsb == pytest.approx(np.radians(range_dps / 32768))


def test_fusion_mode_tells_its_own_scale() -> None:
    bench = Bench()
    bench.run(2.0)
    assert ask(bench, 2, ConfigKey.MODE, 12).result == ConfigResult.DONE
    assert ask(bench, 3, ConfigKey.GYRO_RANGE_DPS, 500).result == ConfigResult.NOT_NOW
    bench.board.sent.clear()
    bench.run(0.5)
    assert {m.scale for m in bench.messages(Kind.SAMPLE)} == {5}


def test_naks_cost_samples_not_the_stream() -> None:
    bench = Bench()
    bench.run(2.0)
    bench.board.naks_left = 2
    bench.board.sent.clear()
    bench.run(3.0)
    assert len(bench.messages(Kind.GYRO)) == 298
    account = bench.counters()
    assert (account["nak"], account["sample_missed"], account["reinit"]) == (2, 2, 0)


def test_stuck_bus_is_freed_and_the_chip_brought_up_again() -> None:
    bench = Bench()
    bench.run(2.0)
    bench.board.is_stuck = True
    bench.run(1.0)
    assert bench.board.recoveries >= 3
    assert bench.core.state != 1
    bench.board.is_stuck = False
    bench.run(3.0)
    assert bench.core.state == 1
    account = bench.counters()
    assert account["bus_timeout"] >= 10
    assert account["reinit"] >= 1


def test_spikes_are_read_again() -> None:
    bench = Bench()
    bench.run(2.0)
    before = len(bench.board.sent)
    for _ in range(20):
        bench.board.flips_left = 1
        bench.run(0.05)
    del bench.board.sent[:before]
    assert max(abs(m.z) for m in bench.messages(Kind.GYRO)) < 2000
    bench.run(1.2)
    assert bench.counters()["spike"] == 20


def test_brown_out_shows_no_zeros_and_recovers() -> None:
    bench = Bench()
    bench.run(2.0)
    bench.board.sent.clear()
    bench.chip.brown_out(bench.board.time_us * 1000, silent_ns=0)
    bench.run(3.0)
    rates = [(m.x, m.y, m.z) for m in bench.messages(Kind.GYRO)]
    assert (0, 0, 0) not in rates
    assert len(rates) > 150  # 0.75 s of bring-up are missing
    assert bench.counters()["reinit"] == 1


def test_page_left_at_one_is_noticed() -> None:
    bench = Bench()
    bench.run(2.0)
    bench.chip.select_page(1)
    bench.run(4.0)
    assert bench.core.state == 1
    bench.board.sent.clear()
    bench.run(1.0)
    assert len(bench.messages(Kind.GYRO)) == 100


def test_two_step_sync_gives_64_bit_time_within_some_microseconds() -> None:
    bench = Bench(clock_ppm=70.0)
    bench.run(2.0)
    epoch_us = 40_000_000_000_000  # 460 days: beyond 32 bits
    origin_us = bench.board.time_us
    for seq in range(60):
        bench.sync(seq, epoch_us + bench.board.time_us - origin_us)
        bench.run(0.1)
    assert bench.core.is_synced
    truth_us = epoch_us + bench.board.time_us - origin_us
    assert abs(bench.core.master_us(bench.board.now_us()) - truth_us) <= 3
    replies = bench.messages(Kind.SYNC_REPLY)
    assert len(replies) == 60
    assert replies[0].error_us == -32768
    assert abs(replies[-1].error_us) <= 3
    assert bench.messages(Kind.SAMPLE)[-1].synced


def test_follow_up_of_another_sync_is_refused() -> None:
    bench = Bench()
    bench.run(2.0)
    bench.hear(Sync(7))
    bench.hear(FollowUp(8, 123))
    bench.run(1.5)
    assert not bench.core.is_synced
    assert bench.counters()["can_rx_bad"] == 1


def benches(count: int) -> list[Bench]:
    """Pods with clocks that differ in rate and origin, on one bus."""
    rng = np.random.default_rng(5)
    pods = []
    for node in range(count):
        pod = Bench(node=node, uid=bytes([node] * 12), clock_ppm=float(rng.normal(0, 50)))
        pod.run(2.0 + float(rng.uniform(0, 0.01)))
        pods.append(pod)
    return pods


def test_one_sync_samples_all_pods_within_200_us() -> None:
    pods = benches(16)
    for pod in pods:
        ask(pod, 1, ConfigKey.SAMPLING, 1, wait_s=0.2)
    starts = {p.node: p.board.time_us for p in pods}
    for pod in pods:
        pod.board.sent.clear()
        for seq in range(100):
            pod.hear(Sync(seq, trigger=True))
            pod.run(0.01)
    delays = []
    for pod in pods:
        marks = [m for m in pod.messages(Kind.SAMPLE) if m.triggered]
        replies = pod.messages(Kind.SYNC_REPLY)
        assert len(marks) == len(replies) == 100, starts
        delays += [
            (m.t_local_us - r.t_local_us) & 0xFFFFFF for m, r in zip(marks, replies, strict=True)
        ]
        pod.run(1.2)
        assert pod.counters()["sample_late"] == 0
    assert max(delays) - min(delays) <= 200


def test_own_timers_are_pulled_together_once_synchronised() -> None:
    pods = benches(4)
    phases = []
    for pod in pods:
        origin_us = pod.board.time_us
        for seq in range(60):
            pod.sync(seq, 7_000_000 + pod.board.time_us - origin_us)
            pod.run(0.1)
        mark = pod.messages(Kind.SAMPLE)[-1]
        local_us = pod.board.now_us()
        local_us -= (local_us - mark.t_local_us) & 0xFFFFFF
        phases.append((pod.core.master_us(local_us) + 5000) % PERIOD_US - 5000)
    assert max(phases) - min(phases) <= 20
    assert max(abs(p) for p in phases) <= 20


def test_newcomer_with_a_number_in_use_refuses_to_run() -> None:
    bench = Bench()
    bench.run(0.1)
    bench.hear(Axes(Kind.GYRO, bench.node, 0, 1, 2, 3))
    bench.run(3.0)
    assert bench.core.refusal == 1
    assert not bench.messages(Kind.GYRO)
    assert bench.messages(Kind.IDENTITY)[0].payload[5] == 1


def test_running_pod_answers_a_newcomer_and_stays() -> None:
    bench = Bench(uid=bytes([5] * 12))
    bench.run(2.0)
    announced = len(bench.messages(Kind.IDENTITY))
    bench.hear(Identity(bench.node, 0, bytes([1, 1, 0, 0, 1, 0])))
    bench.hear(Identity(bench.node, 1, bytes([6] * 6)))
    bench.run(1.0)
    assert bench.core.refusal == 0
    assert len(bench.messages(Kind.IDENTITY)) == announced + 6


def test_wrong_layout_is_refused_loudly_and_forgiven() -> None:
    bench = Bench()
    bench.run(2.0)
    for seq in range(3):
        bench.hear(Sync(seq, layout=2))
        bench.run(0.1)
    assert bench.core.refusal == 2
    assert bench.messages(Kind.IDENTITY)[-6].payload[5] == 2
    bench.board.sent.clear()
    for seq in range(3, 6):
        bench.hear(Sync(seq))
        bench.run(0.1)
    assert bench.core.refusal == 0
    bench.run(1.0)
    assert len(bench.messages(Kind.GYRO)) >= 100


def test_bus_off_loses_the_old_and_rejoins() -> None:
    bench = Bench()
    bench.run(2.0)
    bench.core.set_bus_off(True)
    seq_before = bench.messages(Kind.SAMPLE)[-1].seq
    bench.run(0.2)
    assert not bench.core.is_bus_off
    marks = bench.messages(Kind.SAMPLE)
    assert (marks[-1].seq - seq_before) % 256 == 20
    bench.run(1.2)
    account = bench.counters()
    assert account["can_bus_off"] == 1
    lost = (account["samples_sent"]) - len({m.t_local_us for m in bench.messages(Kind.SAMPLE)})
    assert lost <= 0 or account["can_tx_dropped"] >= lost


def test_an_error_in_the_board_is_raised_by_step() -> None:
    bench = Bench()

    def broken(register: int, length: int) -> bytes:
        raise ZeroDivisionError

    bench.board.imu_read = broken
    bench.core.close()
    fresh = type(bench.core)(bench.board, node=1)
    bench.board.time_us += 700_000
    fresh.step()  # resets the chip
    bench.board.time_us += 700_000
    with pytest.raises(ZeroDivisionError):
        fresh.step()
    fresh.close()
    with pytest.raises(ValueError, match="closed"):
        fresh.step()
