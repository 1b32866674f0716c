"""CPU that commands take before they do anything: `python benchmarks/start_up.py`.

`run` is a flight of one chip over a pty: CPU of a whole flight of 0.1 s, and until the chip is
first polled for the log, when loading and bring-up are done and filter and log are made.
"""

import os
import statistics
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

from drivers.clock import SteadyClock
from sim_bus.bench.pty_uart import PtyUart
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.uart import SimSerialPort
from sim_bus.chip.bno055.chip import SimBno055

RUNS = 5
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
DATA = range(0x08, 0x1A)  # acceleration to angular rate
WING = """
[wing]
span_m = 1.5
[[pods]]
id = 0
s_m = 0.75
link = {{ kind = "uart", port = "{port}" }}
[[markers]]
id = 0
s_m = 1.4
[camera]
f_x_px = 500
f_y_px = 500
c_x_px = 320
c_y_px = 240
"""


class Rest:
    """A chip that lies still."""

    def sense(self, t_ns):
        n = len(np.atleast_1d(t_ns))
        return np.zeros((n, 3)), np.tile([0.0, 0.0, 9.81], (n, 1)), np.full((n, 3), 3e-5)


class WatchedChip(SimBno055):
    """A chip that notes the CPU time of whoever flies it, at the first sample of the flight."""

    pid: int | None = None
    cpu_s: float | None = None

    def read(self, register, length, t_ns):
        if self.pid is not None and self.cpu_s is None and register in DATA:
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            self.cpu_s = (int(fields[11]) + int(fields[12])) * TICK_S
        return super().read(register, length, t_ns)


def cpu_s(*arguments: str, status: int, chip: WatchedChip | None = None) -> float:
    """Return user and system time of a command, s; with a chip, that until its first sample."""
    command = [Path(sys.executable).with_name("avionics"), *arguments]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout is not None
    for line in child.stdout:
        if chip is not None and line.startswith("flying"):  # the chip is set up and answers
            chip.pid, chip.cpu_s = child.pid, None
    said = child.stderr.read()
    _, found, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(found)
    assert child.returncode == status, said
    if chip is None:
        return usage.ru_utime + usage.ru_stime
    chip.pid = None
    assert chip.cpu_s is not None
    return chip.cpu_s


def main() -> None:
    clock = SteadyClock()
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as folder:
        wrong, wing = Path(folder, "wrong.toml"), Path(folder, "wing.toml")
        wrong.write_text("[wing]\nspan_m = 1.5\nspann = 2\n")
        chip = WatchedChip(Rest(), rng, power_on_ns=clock.now_ns() - 1_000_000_000)
        faults = FaultPlan([], rng)
        port = SimSerialPort(chip, clock, target="pod 0", faults=faults, overruns=False)
        flight = f"run {wing} --duration 0.1 --force -o {folder}/flight.mcap"
        wrongs = (f"{name} {wrong}" for name in ("run", "doctor", "sim", "rig serve default"))
        commands = [("--version", 0), ("--help", 0), *((line, 1) for line in wrongs), (flight, 0)]
        with closing(PtyUart(port, clock)) as line:
            wing.write_text(WING.format(port=line.path))
            print("CPU s, median of", RUNS)
            for command, status in commands:
                taken = [cpu_s(*command.split(), status=status) for _ in range(RUNS)]
                print(f"{statistics.median(taken):6.2f}  {command.replace(folder + '/', '')}")
            taken = [cpu_s(*flight.split(), status=0, chip=chip) for _ in range(RUNS)]
            print(f"{statistics.median(taken):6.2f}  the same, to its first sample")


if __name__ == "__main__":
    main()
