"""CPU that commands take before they do anything: `python benchmarks/start_up.py`.

The flight is a whole one of 0.1 s: loading, a chip's bring-up over a pty, the filter, the log.
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


def cpu_s(*arguments: str, status: int) -> float:
    """Return user and system time of a command, s."""
    command = [Path(sys.executable).with_name("avionics"), *arguments]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = child.stderr.read()
    _, found, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(found)
    assert child.returncode == status, said
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    clock = SteadyClock()
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as folder:
        wrong, wing = Path(folder, "wrong.toml"), Path(folder, "wing.toml")
        wrong.write_text("[wing]\nspan_m = 1.5\nspann = 2\n")
        chip = SimBno055(Rest(), rng, power_on_ns=clock.now_ns() - 1_000_000_000)
        faults = FaultPlan([], rng)
        port = SimSerialPort(chip, clock, target="pod 0", faults=faults, overruns=False)
        log = str(Path(folder, "flight.mcap"))
        commands = [
            ("--version", 0),
            ("--help", 0),
            *((f"{name} {wrong}", 1) for name in ("run", "doctor", "sim", "rig serve default")),
            (f"run {wing} --duration 0.1 --force -o {log}", 0),
        ]
        with closing(PtyUart(port, clock)) as line:
            wing.write_text(WING.format(port=line.path))
            print("CPU s, median of", RUNS)
            for command, status in commands:
                taken = [cpu_s(*command.split(), status=status) for _ in range(RUNS)]
                print(f"{statistics.median(taken):6.2f}  {command.replace(folder + '/', '')}")


if __name__ == "__main__":
    main()
