"""The serial ELF in qemu-system-arm: the simulated chip on its UART, SLCAN on a pty."""

import os
import re
import select
import subprocess
import threading
import tty
from pathlib import Path

import numpy as np

from drivers.clock import SteadyClock
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.buses.uart import SimSerialPort


class ChipOnPty:
    """Serves the simulated chip's UART on a pty from a thread of its own."""

    def __init__(self, motion, *, seed: int = 7) -> None:
        self.clock = SteadyClock()
        self.chip = SimBno055(motion, np.random.default_rng(seed), power_on_ns=self.clock.now_ns())
        self.port = SimSerialPort(self.chip, self.clock, overruns=False)
        self.port.timeout = 0.0
        self._master, slave = os.openpty()
        tty.setraw(self._master)
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self._slave = slave
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="chip", daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while not self._is_stopped.is_set():
            ready, _, _ = select.select([self._master], [], [], 0.0005)
            if ready:
                self.port.write(os.read(self._master, 256))
            if self.port.in_waiting:
                os.write(self._master, self.port.read(self.port.in_waiting))

    def close(self) -> None:
        self._is_stopped.set()
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)


class Emulator:
    """QEMU's netduinoplus2 with the serial ELF; ``can_path`` is the pty that speaks SLCAN."""

    def __init__(self, elf: Path, imu_path: str) -> None:
        command = [
            "qemu-system-arm", "-M", "netduinoplus2", "-nographic", "-nodefaults",
            "-monitor", "none", "-kernel", str(elf),
            "-serial", "null", "-serial", "null",
            "-chardev", f"serial,id=imu,path={imu_path}", "-serial", "chardev:imu",
            "-serial", "null", "-serial", "null",
            "-chardev", "pty,id=can", "-serial", "chardev:can",
        ]  # fmt: skip
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        line = self.process.stdout.readline()
        found = re.search(r"(/dev/\S+)", line)
        if found is None:
            self.close()
            raise RuntimeError(f"qemu-system-arm said {line!r}, expected the name of a pty")
        self.can_path = found[1]

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
