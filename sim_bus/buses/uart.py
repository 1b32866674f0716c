"""A simulated BNO055 behind the methods of ``serial.Serial`` that the driver uses.

The chip's UART protocol at byte level (BNO055 data sheet rev. 1.4, Sec. 4.7): requests parsed byte
by byte, answers that come byte by byte, status codes, the overrun that real chips show when more
than two bytes come at once, and deafness after an error until the line has been quiet.
"""

from collections import deque

from drivers.clock import Clock
from sim_bus.buses.faults import FaultPlan
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.bno055.registers import SYS_TRIGGER
from sim_bus.chip.sim_chip import ChipSilentError

START, READ, WRITE, ANSWER, STATUS = 0xAA, 0x01, 0x00, 0xBB, 0xEE
WRITE_DONE, WRITE_REFUSED, WRONG_START, OVERRUN = 0x01, 0x05, 0x06, 0x07
TOO_LONG, TOO_SHORT, BYTE_TIMEOUT = 0x08, 0x09, 0x0A
LONGEST = 128
BYTE_TIMEOUT_NS, QUIET_NS, THINKING_NS = 30_000_000, 30_000_000, 1_000_000
# Linux kernel, drivers/iio/imu/bno055/bno055_ser_core.c: four bytes at once often overrun.
BURST_BYTES, BURST_OVERRUN, SPORADIC_OVERRUN = 2, 0.3, 0.002


class SimSerialPort:
    """A serial line with one chip at its end.

    Parameters
    ----------
    chip : SimBno055
        The chip.
    clock : Clock
        The rig's clock; ``read`` lets the time pass that the answer takes.
    target : str
        Name under which faults find the chip.
    faults : FaultPlan
        What goes wrong, and the dice for overruns.
    baud : int
        Line rate.
    overruns : bool
        Whether the chip overruns without an injected fault.
    """

    def __init__(
        self,
        chip: SimBno055,
        clock: Clock,
        *,
        target: str = "*",
        faults: FaultPlan | None = None,
        baud: int = 115200,
        overruns: bool = True,
    ) -> None:
        self.timeout: float | None = 0.1
        self.is_open = True
        self._chip, self._clock, self._target = chip, clock, target
        self._faults = FaultPlan() if faults is None else faults
        self._byte_ns = round(10e9 / baud)
        self._overruns = overruns
        self._request = bytearray()
        self._line_free_ns = 0
        self._last_byte_ns = 0
        self._is_deaf = False
        self._output: deque[tuple[int, int]] = deque()

    @property
    def in_waiting(self) -> int:
        """Number of bytes received and not read."""
        now_ns = self._clock.now_ns()
        return sum(1 for due_ns, _ in self._output if due_ns <= now_ns)

    @property
    def next_ns(self) -> int | None:
        """When the next byte of an answer is complete, ns; None if none is on its way."""
        return self._output[0][0] if self._output else None

    def write(self, data: bytes) -> int:
        """Send bytes to the chip."""
        self._check_open()
        now_ns = self._clock.now_ns()
        self._faults.apply_to_chip(self._chip, self._target, now_ns)
        start_ns = max(now_ns, self._line_free_ns)
        for position, value in enumerate(data):
            self._on_byte(value, start_ns + (position + 1) * self._byte_ns, position)
        self._line_free_ns = start_ns + len(data) * self._byte_ns
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Return up to ``size`` bytes; fewer when ``timeout`` passes first."""
        self._check_open()
        now_ns = self._clock.now_ns()
        give_up_ns = now_ns + round(1e9 * (self.timeout if self.timeout is not None else 1e3))
        if len(self._output) >= size:
            wanted_ns = self._output[size - 1][0]
            self._clock.sleep_until_ns(min(wanted_ns, give_up_ns))
        else:
            self._clock.sleep_until_ns(give_up_ns)
        now_ns = self._clock.now_ns()
        taken = bytearray()
        while self._output and len(taken) < size and self._output[0][0] <= now_ns:
            taken.append(self._output.popleft()[1])
        return bytes(taken)

    def reset_input_buffer(self) -> None:
        """Drop what was received and not read; what is still on its way comes later."""
        now_ns = self._clock.now_ns()
        while self._output and self._output[0][0] <= now_ns:
            self._output.popleft()

    def flush(self) -> None:
        """Wait until everything written has left."""
        self._clock.sleep_until_ns(self._line_free_ns)

    def close(self) -> None:
        """Release the port."""
        self.is_open = False

    def _check_open(self) -> None:
        if not self.is_open:
            msg = "simulated serial port is closed"
            raise OSError(msg)

    def _on_byte(self, value: int, t_ns: int, position: int) -> None:
        gap_ns, self._last_byte_ns = t_ns - self._last_byte_ns, t_ns
        if self._is_deaf:
            if gap_ns < QUIET_NS:
                return
            self._is_deaf = False
        if self._request and gap_ns > BYTE_TIMEOUT_NS:
            self._request.clear()
        if not self._request and value != START:
            self._fail(WRONG_START, t_ns)
            return
        self._request.append(value)
        if position >= BURST_BYTES and self._is_overrun():
            self._fail(OVERRUN, t_ns)
            return
        if len(self._request) >= 4:
            self._on_header(t_ns)

    def _is_overrun(self) -> bool:
        return self._overruns and bool(self._faults.rng.random() < BURST_OVERRUN / 2)

    def _on_header(self, t_ns: int) -> None:
        command, register, length = self._request[1:4]
        if command not in (READ, WRITE):
            self._fail(WRONG_START, t_ns)
        elif length == 0:
            self._fail(TOO_SHORT, t_ns)
        elif length > LONGEST:
            self._fail(TOO_LONG, t_ns)
        elif command == READ or len(self._request) == 4 + length:
            data = bytes(self._request[4:])
            self._request.clear()
            self._serve(command, register, length, data, t_ns)

    def _serve(self, command: int, register: int, length: int, data: bytes, t_ns: int) -> None:
        if self._faults.strikes("uart_silence", self._target, t_ns):
            return
        is_sporadic = self._overruns and self._faults.rng.random() < SPORADIC_OVERRUN
        if is_sporadic or self._faults.strikes("uart_overrun", self._target, t_ns):
            self._fail(OVERRUN, t_ns)
            return
        try:
            if command == READ:
                content = self._chip.read(register, length, t_ns)
                self._answer(bytes([ANSWER, length]) + content, t_ns)
                return
            is_writable = self._chip.is_writable(register)
            self._chip.write(register, data, t_ns)
        except ChipSilentError:
            return
        if register == SYS_TRIGGER and data[0] & 0x20:
            return  # a soft reset gives no answer
        self._answer(bytes([STATUS, WRITE_DONE if is_writable else WRITE_REFUSED]), t_ns)

    def _fail(self, code: int, t_ns: int) -> None:
        self._request.clear()
        self._is_deaf = True
        self._answer(bytes([STATUS, code]), t_ns)

    def _answer(self, content: bytes, t_ns: int) -> None:
        faults, target = self._faults, self._target
        if faults.strikes("uart_garbage", target, t_ns):
            content = bytes(faults.rng.integers(0, 256, len(content)).tolist())
        if faults.strikes("uart_truncate", target, t_ns):
            content = content[: len(content) // 2]
        start_ns = t_ns + THINKING_NS
        late = faults.active("uart_late", target, t_ns)
        if late is not None and faults.strikes("uart_late", target, t_ns):
            start_ns += round(late.value * 1e9)
        if self._output:
            start_ns = max(start_ns, self._output[-1][0])
        for position, value in enumerate(content):
            self._output.append((start_ns + (position + 1) * self._byte_ns, value))
