import numpy as np
import pytest

from sim_bus.buses.faults import Fault, FaultPlan
from sim_bus.buses.uart import SimSerialPort
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.clock import SimClock

MS = 1_000_000


def port(wave, *faults: Fault, overruns: bool = False):
    clock = SimClock()
    chip = SimBno055(wave, np.random.default_rng(0))
    plan = FaultPlan(list(faults), np.random.default_rng(0))
    return clock, SimSerialPort(chip, clock, target="pod 0", faults=plan, overruns=overruns)


def send(clock: SimClock, p: SimSerialPort, data: bytes) -> None:
    """Two bytes at a time, as a careful driver does."""
    for start in range(0, len(data), 2):
        p.write(data[start : start + 2])
        clock.advance(2 * MS)


def test_read_request_is_answered(wave) -> None:
    clock, p = port(wave)
    send(clock, p, bytes([0xAA, 0x01, 0x00, 0x02]))
    assert p.read(4) == bytes([0xBB, 2, 0xA0, 0xFB])


def test_write_request_is_acknowledged_and_done(wave) -> None:
    clock, p = port(wave)
    send(clock, p, bytes([0xAA, 0x00, 0x3D, 0x01, 0x07]))
    assert p.read(2) == b"\xee\x01"
    clock.advance(20 * MS)
    send(clock, p, bytes([0xAA, 0x01, 0x3D, 0x01]))
    assert p.read(3) == b"\xbb\x01\x07"


def test_write_to_a_read_only_register_is_refused(wave) -> None:
    clock, p = port(wave)
    send(clock, p, bytes([0xAA, 0x00, 0x00, 0x01, 0x07]))
    assert p.read(2) == b"\xee\x05"


def test_answers_come_at_the_line_rate(wave) -> None:
    clock, p = port(wave)
    p.write(bytes([0xAA, 0x01, 0x08, 0x12]))
    start_ns = clock.now_ns()
    assert len(p.read(20)) == 20
    # 24 bytes of ten bits at 115200 baud, and a millisecond of thought.
    assert clock.now_ns() - start_ns == pytest.approx(24 * 10e9 / 115200 + MS, rel=0.01)


def test_nothing_comes_before_its_time(wave) -> None:
    clock, p = port(wave)
    p.timeout = 0.0
    p.write(bytes([0xAA, 0x01, 0x00, 0x01]))
    assert p.read(3) == b""
    assert p.in_waiting == 0
    clock.advance(5 * MS)
    assert p.in_waiting == 3
    p.reset_input_buffer()
    assert p.read(3) == b""


@pytest.mark.parametrize(
    ("request_bytes", "code"),
    [
        (bytes([0x55]), 0x06),
        (bytes([0xAA, 0x07, 0x00, 0x01]), 0x06),
        (bytes([0xAA, 0x01, 0x00, 0x00]), 0x09),
        (bytes([0xAA, 0x01, 0x00, 0x81]), 0x08),
    ],
)
def test_wrong_requests_get_their_status(wave, request_bytes: bytes, code: int) -> None:
    clock, p = port(wave)
    send(clock, p, request_bytes)
    assert p.read(2) == bytes([0xEE, code])


def test_chip_is_deaf_after_an_error_until_the_line_was_quiet(wave) -> None:
    clock, p = port(wave)
    p.timeout = 0.02
    send(clock, p, b"\x55")
    assert p.read(2) == b"\xee\x06"
    send(clock, p, bytes([0xAA, 0x01, 0x00, 0x01]))
    assert p.read(3) == b""
    clock.advance(40 * MS)
    send(clock, p, bytes([0xAA, 0x01, 0x00, 0x01]))
    assert p.read(3) == b"\xbb\x01\xa0"


def test_request_that_stops_is_forgotten_after_30_ms(wave) -> None:
    clock, p = port(wave)
    p.write(b"\xaa\x01")
    clock.advance(35 * MS)
    send(clock, p, bytes([0xAA, 0x01, 0x00, 0x01]))
    assert p.read(3) == b"\xbb\x01\xa0"


def test_four_bytes_at_once_overrun_often_and_two_rarely(wave) -> None:
    clock, p = port(wave, overruns=True)
    p.timeout = 0.02

    def overruns(at_once: bool) -> int:
        count = 0
        for _ in range(200):
            request = bytes([0xAA, 0x01, 0x00, 0x01])
            if at_once:
                p.write(request)
            else:
                send(clock, p, request)
            count += p.read(3)[:2] == b"\xee\x07"
            clock.advance(50 * MS)
        return count

    assert overruns(at_once=True) > 20
    assert overruns(at_once=False) < 6


def test_soft_reset_gives_no_answer(wave) -> None:
    clock, p = port(wave)
    send(clock, p, bytes([0xAA, 0x00, 0x3F, 0x01, 0x20]))
    assert p.read(2) == b""
    send(clock, p, bytes([0xAA, 0x01, 0x00, 0x01]))
    assert p.read(3) == b""
    clock.advance(650 * MS)
    send(clock, p, bytes([0xAA, 0x01, 0x00, 0x01]))
    assert p.read(3) == b"\xbb\x01\xa0"


@pytest.mark.parametrize(
    ("kind", "answer"),
    [("uart_silence", b""), ("uart_overrun", b"\xee\x07"), ("uart_truncate", b"\xbb")],
)
def test_faults_on_the_line(wave, kind: str, answer: bytes) -> None:
    clock, p = port(wave, Fault(kind, "pod 0", 0, 1 << 60))
    send(clock, p, bytes([0xAA, 0x01, 0x00, 0x01]))
    assert p.read(3) == answer


def test_late_answer_of_one_request_meets_the_next(wave) -> None:
    clock, p = port(wave, Fault("uart_late", "pod 0", 0, 5 * MS, value=0.15))
    p.timeout = 0.1
    send(clock, p, bytes([0xAA, 0x01, 0x00, 0x01]))
    assert p.read(3) == b""
    send(clock, p, bytes([0xAA, 0x01, 0x01, 0x01]))
    assert p.read(3) == b"\xbb\x01\xa0"
