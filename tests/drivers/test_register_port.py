"""Access that repeats what failed: how often, what it counts, what it gives up with."""

from collections import Counter

import pytest

from drivers.errors import BusError, DeviceNotFoundError
from drivers.register_port import PatientRegisters


class ScriptedPort:
    """Fails as often as it is told; keeps what is written, save for the registers that do not."""

    address_bytes = 1
    taken_ns = None

    def __init__(self, failures: int = 0, deaf: frozenset[int] = frozenset()) -> None:
        self.counters: Counter[str] = Counter()
        self.content = bytearray(16)
        self._failures, self._deaf = failures, deaf

    def _fail(self) -> None:
        if self._failures:
            self._failures -= 1
            msg = "no acknowledge"
            raise BusError(msg)

    def read(self, register: int, length: int) -> bytes:
        self._fail()
        return bytes(self.content[register : register + length])

    def write(self, register: int, data: bytes) -> None:
        self._fail()
        if register not in self._deaf:
            self.content[register : register + len(data)] = data

    def write_blind(self, register: int, data: bytes) -> None:
        self.write(register, data)

    def settle(self) -> None:
        pass


def registers(**script) -> tuple[PatientRegisters, ScriptedPort, Counter[str]]:
    port, counters = ScriptedPort(**script), Counter()
    return PatientRegisters(port, "pod 3", counters), port, counters


def test_two_failures_are_repeated_and_counted() -> None:
    one, port, counters = registers(failures=2)
    one.write(2, b"\x05")
    assert port.content[2] == 5
    assert counters == {"retries": 2}
    assert one.read(2, 1) == b"\x05"


@pytest.mark.parametrize("call", [lambda r: r.read(0, 1), lambda r: r.write(0, b"\x00")])
def test_the_third_failure_is_the_callers(call) -> None:
    one, _, counters = registers(failures=3)
    with pytest.raises(BusError, match="no acknowledge"):
        call(one)
    assert counters == {"retries": 2}


def test_setting_that_does_not_take_is_named_with_both_values() -> None:
    one, port, counters = registers(deaf=frozenset({7}))
    one.set(6, 0x12, "MODE")
    assert port.content[6] == 0x12
    with pytest.raises(DeviceNotFoundError, match="pod 3: RANGE reads 0x00, expected 0x34"):
        one.set(7, 0x34, "RANGE")
    assert counters == {"retries": 3}
