"""End to end, in real time: a simulated wing moves the simulated chip, the ARM ELF in QEMU reads it
over its UART and speaks SLCAN on a pty, which is the serial port of a User Mode Linux guest; there
slcand makes it a SocketCAN interface and ``avionics run`` logs it. The truth joins the log
afterwards, and ``avionics evaluate`` compares."""

import math
import os
import select
import subprocess
import sys
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_account import account_of, assert_account_closes

from avionics.config import Config
from avionics.config.load import load_config
from avionics.recording.reader import LogReader
from avionics.recording.writer import LogWriter
from avionics.topics import topic_of
from drivers.clock import SteadyClock
from sim_bus.wing.build import make_wing
from sim_bus.guests import uml
from sim_bus.wing.motion import PodMotion
from sim_bus.wing.scenario import load_scenario
from sim_bus.wing.sim_wing import SimWing

pytestmark = pytest.mark.qemu_arm

DURATION_S, BOOT_S = 12, 60
SCALE_RAD_S = math.radians(2000 / 32768)
CONFIG = """
[wing]
span_m = 1.5
[[pods]]
id = 0
s_m = 1.2
link = { kind = "can", interface = "socketcan", channel = "slcan0", node = 15 }
[[truth_markers]]
id = 0
s_m = 1.2
[[truth_markers]]
id = 1
s_m = 1.5
"""
# The guest sees new bytes only: a pty that the pod has filled meanwhile would stay silent.
GUEST = """
touch {out}/ready; sleep 0.3
slcand -o -s6 /dev/ttyS0 slcan0 && sleep 1 && ip link set slcan0 up || exit 3
exec {python} -m avionics run {config} --duration {duration} --force -o {log}
"""


class Flight:
    """The wing, its pod in QEMU, and what the chip put on its line and when."""

    def __init__(self, elf: Path, config: Config) -> None:
        from emulator import ChipOnPty, Emulator

        self.reads: list[tuple[int, ...]] = []
        self.read_ns: list[int] = []
        scenario = load_scenario("default")
        clock = SteadyClock()
        wing = make_wing(
            config, scenario, rng=np.random.default_rng(0), epoch_ns=clock.now_ns(), keep_s=200.0
        )
        # Integrated ahead, so that the chip's thread never waits for the beam.
        wing.truth(clock.now_ns() + round((BOOT_S + DURATION_S) * 1e9))
        self.wing: SimWing = wing
        self._chip = ChipOnPty(PodMotion(wing, config.pods[0]), seed=3)
        plain_read = self._chip.chip.read

        def read(register: int, length: int, t_ns: int) -> bytes:
            data = plain_read(register, length, t_ns)
            if register in (0x08, 0x14):
                self.reads.append(tuple(np.frombuffer(data[-6:], dtype="<i2").tolist()))
                self.read_ns.append(t_ns)
            return data

        self._chip.chip.read = read
        self._emulator = Emulator(elf, self._chip.path)
        self.can_path = self._emulator.can_path

    def close(self) -> None:
        self._emulator.close()
        self._chip.close()


@contextmanager
def drained(path: str, *, until: Path) -> Iterator[None]:
    """Keep a pty raw and open, and throw away what comes until the file ``until`` is there."""
    line = os.open(path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(line)
    is_over = threading.Event()

    def drain() -> None:
        while not until.exists() and not is_over.is_set():
            if select.select([line], [], [], 0.01)[0]:
                os.read(line, 4096)

    thread = threading.Thread(target=drain, name="drain", daemon=True)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()
        os.close(line)


def test_arm_elf_to_evaluate(serial_elf: Path, tmp_path: Path) -> None:
    if (reason := uml.missing()) is not None:
        pytest.skip(reason)
    path = tmp_path / "pod.toml"
    path.write_text(CONFIG, encoding="utf-8")
    out, truthful = tmp_path / "out", tmp_path / "with_truth.mcap"
    out.mkdir()
    flight = Flight(serial_elf, load_config(path))
    try:
        log = out / "pod.mcap"
        script = GUEST.format(
            python=sys.executable, config=path, duration=DURATION_S, out=out, log=log
        )
        with drained(flight.can_path, until=out / "ready"):
            result = uml.run_in_guest(
                ["sh", "-c", script],
                out,
                limit_s=BOOT_S + DURATION_S,
                serial_ports=[flight.can_path],
            )
    finally:
        flight.close()
    assert result.status == 0, result.failure() + result.stdout + result.stderr
    account = account_of(log, "0", SCALE_RAD_S)
    # A guest without a core of its own loses some; what counts is that it says how many.
    places = assert_account_closes(account, flight.reads)
    assert account.logged > 0.4 * 100 * (DURATION_S - 2)
    add_truth(log, truthful, flight, places)
    done = subprocess.run(
        [sys.executable, "-m", "avionics", "evaluate", str(truthful)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "tip" in done.stdout


def add_truth(log: Path, target: Path, flight: Flight, places: list[int]) -> None:
    """Copy a log and add the wing's truth at the instants of its estimates.

    A guest's clock falls behind on a busy host; the chip's words tell when, by ours, each logged
    sample was read.
    """
    with LogReader(log) as reader:
        records = list(reader.messages())
        config = reader.config
    sample_ns = [r.record.t_ns for r in records if r.topic == "/imu/0"]
    read_ns = [flight.read_ns[place] for place in places]
    order = np.argsort(sample_ns)
    guest_ns, host_ns = np.array(sample_ns)[order], np.array(read_ns)[order]
    with LogWriter(target, config) as writer:
        for record in records:
            t_ns = record.record.t_ns
            if record.topic.endswith("estimate_rg") and guest_ns[0] <= t_ns <= guest_ns[-1]:
                then_ns = round(np.interp(t_ns, guest_ns, host_ns))
                truth = replace(flight.wing.truth(then_ns), t_ns=t_ns)
                writer.write(truth, record.arrival_ns)
            writer.write(record.record, record.arrival_ns)
