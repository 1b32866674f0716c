"""The driver on a genuine pty, in real time: the matrix's faults, and answers in pieces."""

import contextlib
import os
import threading
import tty
from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest
import serial

from avionics.config import Pod
from avionics.config.links import UartLink
from drivers.bno055.device import Bno055
from drivers.bno055.ports import UartRegisterPort
from drivers.bno055.registers import Mode
from drivers.bno055.settings import Settings
from drivers.clock import SteadyClock
from drivers.errors import BusTimeoutError, DeviceNotFoundError
from drivers.polled_imus import PolledImus
from drivers.reopening import ReopeningSerial
from sim_bus.bench.pty_uart import PtyUart
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.uart import SimSerialPort
from tests.drivers import genuine
from tests.drivers.fault_matrix import CASES, Case
from tests.opening import open_imus

pytestmark = pytest.mark.alone
Z_RAD_S = -0.3


def open_line(path: str) -> ReopeningSerial:
    return ReopeningSerial(
        partial(serial.Serial, path, 115200, timeout=0.05, write_timeout=0.5, exclusive=True)
    )


@pytest.fixture(scope="module")
def flight() -> Iterator[genuine.Flight]:
    clock, plan = SteadyClock(), FaultPlan([], np.random.default_rng(2))
    port = SimSerialPort(
        genuine.make_chip(Z_RAD_S), clock, target="pod 0", faults=plan, overruns=False
    )
    with contextlib.closing(PtyUart(port, clock)) as pty:
        line = open_line(pty.path)
        chip = Bno055(
            UartRegisterPort(line, clock), clock, pod="0", settings=Settings(mode=Mode.AMG)
        )
        with contextlib.closing(PolledImus([chip], clock, bus=line)) as imus:
            imus.open()
            yield genuine.Flight(imus, plan)


@pytest.mark.parametrize(
    "case", [case for case in CASES if case.bus == "uart"], ids=lambda case: case.name
)
def test_fault_on_a_pty_is_survived_and_counted(flight: genuine.Flight, case: Case) -> None:
    genuine.survive(flight, case, Z_RAD_S)


class Answering:
    """The far end of a pty: answers every request of four bytes with scripted pieces."""

    def __init__(self, *answers: list[tuple[float, bytes]]) -> None:
        self._master, self._slave = os.openpty()
        for end in (self._master, self._slave):
            tty.setraw(end)
        self.path = os.ttyname(self._slave)
        self.sent = threading.Event()
        self._answers = answers
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        pause = threading.Event()
        for pieces in self._answers:
            asked = b""
            while len(asked) < 4:
                asked += os.read(self._master, 4 - len(asked))
            self.sent.clear()
            for wait_s, piece in pieces:
                pause.wait(wait_s)
                os.write(self._master, piece)
            self.sent.set()

    def close(self) -> None:
        self._thread.join(2.0)
        os.close(self._slave)
        os.close(self._master)


def test_answer_in_pieces_is_put_together() -> None:
    data = bytes(range(6))
    pieces = [(0.003, bytes([value])) for value in b"\xbb\x06" + data]
    with contextlib.closing(Answering(pieces)) as far:
        line = open_line(far.path)
        port = UartRegisterPort(line, SteadyClock())
        assert port.read(0x14, 6) == data
        assert not port.counters
        line.close()


def test_half_an_answer_that_ends_too_late_is_not_taken_for_the_next_one() -> None:
    late = [(0.0, b"\xbb\x06\x01\x02"), (0.08, b"\x03\x04\x05\x06")]
    good = [(0.0, b"\xbb\x02\x0a\x0b")]
    with contextlib.closing(Answering(late, good)) as far:
        line = open_line(far.path)
        port = UartRegisterPort(line, SteadyClock())
        with pytest.raises(BusTimeoutError, match="2 of 6 bytes"):
            port.read(0x14, 6)
        assert far.sent.wait(2.0)
        assert port.read(0x1A, 2) == b"\x0a\x0b"
        assert dict(port.counters) == {"uart_timeout": 1, "uart_late": 1}
        line.close()


def test_line_that_another_program_holds_is_said_to_be_held() -> None:
    with contextlib.closing(Answering()) as far:
        holder = serial.Serial(far.path, exclusive=True)
        pod = Pod(id=1, s_m=0.5, link=UartLink(kind="uart", port=far.path))
        with pytest.raises(DeviceNotFoundError, match="another program holds it; see `fuser -v"):
            open_imus([pod])
        holder.close()
