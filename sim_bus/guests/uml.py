"""Run a command inside a User Mode Linux guest that sees this machine's files, read-only.

The guest is an ordinary user process: no root, no virtualisation, no hardware. It has real
SocketCAN (vcan, vxcan, slcan), i2c-dev, CUSE and ttys. Writes go to an overlay that vanishes;
only the ``out`` folder is shared with the host.
"""

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from sim_bus.guests.guest import (
    STATUS_MISSING,
    GuestResult,
    find_tool,
    kernel_words,
    prepare,
    run_to_the_end,
)

KERNEL = "linux.uml"
SHARED_MEMORY = Path("/dev/shm")
MODULE_ROOT = Path("/usr/lib/uml/modules")
APT_LINE = "apt-get install user-mode-linux kmod iproute2 can-utils i2c-tools"

# Order matters: insmod resolves no dependencies.
MODULES = (
    "net/can/can",
    "drivers/net/can/dev/can-dev",
    "net/can/can-raw",
    "net/can/can-bcm",
    "net/can/can-gw",
    "drivers/net/can/vcan",
    "drivers/net/can/vxcan",
    "drivers/net/can/slcan/slcan",
    "drivers/i2c/i2c-core",
    "drivers/i2c/i2c-dev",
    "fs/fuse/fuse",
    "fs/fuse/cuse",
    "net/sched/sch_netem",
    "net/sched/sch_tbf",
)


def has_modules() -> bool:
    """Return whether the guest's CAN modules are installed."""
    return any(MODULE_ROOT.glob("*/kernel/drivers/net/can/vcan.ko"))


def missing() -> str | None:
    """Return what this machine lacks for a guest, with the remedy, or None."""
    if os.uname().machine != "x86_64":
        return "User Mode Linux exists for x86-64 only; use this machine's own kernel"
    absent = [name for name in (KERNEL, "insmod", "ip") if find_tool(name) is None]
    absent += [] if has_modules() else [f"CAN modules under {MODULE_ROOT}"]
    return f"{', '.join(absent)} not found; install with: {APT_LINE}" if absent else None


def run_in_guest(
    command: Sequence[str],
    out: Path,
    *,
    limit_s: float = 300.0,
    memory_mib: int = 768,
    environment: Mapping[str, str] | None = None,
    serial_ports: Sequence[str] = (),
    cwd: Path | None = None,
    echo: bool = False,
) -> GuestResult:
    """Boot a guest, run one command in it, and return its status and output.

    Parameters
    ----------
    command : sequence of str
        The command and its arguments, found on the guest's PATH (the host's).
    out : Path
        Folder shared with the guest; made if absent. The only place whose files survive.
    limit_s : float
        Longest life of the guest, s.
    memory_mib : int
        Memory of the guest, MiB.
    environment : mapping, optional
        Variables for the command, added to PATH, HOME and RIG_OUT.
    serial_ports : sequence of str
        Host terminals (``/dev/pts/N``) that become the guest's /dev/ttyS0, ttyS1, ...
    cwd : Path, optional
        Working folder of the command; this process's by default.
    echo : bool
        Copy the command's output to this process's own while it runs.
    """
    out = out.resolve()
    control = prepare(out, command, MODULES, cwd=cwd, environment=environment)
    if (reason := missing()) is not None:
        return GuestResult(STATUS_MISSING, out, reason)
    arguments = [
        KERNEL,
        f"mem={memory_mib}M",
        "rootfstype=hostfs",
        "ro",
        "root=/dev/root",
        "hostfs=/",
        f"init={Path(__file__).with_name('uml_init.sh')}",
        f"uml_dir={control}",
        f"umid=u{os.getpid()}",
        "noreboot",
        "quiet",
        "con=null",
        "con0=fd:0,fd:1",
        *kernel_words("uml", out),
        *(f"ssl{i}=tty:{port}" for i, port in enumerate(serial_ports)),
    ]
    folder = memory_folder(control, memory_mib)
    # Its kernel and each of its programs are processes that take turns: on one CPU a turn passes in
    # a fraction of the time that it takes to wake another, and a system call costs 15 us, not 40.
    return run_to_the_end(
        arguments,
        out,
        limit_s=limit_s,
        echo=echo,
        environment={"TMPDIR": str(folder)},
        cpu=quietest_cpu(),
    )


def quietest_cpu(over_s: float = 0.1) -> int:
    """Return the CPU, of those that this process may use, that was idle most of the last moment.

    Parameters
    ----------
    over_s : float
        How long they are watched, s.
    """
    before = _idle_ticks()
    time.sleep(over_s)
    after = _idle_ticks()
    allowed = sorted(os.sched_getaffinity(0))
    return max(allowed, key=lambda cpu: after.get(cpu, 0) - before.get(cpu, 0))


def _idle_ticks() -> dict[int, int]:
    """Return the idle time of every CPU since the start, in ticks of the kernel."""
    lines = Path("/proc/stat").read_text(encoding="ascii").splitlines()
    columns = [line.split() for line in lines if line.startswith("cpu") and line[3].isdigit()]
    return {int(fields[0][3:]): int(fields[4]) for fields in columns}


def memory_folder(otherwise: Path, memory_mib: int) -> Path:
    """Return where the guest's memory can be a file: shared memory, if it serves.

    The guest's programs are executed from there. A container's /dev/shm forbids that, and holds
    64 MiB.

    Parameters
    ----------
    otherwise : Path
        A folder on a disk.
    memory_mib : int
        Memory of the guest, MiB.
    """
    if not os.access(SHARED_MEMORY, os.W_OK):
        return otherwise
    found = os.statvfs(SHARED_MEMORY)
    has_room = found.f_bavail * found.f_frsize >= memory_mib << 20
    return SHARED_MEMORY if has_room and not found.f_flag & os.ST_NOEXEC else otherwise
