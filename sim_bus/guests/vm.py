"""Run a command inside a virtual machine that sees this machine's files, read-only.

For what User Mode Linux lacks: V4L2 (vivid), CAN controllers with bit timing (two kvaser_pci on
one bus), several CPUs. No root and no hardware. The CPU is emulated: KVM is not used, because an
openable /dev/kvm proves nothing on a hosted machine. Programs run about twenty times slower; the
clocks are right.
"""

import os
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
from sim_bus.guests.vm_kernel import find_kernel, is_static, write_initramfs

EMULATOR = "qemu-system-x86_64"
APT_LINE = "apt-get install qemu-system-x86 busybox-static cpio kmod iproute2 v4l-utils"
FETCH_LINE = "avionics rig fetch-kernel"
TOOLS = (EMULATOR, "cpio", "modprobe", "ip", "v4l2-ctl")
# Loaded in this order; vivid and i2c-stub take parameters and are left to the command.
MODULES = ("can-raw", "can-bcm", "can-gw", "vcan", "kvaser_pci", "i2c-dev", "cuse")


def missing() -> str | None:
    """Return what this machine lacks for a guest, with the remedy, or None."""
    if os.uname().machine != "x86_64":
        return "the guest runs this machine's programs on an x86-64 kernel; use your own kernel"
    absent = [name for name in TOOLS if find_tool(name) is None]
    absent += [] if is_static("busybox") else ["busybox (static)"]
    if absent:
        return f"{', '.join(absent)} not found; install with: {APT_LINE}"
    return None if find_kernel() else f"no kernel in the cache; fetch one with: {FETCH_LINE}"


def run_in_guest(
    command: Sequence[str],
    out: Path,
    *,
    limit_s: float = 300.0,
    memory_mib: int = 1024,
    environment: Mapping[str, str] | None = None,
    cpus: int = 2,
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
    cpus : int
        CPUs of the guest; each is a thread of the host.
    cwd : Path, optional
        Working folder of the command; this process's by default.
    echo : bool
        Copy the command's output to this process's own while it runs.
    """
    out = out.resolve()
    control = prepare(out, command, MODULES, cwd=cwd, environment=environment)
    kernel = find_kernel()
    if (reason := missing()) is not None or kernel is None:
        return GuestResult(STATUS_MISSING, out, reason or FETCH_LINE)
    initramfs = control / "initramfs"
    write_initramfs(kernel, initramfs)
    words = (
        "console=ttyS0",
        "quiet",
        "panic=-1",
        f"RIG_MODULES={kernel.modules}",
        *kernel_words("vm", out),
    )
    arguments = [
        *(EMULATOR, "-accel", "tcg,thread=multi", "-cpu", "max", "-M", "q35"),
        *("-smp", str(cpus), "-m", f"{memory_mib}M"),
        *("-nodefaults", "-no-user-config", "-display", "none", "-no-reboot", "-monitor", "none"),
        *("-serial", "stdio", "-kernel", str(kernel.image), "-initrd", str(initramfs)),
        *("-append", " ".join(words)),
        *_shared("host", Path("/"), "readonly=on"),
        *_shared("out", out, "readonly=off"),
        *("-object", "can-bus,id=cb0"),
        *("-device", "kvaser_pci,canbus=cb0") * 2,
    ]
    return run_to_the_end(arguments, out, limit_s=limit_s, echo=echo)


def _shared(tag: str, path: Path, access: str) -> tuple[str, ...]:
    """Return the arguments that show a folder of the host to the guest."""
    # A comma separates options; doubled it is part of the path.
    place = str(path).replace(",", ",,")
    return (
        *("-fsdev", f"local,id={tag},path={place},security_model=none,multidevs=remap,{access}"),
        *("-device", f"virtio-9p-pci,fsdev={tag},mount_tag={tag}"),
    )
