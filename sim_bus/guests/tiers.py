"""The tiers of the tests: what each needs, what of it this machine lacks, and how to get it."""

import os
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from sim_bus.guests import uml, vm
from sim_bus.guests.guest import find_tool, guest_kind
from sim_bus.guests.vm_kernel import find_kernel, is_static

APT = "apt-get install"
GST_APT = (
    f"{APT} gstreamer1.0-tools gstreamer1.0-plugins-base gstreamer1.0-plugins-good "
    "gstreamer1.0-plugins-bad gstreamer1.0-python3-plugin-loader python3-gi python3-gst-1.0 "
    "gir1.2-gst-plugins-base-1.0"
)
ARM_APT = f"{APT} gcc-arm-none-eabi libnewlib-arm-none-eabi"
QEMU_ARM_APT = f"{ARM_APT} qemu-system-arm"
FOREIGN_PIP = "pip install wing-avionics[foreign]"


@dataclass(frozen=True, slots=True)
class Piece:
    """One thing that a tier needs.

    Attributes
    ----------
    name : str
        What it is.
    is_here : callable
        Whether this machine has it.
    remedy : str
        The line that installs it.
    """

    name: str
    is_here: Callable[[], bool]
    remedy: str


@dataclass(frozen=True, slots=True)
class Tier:
    """One tier of tests.

    Attributes
    ----------
    name : str
        The pytest marker.
    content : str
        What it proves.
    pieces : tuple of Piece
        All that it needs.
    """

    name: str
    content: str
    pieces: tuple[Piece, ...]

    def absent(self) -> list[Piece]:
        """Return every piece that this machine lacks."""
        if self.name == guest_kind():
            return []
        return [piece for piece in self.pieces if not piece.is_here()]

    def missing(self) -> str | None:
        """Return what this machine lacks with the lines that install it, or None."""
        absent = self.absent()
        if not absent:
            return None
        names = ", ".join(piece.name for piece in absent)
        remedies = dict.fromkeys(piece.remedy for piece in absent)
        return f"{names} not found; {'; '.join(remedies)}"


def _tool(name: str, remedy: str) -> Piece:
    return Piece(name, partial(_has_tool, name), remedy)


def _has_tool(name: str) -> bool:
    return find_tool(name) is not None


def _module(name: str, package: str) -> Piece:
    return Piece(
        f"Python module {name}", lambda: find_spec(name) is not None, f"pip install {package}"
    )


def _element(name: str) -> Piece:
    return Piece(f"GStreamer element {name}", partial(_has_element, name), GST_APT)


def _has_element(name: str) -> bool:
    inspector = find_tool("gst-inspect-1.0")
    if inspector is None:
        return False
    done = subprocess.run([inspector, name], capture_output=True, timeout=60, check=False)
    return done.returncode == 0


def _has_compiler() -> bool:
    return any(shutil.which(name) for name in ("cc", "gcc", "clang"))


X86 = Piece(
    "an x86-64 machine",
    lambda: os.uname().machine == "x86_64",
    "on other machines use their own kernel",
)
COMPILER = Piece("a C compiler (for the simulated pods)", _has_compiler, f"{APT} gcc libc6-dev")
TIERS = (
    Tier(
        "uml",
        "real SocketCAN, /dev/i2c-N and ttys in User Mode Linux",
        (
            X86,
            _tool(uml.KERNEL, uml.APT_LINE),
            Piece("the kernel's CAN modules", uml.has_modules, uml.APT_LINE),
            *(
                _tool(name, uml.APT_LINE)
                for name in ("insmod", "ip", "candump", "cansend", "canplayer", "i2cdetect")
            ),
            COMPILER,
        ),
    ),
    Tier(
        "gst",
        "camera pipelines through GStreamer",
        (
            _tool("gst-launch-1.0", GST_APT),
            _tool("gst-inspect-1.0", GST_APT),
            _element("python"),
            _element("videotestsrc"),
            _element("gdppay"),
        ),
    ),
    Tier(
        "unicorn",
        "the pod's ARM binary against modelled peripherals",
        (
            _tool("arm-none-eabi-gcc", ARM_APT),
            _module("unicorn", "unicorn"),
            _module("elftools", "pyelftools"),
        ),
    ),
    Tier(
        "qemu_arm",
        "the pod's ARM binary with interrupts, in real time",
        (_tool("arm-none-eabi-gcc", QEMU_ARM_APT), _tool("qemu-system-arm", QEMU_ARM_APT)),
    ),
    Tier(
        "vm",
        "V4L2 and CAN controllers in a virtual machine",
        (
            X86,
            *(_tool(name, vm.APT_LINE) for name in vm.TOOLS),
            Piece("busybox (static)", partial(is_static, "busybox"), vm.APT_LINE),
            Piece("a kernel for it", lambda: find_kernel() is not None, vm.FETCH_LINE),
        ),
    ),
)


def extras() -> tuple[Piece, ...]:
    """Return what no tier needs but the bench can use: interfaces of this machine's own kernel."""
    return (
        Piece(
            "SocketCAN (rig serve --can vcan0)",
            lambda: Path("/proc/net/can").exists(),
            "modprobe vcan; or --interface simbus; or avionics rig run",
        ),
        Piece(
            "/dev/cuse (rig serve --i2c-dev)",
            lambda: os.access("/dev/cuse", os.R_OK | os.W_OK),
            "modprobe cuse, as root; or avionics rig run",
        ),
        Piece(
            "a V4L2 device (rig serve --camera v4l2)",
            lambda: any(Path("/dev").glob("video*")),
            f"{APT} v4l2loopback-dkms && modprobe v4l2loopback",
        ),
        Piece(
            "third-party BNO055 drivers",
            lambda: all(find_spec(m) for m in ("adafruit_bno055", "Adafruit_BNO055")),
            FOREIGN_PIP,
        ),
    )
