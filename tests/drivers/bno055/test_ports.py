"""Registers over I2C and UART: errors by number, pacing, silence, answers that do not fit."""

import itertools

import pytest

from drivers.bno055.ports import I2cRegisterPort, Tca9548a, UartRegisterPort
from drivers.errors import BusError, BusTimeoutError, FrameFormatError
from sim_bus.clock import SimClock
from tests.drivers.bno055_scripts import ScriptedI2c, ScriptedSerial

MS = 1_000_000


@pytest.mark.parametrize(
    ("number", "counter", "kind"),
    [
        (5, "i2c_io", BusError),
        (11, "i2c_arbitration_lost", BusError),
        (110, "i2c_timeout", BusTimeoutError),
        (121, "i2c_nak", BusError),
        (6, "i2c_nak", BusError),
        (107, "i2c_other", BusError),
    ],
)
def test_kernel_errors_are_told_apart_by_number(number, counter, kind) -> None:
    port = I2cRegisterPort(ScriptedI2c(OSError(number, "text")), 0x28)
    with pytest.raises(kind, match=rf"read of register 0x14 at 0x28: text \(errno {number}\)"):
        port.read(0x14, 6)
    with pytest.raises(kind, match="write of register 0x07"):
        port.write(0x07, b"\x00")
    assert port.counters == {counter: 2}


def test_short_i2c_answer_is_an_error() -> None:
    port = I2cRegisterPort(ScriptedI2c(b"\x00\x01"), 0x28)
    with pytest.raises(BusError, match="2 bytes, expected 6"):
        port.read(0x14, 6)


def test_multiplexer_is_switched_only_when_needed_and_again_after_an_error() -> None:
    bus = ScriptedI2c(bytes(1))
    mux = Tca9548a(bus, 0x70)
    left, right = (I2cRegisterPort(bus, 0x28, mux=mux, channel=c) for c in (0, 3))
    left.read(0, 1)
    left.read(0, 1)
    right.read(0, 1)
    assert bus.writes == [(0x70, 1, b"\x01"), (0x70, 8, b"\x08")]
    bus.script[0] = OSError(121, "nak")
    with pytest.raises(BusError):
        right.read(0, 1)
    bus.script[0] = bytes(1)
    right.read(0, 1)
    assert bus.writes[-1] == (0x70, 8, b"\x08")
    assert len(bus.writes) == 3


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
