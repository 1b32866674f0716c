"""Scripted ends of the I2C bus and of the serial line, for what the simulated chip does not do."""

from collections import deque


class ScriptedI2c:
    """A bus that answers from a script of bytes and errors; repeats the last entry."""

    def __init__(self, *script) -> None:
        self.script = deque(script)
        self.writes: list[tuple[int, int, bytes]] = []

    def _next(self):
        entry = self.script.popleft() if len(self.script) > 1 else self.script[0]
        if isinstance(entry, Exception):
            raise entry
        return entry

    def read_i2c_block_data(self, i2c_addr, register, length):
        return list(self._next())

    def write_i2c_block_data(self, i2c_addr, register, data) -> None:
        self.writes.append((i2c_addr, register, bytes(data)))
        self._next()

    def close(self) -> None:
        pass


class ScriptedSerial:
    """A line that gives one scripted answer per complete request and keeps what was sent."""

    def __init__(self, clock, *answers: bytes) -> None:
        self.timeout: float | None = None
        self.sent: list[tuple[int, bytes]] = []
        self._clock = clock
        self._answers = deque(answers)
        self._request = bytearray()
        self._input = bytearray()

    def push(self, data: bytes) -> None:
        """Let bytes lie in the receive buffer."""
        self._input += data

    def write(self, data: bytes) -> int:
        self.sent.append((self._clock.now_ns(), bytes(data)))
        self._request += data
        is_read = len(self._request) >= 4 and self._request[1] == 1
        if is_read or (len(self._request) >= 4 and len(self._request) == 4 + self._request[3]):
            self._request.clear()
            if self._answers:
                self._input += self._answers.popleft()
        return len(data)

    def read(self, size: int = 1) -> bytes:
        taken = bytes(self._input[:size])
        del self._input[:size]
        if len(taken) < size and self.timeout:
            self._clock.advance(round(self.timeout * 1e9))
        return taken

    def reset_input_buffer(self) -> None:
        self._input.clear()

    def close(self) -> None:
        pass
