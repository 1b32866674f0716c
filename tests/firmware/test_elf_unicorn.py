"""The flight ELF in Unicorn: its register code against modelled I2C, bxCAN, SysTick and clocks."""

import itertools
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bench import Bench, Wobble, kind_of

from drivers.can.pod.codec import decode, encode
from drivers.can.pod.messages import (
    COUNTER_NAMES,
    ConfigKey,
    ConfigRequest,
    FollowUp,
    Kind,
    Sync,
)
from sim_bus.chip.bno055.registers import Mode

pytestmark = pytest.mark.unicorn

# Steps are counted with 9 bytes of I2C polled at 22.5 us; what is counted is the firmware's work.
STEP_LIMIT = 40_000
STACK_LIMIT = 2048


@pytest.fixture
def machine(flight_elf: Path):
    from machine import Machine

    machine = Machine(flight_elf, Wobble())
    machine.paint_stack()
    return machine


def messages(machine, kind: Kind | None = None) -> list:
    found = [decode(f.id, f.data) for f in machine.can.sent]
    return [m for m in found if kind is None or kind_of(m) is kind]


def counters(machine) -> dict[str, int]:
    machine.run(1.2)
    found: dict[str, int] = {}
    for page in messages(machine, Kind.COUNTERS):
        found.update(zip(COUNTER_NAMES[page.page], page.values, strict=True))
    return found


def hear(machine, message) -> bool:
    from stm32_models import CanFrame

    frame_id, data = encode(message)
    return machine.can.hear(CanFrame(frame_id, data))


def gyro_bursts(machine) -> list[tuple[int, int, int]]:
    reads = [data[-6:] for register, _, data in machine.i2c.read_log if register == 0x14]
    return [tuple(np.frombuffer(data, dtype="<i2").tolist()) for data in reads]


def test_10000_samples_are_the_chips_bit_for_bit(machine) -> None:
    machine.run(1.0)
    assert machine.chip.mode is Mode.AMG
    counts = {0x00: 4, 0x3B: 1, 0x0A: 1, 0x50: 16, 0x14: 6, 0x34: 10}
    machine.run(100.0)
    # Not a byte more or less was clocked in than asked for: acknowledge and STOP came in time.
    assert all(counts[register] == count for register, count, _ in machine.i2c.read_log)
    rates = [(m.x, m.y, m.z) for m in messages(machine, Kind.GYRO)]
    bursts = gyro_bursts(machine)  # the last is entered when the next begins
    assert len(rates) >= 10_000
    assert abs(len(rates) - len(bursts)) <= 1
    assert all(sent == read for sent, read in zip(rates, bursts, strict=False))
    marks = messages(machine, Kind.SAMPLE)
    assert [m.seq for m in marks] == [i % 256 for i in range(len(marks))]
    steps = np.diff([m.t_local_us for m in marks]) % (1 << 24)
    assert abs(steps - 10_000).max() <= 20  # one or two looks at the clock
    account = counters(machine)
    assert account["samples_sent"] >= 10_000
    assert not any(v for k, v in account.items() if k != "samples_sent")
    # Whatever the core did, the watchdog's shortest period (0.34 s) was kept by a wide margin.
    assert machine.watchdog.is_started
    assert machine.watchdog.longest_ns < 30_000_000


def test_stack_stays_below_the_bound_of_the_call_graph(machine, flight_elf: Path) -> None:
    sys.path.insert(0, str(flight_elf.parents[1]))
    try:
        from report import stack_bound
    finally:
        sys.path.pop(0)
    bound, _path = stack_bound(flight_elf.with_suffix(""))
    machine.run(2.0)
    hear(machine, ConfigRequest(3, 1, ConfigKey.GYRO_RANGE_DPS, 500))
    machine.lines.hold_clocks = 3
    machine.run(3.0)
    assert 200 < machine.stack_used() <= bound <= STACK_LIMIT


def test_worst_step_is_short(machine) -> None:
    machine.run(0.5)
    steps = machine.count_steps()
    machine.run(1.5)
    for seq in range(20):
        hear(machine, Sync(seq, trigger=True))
        hear(machine, FollowUp(seq, 1_000_000 + seq * 10_000))
        hear(machine, ConfigRequest(3, seq, ConfigKey.IDENTIFY, 0))
        machine.run(0.01)
    assert machine.chip.mode is Mode.AMG
    assert max(steps) < STEP_LIMIT


def test_clock_stretching_of_a_real_chip_keeps_the_rate(machine) -> None:
    machine.i2c.byte_ns = 180_000  # Bosch forum; 9 bytes on the wire are 1.6 ms
    machine.run(2.0)
    machine.can.sent.clear()
    machine.run(2.0)
    assert len(messages(machine, Kind.SAMPLE)) in (199, 200, 201)


def test_naks_cost_samples_only(machine) -> None:
    machine.run(2.0)
    machine.i2c.faults = ["nak"] * 2
    machine.can.sent.clear()
    machine.run(1.0)
    assert len(messages(machine, Kind.SAMPLE)) in (97, 98, 99)
    account = counters(machine)
    assert (account["nak"], account["sample_missed"], account["reinit"]) == (2, 2, 0)


def test_i2c_control_is_left_alone_until_start_and_stop_are_out(machine) -> None:
    machine.run(2.0)
    machine.i2c.faults = ["nak", "hang", "nak"]
    machine.run(0.5)
    machine.lines.hold_clocks = 7
    machine.run(3.0)
    assert messages(machine, Kind.STATUS)[-1].state == 1
    assert machine.i2c.early_writes == 0


@pytest.mark.parametrize("flags", [0x08, 0x28], ids=["overrun alone", "with a byte"])
@pytest.mark.parametrize("port", [3, 6])
def test_overrun_of_a_uart_raises_no_second_interrupt(serial_elf: Path, port, flags) -> None:
    from machine import Machine

    machine = Machine(serial_elf, Wobble())
    machine.run(0.1)
    usart = {3: machine.usart3, 6: machine.usart6}[port]
    usart.sr, usart.dr = flags, 0x55
    machine.call(f"USART{port}_Handler")
    assert not usart.interrupts


def test_stuck_bus_is_freed_by_clocks(machine) -> None:
    machine.run(2.0)
    machine.lines.hold_clocks = 7
    clocks = machine.lines.clocks_seen
    machine.run(0.5)
    assert machine.lines.clocks_seen - clocks >= 7
    assert not machine.lines.is_stuck
    machine.can.sent.clear()
    machine.run(2.0)
    assert len(messages(machine, Kind.SAMPLE)) > 190
    account = counters(machine)
    assert account["bus_recovery"] == 1
    assert account["bus_timeout"] >= 3


def test_bus_held_for_good_does_not_hold_the_pod(machine) -> None:
    machine.run(2.0)
    machine.lines.hold_clocks = 10**9
    machine.can.sent.clear()
    machine.run(5.0)
    assert len(messages(machine, Kind.STATUS)) == 5
    assert messages(machine, Kind.STATUS)[-1].state in (2, 3)
    assert machine.watchdog.longest_ns < 100_000_000
    machine.lines.hold_clocks = 2
    machine.run(4.0)
    assert messages(machine, Kind.STATUS)[-1].state == 1


def test_chip_brown_out_is_noticed(machine) -> None:
    machine.run(2.0)
    machine.can.sent.clear()
    machine.chip.brown_out(machine.now, silent_ns=0)
    machine.run(3.0)
    rates = [(m.x, m.y, m.z) for m in messages(machine, Kind.GYRO)]
    assert (0, 0, 0) not in rates
    assert len(rates) > 150
    assert counters(machine)["reinit"] == 1


def test_pod_brown_out_boots_and_says_so(machine) -> None:
    machine.run(2.0)
    machine.rcc.reset_flags = 1 << 25 | 1 << 26
    machine.can.sent.clear()
    machine.boot()
    machine.run(2.0)
    assert messages(machine, Kind.IDENTITY)[0].payload[4] == 5
    assert len(messages(machine, Kind.SAMPLE)) > 100


def test_watchdog_resets_are_counted_over_resets(machine) -> None:
    for _ in range(3):
        machine.run(0.5)
        machine.rcc.reset_flags = 1 << 29
        machine.boot()
    machine.can.sent.clear()
    machine.run(2.0)
    assert messages(machine, Kind.IDENTITY)[0].payload[4] == 3
    assert counters(machine)["watchdog_reset"] == 3


def test_bus_off_is_left_and_counted(machine) -> None:
    machine.run(2.0)
    machine.can.is_bus_off = True
    machine.run(0.3)
    assert machine.can.rejoins == 1
    machine.can.sent.clear()
    machine.run(1.0)
    assert len(messages(machine, Kind.SAMPLE)) > 95
    assert counters(machine)["can_bus_off"] == 1


def test_silent_bus_fills_the_queue_and_loses_the_oldest(machine) -> None:
    machine.run(2.0)
    machine.can.is_blocked = True  # no other node acknowledges
    machine.run(1.0)
    machine.can.is_blocked = False
    machine.can.sent.clear()
    machine.run(0.2)
    seqs = [m.seq for m in messages(machine, Kind.SAMPLE)]
    assert len(seqs) > 30
    # One frame had waited in its mailbox; the rest is the newest, without a gap.
    gaps = [(b - a) % 256 for a, b in pairwise(seqs)]
    assert sum(g != 1 for g in gaps) <= 1
    assert counters(machine)["can_tx_dropped"] > 100


def test_sync_by_interrupt_triggers_within_200_us(machine) -> None:
    machine.run(2.0)
    hear(machine, ConfigRequest(3, 1, ConfigKey.SAMPLING, 1))
    machine.run(0.1)
    machine.can.sent.clear()
    for seq in range(100):
        hear(machine, Sync(seq, trigger=True))
        machine.run(0.01)
    marks = [m for m in messages(machine, Kind.SAMPLE) if m.triggered]
    replies = messages(machine, Kind.SYNC_REPLY)
    assert len(marks) == len(replies) == 100
    # From the reception to the middle of the burst, whose length is the same in every pod.
    delays = [m.t_local_us - r.t_local_us & 0xFFFFFF for m, r in zip(marks, replies, strict=True)]
    assert max(delays) - min(delays) <= 200
    assert counters(machine)["sample_late"] == 0


def test_two_step_sync_follows_the_master(machine) -> None:
    machine.run(1.5)
    for seq in range(50):
        left_us = 9_000_000_000 + machine.now // 1000
        hear(machine, Sync(seq))
        machine.run(0.002)
        hear(machine, FollowUp(seq, left_us))
        machine.run(0.048)
    replies = messages(machine, Kind.SYNC_REPLY)
    assert max(abs(r.error_us) for r in replies[10:]) < 1100  # interrupts wait for the next tick
    assert messages(machine, Kind.SAMPLE)[-1].synced


def test_settings_reach_the_chip(machine) -> None:
    machine.run(1.5)
    hear(machine, ConfigRequest(3, 5, ConfigKey.GYRO_RANGE_DPS, 250))
    machine.run(0.5)
    hear(machine, ConfigRequest(3, 6, ConfigKey.STREAMS, 3))
    machine.run(0.5)
    replies = [(r.token, r.result) for r in messages(machine, Kind.CONFIG_REPLY)]
    assert replies == [(5, 0), (6, 0)]
    assert machine.chip.gyro_rad_s_per_lsb == pytest.approx(np.radians(250 / 32768))
    assert messages(machine, Kind.SAMPLE)[-1].has_mag
    assert {count for register, count, _ in machine.i2c.read_log if register == 0x08} == {18}


def test_number_is_stored_and_used_after_a_reset(flight_elf: Path) -> None:
    from machine import Machine

    machine = Machine(flight_elf, Wobble(), node=0)
    machine.gpio_c.inputs |= 1 << 4  # the straps do not count
    machine.run(1.5)
    assert {f.id & 15 for f in machine.can.sent} == {15}
    assert messages(machine, Kind.IDENTITY)[0].payload[5] == 3
    assert not messages(machine, Kind.GYRO)
    for token, node in ((1, 6), (2, 9)):
        hear(machine, ConfigRequest(15, token, ConfigKey.NODE, node))
        machine.run(0.1)
    hear(machine, ConfigRequest(15, 3, ConfigKey.RESET, 0x52535421))
    machine.run(0.1)
    assert machine.resets == 1
    machine.can.sent.clear()
    machine.run(2.0)
    assert {f.id & 15 for f in machine.can.sent} == {9}
    assert messages(machine, Kind.IDENTITY)[0].payload[4:] == bytes((4, 0))


def test_filters_keep_other_pods_out(machine) -> None:
    from stm32_models import CanFrame

    machine.run(1.0)
    passed = {i for i in range(0x800) if machine.can._passes(CanFrame(i, b""))}
    assert passed == {0x080, 0x081} | {i for i in range(0x400) if i & 15 == 3}
    assert not machine.can._passes(CanFrame(0x080, b"", is_extended=True))


def test_malformed_frames_are_counted_and_change_nothing(machine) -> None:
    from stm32_models import CanFrame

    machine.run(2.0)
    sent = 0
    for base in (0x080, 0x081, 0x103, 0x203, 0x303):
        for length in range(9):
            for is_remote in (False, True):
                assert machine.can.hear(CanFrame(base, bytes(length), is_remote=is_remote))
                sent += 1
                machine.run(0.001)
    machine.can.sent.clear()
    machine.run(1.0)
    assert len(messages(machine, Kind.SAMPLE)) in (99, 100, 101)
    assert counters(machine)["can_rx_bad"] == sent
    assert messages(machine, Kind.STATUS)[-1].state == 1


def test_clocks_from_crystal_oscillator_or_neither(flight_elf: Path) -> None:
    from machine import Machine

    for has_crystal, has_pll, core_hz, apb1_hz in (
        (True, True, 168_000_000, 42_000_000),
        (False, True, 168_000_000, 42_000_000),
        (True, False, 16_000_000, 16_000_000),
    ):
        machine = Machine(flight_elf, Wobble())
        machine.rcc.has_crystal, machine.rcc.has_pll = has_crystal, has_pll
        machine.run(2.0)
        assert machine.systick[0x14] + 1 == core_hz // 1000
        timing = machine.can.words[0x1C]
        quanta = 3 + (timing >> 16 & 15) + (timing >> 20 & 7)
        assert apb1_hz / ((timing & 0x3FF) + 1) / quanta == 500_000
        sample_point = (quanta - 1 - (timing >> 20 & 7)) / quanta
        assert 0.84 < sample_point < 0.89  # CiA 601 recommends 87.5 %
        assert machine.i2c.words[0x04] == apb1_hz // 1_000_000
        assert machine.i2c.words[0x1C] & 0xFFF == pytest.approx(apb1_hz / 1.2e6, abs=1)
        assert len(messages(machine, Kind.SAMPLE)) > 100
        uses_hse = machine.rcc.words[0x04] >> 22 & 1
        assert uses_hse == (1 if has_crystal else 0)


def test_host_library_and_elf_send_the_same_frames(machine) -> None:
    """One source, two compilers: the same registers give the same rate frames to the byte."""
    plain_read, count = machine.chip.read, itertools.count(1)

    def read(register: int, length: int, t_ns: int) -> bytes:
        data = plain_read(register, length, t_ns)
        if register == 0x14 and next(count) % 29 == 0:  # a spike, which both have to read again
            data = data[:5] + bytes((data[5] ^ 0x80,)) + data[6:]
        return data

    machine.chip.read = read
    machine.run(3.0)
    bursts = [data for register, _, data in machine.i2c.read_log if register == 0x14]
    elf = [f.data for f in machine.can.sent if f.id == Kind.GYRO + 3]
    assert len(elf) > 200
    assert len(bursts) > len(elf)

    bench = Bench()
    others, replayed = bench.board.imu_read, iter(bursts)
    bench.board.imu_read = lambda r, n: next(replayed) if r == 0x14 else others(r, n)
    while len(bench.messages(Kind.GYRO)) < len(elf) - 1:  # the last burst is not in the log yet
        bench.run(0.01)
    host = [data for _, frame_id, data in bench.board.sent if frame_id == Kind.GYRO + 3]
    assert host == elf[: len(host)]

    def ids(found) -> set:
        return {(m.part, m.payload) for m in found if m.part > 0}

    assert ids(messages(machine, Kind.IDENTITY)) == ids(bench.messages(Kind.IDENTITY))


def test_elf_is_small_enough(flight_elf: Path, serial_elf: Path) -> None:
    report = Path(flight_elf).parents[1] / "report.py"
    done = subprocess.run(
        [sys.executable, str(report), str(flight_elf), str(serial_elf)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
