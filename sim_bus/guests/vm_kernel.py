"""The kernel of the virtual machine: Debian's own package, unpacked into a cache folder.

Nothing is installed on the host. ``avionics rig fetch-kernel`` does it once; the cloud kernel
will not do, since it lacks CAN controllers and vivid.
"""

import lzma
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from avionics.cache import cache_path
from sim_bus.guests.guest import find_tool

META_PACKAGE = "linux-image-amd64"
# Reach the host's files; everything else is loaded from there.
BOOT_MODULES = ("virtio_pci", "9pnet_virtio", "9p", "overlay")


class KernelError(Exception):
    """The kernel of the virtual machine is not available; the message gives the reason."""


@dataclass(frozen=True, slots=True)
class Kernel:
    """An unpacked kernel package.

    Attributes
    ----------
    root : Path
        Folder into which it was unpacked.
    version : str
        What ``uname -r`` prints in it.
    """

    root: Path
    version: str

    @property
    def image(self) -> Path:
        """The compressed kernel."""
        return self.root / "boot" / f"vmlinuz-{self.version}"

    @property
    def modules(self) -> Path:
        """Folder of the modules."""
        return self.root / "lib" / "modules" / self.version


def cache_folder() -> Path:
    """Return where kernels are kept."""
    return cache_path("vm-kernel")


def find_kernel() -> Kernel | None:
    """Return the newest kernel of the cache, None if there is none."""
    found = [
        Kernel(folder, image.name.removeprefix("vmlinuz-"))
        for folder in cache_folder().glob("linux-image-*")
        for image in folder.glob("boot/vmlinuz-*")
    ]
    return max(
        (kernel for kernel in found if (kernel.modules / "modules.dep").exists()),
        key=lambda kernel: [int(number) for number in re.findall(r"\d+", kernel.version)],
        default=None,
    )


def fetch_kernel() -> Kernel:
    """Download and unpack the package that Debian's ``linux-image-amd64`` stands for.

    About 70 MB to download and 400 MB unpacked; root is not needed.

    Raises
    ------
    KernelError
        If a tool is missing, or the package cannot be had.
    """
    cache = cache_folder()
    cache.mkdir(parents=True, exist_ok=True)
    package = _package_name(_run(["apt-cache", "depends", META_PACKAGE]))
    with tempfile.TemporaryDirectory(dir=cache, prefix="fetch-") as work:
        _run(["apt-get", "download", "-q", package], cwd=Path(work))
        archive = next(Path(work).glob("*.deb"))
        root = Path(work) / "root"
        _run(["dpkg-deb", "-x", str(archive), str(root)])
        if not (root / "lib").exists():
            (root / "lib").symlink_to("usr/lib")
        version = package.removeprefix("linux-image-")
        _run(["depmod", "-b", str(root), version])
        shutil.rmtree(cache / package, ignore_errors=True)
        root.rename(cache / package)
    return Kernel(cache / package, version)


def _package_name(answer: str) -> str:
    """Return the kernel that the meta package depends on, by apt-cache's words."""
    found = re.search(r"Depends: (linux-image-\d\S*)", answer)
    if found is None:
        msg = f"{META_PACKAGE} depends on no kernel package here; found: {answer.strip()!r}"
        raise KernelError(msg)
    return found.group(1)


def write_initramfs(kernel: Kernel, path: Path) -> None:
    """Write the first files of the guest: a static busybox, four modules, the scripts.

    Raises
    ------
    KernelError
        If a tool is missing, or the kernel lacks a module.
    """
    with tempfile.TemporaryDirectory() as work:
        root = Path(work)
        for folder in ("bin", "modules", "proc", "run", "host", "dev"):
            (root / folder).mkdir()
        shutil.copy2(_tool("busybox"), root / "bin" / "busybox")
        for name, target in (("vm_init.sh", "init"), ("guest.sh", "guest.sh")):
            shutil.copy2(Path(__file__).with_name(name), root / target)
            (root / target).chmod(0o755)
        names = []
        for source in _with_needs(kernel, BOOT_MODULES):
            data = source.read_bytes()
            is_packed = source.suffix == ".xz"
            names.append(source.stem if is_packed else source.name)
            (root / "modules" / names[-1]).write_bytes(lzma.decompress(data) if is_packed else data)
        (root / "modules.list").write_text("\n".join(names) + "\n", encoding="ascii")
        files = "\n".join(str(f.relative_to(root)) for f in sorted(root.rglob("*")))
        path.write_bytes(
            subprocess.run(
                [_tool("cpio"), "--quiet", "-o", "-H", "newc"],
                cwd=root, input=files.encode(), stdout=subprocess.PIPE, check=True,
            ).stdout
        )  # fmt: skip


def _with_needs(kernel: Kernel, names: Sequence[str]) -> list[Path]:
    """Return the files of modules and of all that they need, in the order of loading."""
    answer = _run(
        ["modprobe", "-C", "/dev/null", "-d", str(kernel.root), "-S", kernel.version,
         "--show-depends", "-a", *names]
    )  # fmt: skip
    lines = [line.split() for line in answer.splitlines()]
    return list(dict.fromkeys(Path(words[1]) for words in lines if words[0] == "insmod"))


def is_static(program: str) -> bool:
    """Return whether a program runs without the host's libraries."""
    path = find_tool(program)
    # A dynamic one names its loader in the first page.
    return path is not None and b"/ld-linux" not in Path(path).read_bytes()[:4096]


def _tool(name: str) -> str:
    path = find_tool(name)
    if path is None:
        msg = f"{name} not found"
        raise KernelError(msg)
    return path


def _run(command: Sequence[str], *, cwd: Path | None = None) -> str:
    done = subprocess.run(
        [_tool(command[0]), *command[1:]], cwd=cwd, capture_output=True, text=True, check=False,
        env={**os.environ, "LC_ALL": "C"},
    )  # fmt: skip
    if done.returncode != 0:
        msg = f"`{' '.join(command)}` failed: {done.stderr.strip()[-500:]}"
        raise KernelError(msg)
    return done.stdout
