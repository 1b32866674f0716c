"""What every guest kernel has in common: how a command gets in, how its outcome gets out.

The first process of a guest runs ``guest.sh``. It writes to the host in one place only: the
``out`` folder, which holds the command, its output, its status and whatever it leaves there.
"""

import os
import shlex
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from avionics.cache import cache_home
from sim_bus.guests.guest_process import GuestTimeoutError, run_process

STATUS_MISSING = 77
STATUS_DIED = 99
_KIND = "RIG_GUEST="


@dataclass(frozen=True, slots=True)
class GuestResult:
    """How a guest ended.

    Attributes
    ----------
    status : int
        Exit status of the command; 77 when the guest cannot run here, 99 when it died or ran
        out of time.
    out : Path
        The shared folder: ``stdout``, ``stderr``, ``console`` and whatever the command wrote.
    missing : str
        What this machine lacks for the guest; empty if nothing.
    """

    status: int
    out: Path
    missing: str = ""

    @property
    def stdout(self) -> str:
        """What the command printed."""
        return _text(self.out / "stdout")

    @property
    def stderr(self) -> str:
        """What the command complained about."""
        return _text(self.out / "stderr")

    def failure(self) -> str:
        """Return why the guest gave no status of its own, with the end of its console."""
        if self.missing:
            return self.missing
        error = _text(self.out / "guest-error").strip() or "the guest died or ran out of time"
        return f"{error}; end of its console:\n{_text(self.out / 'console')[-1500:]}"


class Runner(Protocol):
    """Boots a guest, runs one command in it, and returns its status and output."""

    def __call__(
        self,
        command: Sequence[str],
        out: Path,
        *,
        limit_s: float = ...,
        memory_mib: int = ...,
        environment: Mapping[str, str] | None = None,
        cwd: Path | None = None,
        echo: bool = False,
    ) -> GuestResult:
        """Run ``command``; see ``sim_bus.guests.uml.run_in_guest``."""
        ...


def guest_kind() -> str | None:
    """Return the tier whose guest this process runs in, None on the host."""
    if "RIG_OUT" not in os.environ:
        return None
    try:
        words = Path("/proc/cmdline").read_text(errors="replace").split()
    except OSError:
        return None
    return next((word.removeprefix(_KIND) for word in words if word.startswith(_KIND)), None)


def find_tool(name: str) -> str | None:
    """Return the path of a program, also where only root's PATH leads."""
    return shutil.which(name, path=os.environ.get("PATH", "") + ":/sbin:/usr/sbin")


def kernel_words(kind: str, out: Path) -> tuple[str, ...]:
    """Return the words of the kernel's command line that configure its first process."""
    return (f"{_KIND}{kind}", f"RIG_OUT={out}")


def prepare(
    out: Path,
    command: Sequence[str],
    modules: Sequence[str],
    *,
    cwd: Path | None = None,
    environment: Mapping[str, str] | None = None,
) -> Path:
    """Lay out the shared folder for a run; returns its folder of control files."""
    control = out / ".guest"
    control.mkdir(parents=True, exist_ok=True)
    for stale in (control / "rc", out / "stdout", out / "stderr", out / "guest-error"):
        stale.unlink(missing_ok=True)
    variables = {
        "PATH": os.environ.get("PATH", "/usr/bin:/bin") + ":/usr/sbin:/sbin",
        "HOME": "/tmp",
        "XDG_CACHE_HOME": str(cache_home()),  # what is compiled on the host serves the guest
        "LANG": "C.UTF-8",
        "RIG_OUT": str(out),
        "UML_OUT": str(out),  # its name before there was a second kind of guest
        "PYTHONDONTWRITEBYTECODE": "1",
        **(environment or {}),
    }
    lines = [f"export {name}={shlex.quote(value)}" for name, value in variables.items()]
    lines += [f"cd {shlex.quote(str(cwd or Path.cwd()))} || exit 1", shlex.join(command)]
    (control / "command.sh").write_text("\n".join(lines) + "\n", encoding="utf-8")
    # Words with spaces cannot pass the kernel's command line, so the list is a file.
    (control / "modules").write_text(" ".join(modules) + "\n", encoding="utf-8")
    return control


def run_to_the_end(
    arguments: Sequence[str],
    out: Path,
    *,
    limit_s: float,
    echo: bool,
    environment: Mapping[str, str] | None = None,
    cpu: int | None = None,
) -> GuestResult:
    """Run the process that is the guest until it is over or ``limit_s`` has passed.

    Parameters
    ----------
    arguments : sequence of str
        The emulator or kernel with its arguments.
    out : Path
        A folder that ``prepare`` has laid out.
    limit_s : float
        Longest life, s.
    echo : bool
        Copy the command's output to this process's own while it runs.
    environment : mapping, optional
        Variables of the guest's process on the host, added to this process's.
    cpu : int, optional
        The one CPU on which the guest runs; any if absent.
    """
    try:
        run_process(arguments, out, limit_s=limit_s, echo=echo, environment=environment, cpu=cpu)
    except GuestTimeoutError:
        (out / "guest-error").write_text(f"the guest ran longer than {limit_s:.0f} s\n")
    status_file = out / ".guest" / "rc"
    status = int(status_file.read_text()) if status_file.exists() else STATUS_DIED
    return GuestResult(status, out)


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
