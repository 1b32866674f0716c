"""Registers over UART: pacing, silence, answers that do not fit."""

import itertools

import pytest

from drivers.bno055.ports import UartRegisterPort
from drivers.errors import BusError, BusTimeoutError, FrameFormatError
from sim_bus.clock import SimClock
from tests.drivers.bno055_scripts import ScriptedSerial

MS = 1_000_000


def uart(*answers: bytes):
    clock = SimClock()
    line = ScriptedSerial(clock, *answers)
    return UartRegisterPort(line, clock), line, clock


def test_request_goes_out_two_bytes_at_a_time() -> None:
    port, line, _ = uart(b"\xbb\x02\x11\x22", b"\xee\x01")
    assert port.read(0x14, 2) == b"\x11\x22"
    assert [data for _, data in line.sent] == [b"\xaa\x01", b"\x14\x02"]
    assert line.sent[1][0] - line.sent[0][0] >= 2 * MS
    port.write(0x3D, b"\x0c")
    assert [data for _, data in line.sent[2:]] == [b"\xaa\x00", b"\x3d\x01", b"\x0c"]


def test_overrun_is_repeated_after_silence() -> None:
    port, line, _ = uart(b"\xee\x07", b"\xee\x07", b"\xbb\x01\xa0")
    assert port.read(0x00, 1) == b"\xa0"
    assert port.counters == {"uart_overrun": 2}
    starts = [t for t, data in line.sent if data == b"\xaa\x01"]
    assert all(b - a >= 40 * MS for a, b in itertools.pairwise(starts))
    assert port.taken_ns >= starts[-1]


def test_endless_overrun_is_an_error() -> None:
    port, _, _ = uart(*[b"\xee\x07"] * 9)
    with pytest.raises(BusError, match="overrun in 5 attempts"):
        port.read(0x00, 1)


@pytest.mark.parametrize(
    ("answer", "counter", "kind"),
    [
        (b"\xee\x04", "uart_refused", BusError),
        (b"\xbb\x01\xa0", "uart_wrong_answer", FrameFormatError),  # one byte, six wanted
        (b"\xee\x01", "uart_wrong_answer", FrameFormatError),  # a write's answer to a read
        (b"\xbb\x00", "uart_wrong_answer", FrameFormatError),
        (b"\xdb\xff", "uart_wrong_answer", FrameFormatError),
        (b"\xbb\x06\x01\x02", "uart_timeout", BusTimeoutError),
        (b"", "uart_timeout", BusTimeoutError),
    ],
)
def test_answer_that_does_not_fit_is_refused_and_followed_by_silence(answer, counter, kind) -> None:
    port, line, clock = uart(answer, b"\xbb\x01\xa0")
    with pytest.raises(kind, match="read of register 0x14 over UART"):
        port.read(0x14, 6)
    assert port.counters == {counter: 1}
    failed_ns = clock.now_ns()
    line.reset_input_buffer()
    assert port.read(0x00, 1) == b"\xa0"
    assert next(t for t, _ in line.sent if t > failed_ns) - failed_ns >= 40 * MS


def test_read_answer_to_a_write_is_refused() -> None:
    port, _, _ = uart(b"\xbb\x01\x00")
    with pytest.raises(FrameFormatError, match="write of register 0x3D"):
        port.write(0x3D, b"\x00")


def test_late_answer_is_not_taken_for_the_next_one() -> None:
    port, line, _ = uart(b"\xbb\x01\xa0")
    line.push(b"\xbb\x01\x55")
    assert port.read(0x00, 1) == b"\xa0"
    assert port.counters == {"uart_late": 1}
