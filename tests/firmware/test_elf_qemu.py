"""The serial ELF in QEMU, in real time: the chip on its UART, SLCAN into our own logger."""

import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import can
import numpy as np
import pytest
from bench import Wobble
from flight_account import account_of, assert_account_closes, places_of

from drivers.can.pod.codec import decode, encode
from drivers.can.pod.messages import Axes, ConfigKey, ConfigRequest, Kind, Sample, Status

pytestmark = pytest.mark.qemu_arm

NODE = 15  # QEMU's GPIO reads zero: all straps grounded
SCALE_RAD_S = math.radians(2000 / 32768)


@contextmanager
def pod_in_qemu(elf: Path) -> Iterator[tuple]:
    """Yield the emulator, and the gyro words that the chip has put on its line, in order."""
    from emulator import ChipOnPty, Emulator

    chip = ChipOnPty(Wobble())
    reads: list[tuple[int, ...]] = []
    plain_read = chip.chip.read

    def read(register: int, length: int, t_ns: int) -> bytes:
        data = plain_read(register, length, t_ns)
        if register in (0x08, 0x14):  # all sensors, or the gyro alone
            reads.append(tuple(np.frombuffer(data[-6:], dtype="<i2").tolist()))
        return data

    chip.chip.read = read
    emulator = Emulator(elf, chip.path)
    try:
        yield emulator, reads
    finally:
        emulator.close()
        chip.close()


@pytest.fixture
def toml(tmp_path: Path):
    def write(channel: str) -> Path:
        path = tmp_path / "pod.toml"
        path.write_text(
            f"[wing]\nspan_m = 1.5\n[[pods]]\nid = 0\ns_m = 1.0\n"
            f'link = {{ kind = "can", interface = "slcan", channel = "{channel}", '
            f"node = {NODE} }}\n",
            encoding="utf-8",
        )
        return path

    return write


def test_slcan_carries_the_chips_words_and_takes_requests(serial_elf: Path) -> None:
    with pod_in_qemu(serial_elf) as (emulator, reads):
        bus = can.Bus(
            interface="slcan", channel=emulator.can_path, sleep_after_open=0, bitrate=500000
        )
        frames = []
        try:
            while sum(isinstance(m, Sample) for m in frames) < 300:
                message = bus.recv(5.0)
                assert message is not None, "the pod fell silent"
                frames.append(decode(message.arbitration_id, bytes(message.data)))
            asked, data = encode(ConfigRequest(NODE, 1, ConfigKey.STREAMS, 1))
            bus.send(can.Message(arbitration_id=asked, data=data, is_extended_id=False))
            # A remote frame and an extended one are refused, and the pod goes on.
            bus.send(can.Message(arbitration_id=asked, is_remote_frame=True, is_extended_id=False))
            bus.send(can.Message(arbitration_id=asked, data=data, is_extended_id=True))
            while not (isinstance(frames[-1], Axes) and frames[-1].kind is Kind.ACCEL):
                message = bus.recv(5.0)
                assert message is not None, "the pod fell silent after a request"
                frames.append(decode(message.arbitration_id, bytes(message.data)))
        finally:
            bus.shutdown()
    gyros = [(m.x, m.y, m.z) for m in frames if isinstance(m, Axes) and m.kind is Kind.GYRO]
    places_of(gyros[:300], reads)
    seqs = [m.seq for m in frames if isinstance(m, Sample)]
    assert all((b - a) % 256 == 1 for a, b in pairwise(seqs))
    assert [m.state for m in frames if isinstance(m, Status)][-1] == 1


def fly(serial_elf: Path, toml, log: Path, duration_s: int) -> None:
    with pod_in_qemu(serial_elf) as (emulator, reads):
        command = ["run", str(toml(emulator.can_path)), "--duration", str(duration_s)]
        done = subprocess.run(
            [sys.executable, "-m", "avionics", *command, "--force", "-o", str(log)],
            capture_output=True,
            text=True,
            check=False,
            timeout=duration_s + 90,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        words = list(reads)
    account = account_of(log, "0", SCALE_RAD_S)
    assert_account_closes(account, words)
    assert account.lost <= 0.02 * account.sent
    # Stalls of an oversubscribed host cost samples (spec: bounds stay wide).
    assert account.logged > 0.7 * 100 * (duration_s - 1)


def test_our_logger_reads_it(serial_elf: Path, toml, tmp_path: Path) -> None:
    fly(serial_elf, toml, tmp_path / "pod.mcap", 10)


@pytest.mark.proof
def test_our_logger_reads_it_for_a_minute(serial_elf: Path, toml, tmp_path: Path) -> None:
    fly(serial_elf, toml, tmp_path / "pod.mcap", 60)
