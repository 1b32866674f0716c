"""How the registers of a BNO055 are reached over UART; over I2C it is as other chips."""

from collections import Counter

from drivers.clock import Clock
from drivers.errors import BusError, BusTimeoutError, FrameFormatError
from drivers.interfaces import SerialPort

READ_ANSWER, STATUS_ANSWER = 0xBB, 0xEE
WRITE_SUCCESS, OVERRUN = 0x01, 0x07
STATUS_NAMES = {
    0x02: "read fail",
    0x03: "write fail",
    0x04: "register map invalid address",
    0x05: "register map write disabled",
    0x06: "wrong start byte",
    0x07: "bus overrun",
    0x08: "maximum length",
    0x09: "minimum length",
    0x0A: "receive character timeout",
}


class UartRegisterPort:
    """A chip on a serial line, 115200 baud 8N1.

    Parameters
    ----------
    serial : SerialPort
        ``serial.Serial`` or its simulation.
    clock : Clock
        Paces the bytes; its time also stamps the silence after an error.
    attempts : int
        How often an overrun (0x07) is answered with a repetition.

    Notes
    -----
    The chip overruns when it gets four bytes at once, so two go out at a time, and it needs 40 ms
    of silence after an error to clear its state machine (Linux driver). An answer must fit the
    request, and an answer that comes too late must not be taken for that of the next request.
    """

    address_bytes = 4
    PACE_NS = 2_000_000
    SILENCE_NS = 40_000_000
    TIMEOUT_S = 0.05

    def __init__(self, serial: SerialPort, clock: Clock, *, attempts: int = 5) -> None:
        self._serial = serial
        self._clock = clock
        self._attempts = attempts
        self._quiet_until_ns = 0
        self.counters: Counter[str] = Counter()
        self.taken_ns: int | None = None

    def read(self, register: int, length: int) -> bytes:
        """Return ``length`` (at most 128) bytes from ``register`` on."""
        return self._request(bytes((0xAA, 0x01, register, length)), length)

    def write(self, register: int, data: bytes) -> None:
        """Write ``data`` from ``register`` on."""
        self._request(bytes((0xAA, 0x00, register, len(data))) + data, 0)

    def write_blind(self, register: int, data: bytes) -> None:
        """Write where no answer comes: a soft reset."""
        self._send(bytes((0xAA, 0x00, register, len(data))) + data)
        self.settle()

    def settle(self) -> None:
        """Keep the line silent until the chip has cleared its state machine."""
        self._quiet_until_ns = self._clock.now_ns() + self.SILENCE_NS

    def _request(self, request: bytes, length: int) -> bytes:
        for attempt in range(1, self._attempts + 1):
            self._send(request)
            try:
                return self._answer(request, length)
            except _OverrunError:
                self.counters["uart_overrun"] += 1
                if attempt == self._attempts:
                    msg = f"{_name(request)}: bus overrun in {attempt} attempts"
                    raise BusError(msg) from None
        raise AssertionError

    def _send(self, request: bytes) -> None:
        self._clock.sleep_until_ns(self._quiet_until_ns)
        try:
            self._drop_late_bytes()
            for start in range(0, len(request), 2):
                if start:
                    self._clock.sleep_until_ns(self._clock.now_ns() + self.PACE_NS)
                self._serial.write(request[start : start + 2])
            self.taken_ns = self._clock.now_ns()
        except OSError as error:  # serial.SerialException is one
            raise self._failed("uart_io", f"{_name(request)}: {error}") from error

    def _drop_late_bytes(self) -> None:
        self._serial.timeout = 0.0
        late = self._serial.read(256)
        self._serial.timeout = self.TIMEOUT_S
        if late:
            self.counters["uart_late"] += 1

    def _answer(self, request: bytes, length: int) -> bytes:
        head = self._take(2, request)
        if head[0] == READ_ANSWER and length and head[1] == length:
            return self._take(length, request)
        if head[0] == STATUS_ANSWER:
            if head[1] == WRITE_SUCCESS and not length:
                return b""
            if head[1] == OVERRUN:
                self.settle()
                raise _OverrunError
            if head[1] in STATUS_NAMES:
                status = STATUS_NAMES[head[1]]
                raise self._failed("uart_refused", f"{_name(request)}: {status} (0x{head[1]:02X})")
        self.settle()
        self.counters["uart_wrong_answer"] += 1
        msg = f"{_name(request)}: answer {head.hex(' ')} does not fit the request"
        raise FrameFormatError(msg)

    def _take(self, count: int, request: bytes) -> bytes:
        try:
            data = self._serial.read(count)
        except OSError as error:
            raise self._failed("uart_io", f"{_name(request)}: {error}") from error
        if len(data) < count:
            self.settle()
            self.counters["uart_timeout"] += 1
            msg = f"{_name(request)}: {len(data)} of {count} bytes within {self.TIMEOUT_S} s"
            raise BusTimeoutError(msg)
        return data

    def _failed(self, counter: str, message: str) -> BusError:
        self.settle()
        self.counters[counter] += 1
        return BusError(message)


class _OverrunError(Exception):
    """The chip answered 0x07."""


def _name(request: bytes) -> str:
    return f"{'read' if request[1] else 'write'} of register 0x{request[2]:02X} over UART"
