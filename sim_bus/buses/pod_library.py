"""The firmware's core as a shared library, built from ``firmware/`` when it is first needed.

It is compiled with the machine's C compiler and kept in the user's cache, under a name that changes
with the sources.
"""

import atexit
import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from avionics.cache import cache_folder
from drivers.errors import DriverError

# No warnings here: another compiler's new one must not ground the simulator.
_FLAGS = ("-std=c11", "-O2", "-fPIC", "-shared")
# Beside the packages in a checkout, under the environment's share folder once installed.
_PLACES = (
    Path(__file__).resolve().parents[2] / "firmware",
    Path(sys.prefix) / "share" / "wing-avionics" / "firmware",
)
_SOURCES = next((place for place in _PLACES if (place / "core" / "pod.c").is_file()), _PLACES[0])

_Bytes = ctypes.POINTER(ctypes.c_uint8)
NowUs = ctypes.CFUNCTYPE(ctypes.c_uint64)
ImuRead = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_uint8, _Bytes, ctypes.c_uint8)
ImuWrite = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_uint8, ctypes.c_uint8)
ImuRecover = ctypes.CFUNCTYPE(ctypes.c_int)
CanSend = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_uint8, ctypes.c_uint32, _Bytes, ctypes.c_uint8)
StoreNode = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_uint8)
Reset = ctypes.CFUNCTYPE(None)


class Calls(ctypes.Structure):
    """``pod_host_calls_t`` of ``firmware/host/pod_host.h``."""

    _fields_ = (
        ("now_us", NowUs),
        ("imu_read", ImuRead),
        ("imu_write", ImuWrite),
        ("imu_recover", ImuRecover),
        ("can_send", CanSend),
        ("store_node", StoreNode),
        ("reset", Reset),
    )


@cache
def load_library() -> ctypes.CDLL:
    """Return the core as a shared library, built if need be.

    Raises
    ------
    DriverError
        If the sources or a C compiler are missing, or the build fails.
    """
    library = ctypes.CDLL(str(build_library()))
    handle, byte, word, long = ctypes.c_void_p, ctypes.c_uint8, ctypes.c_uint32, ctypes.c_uint64
    flag, data = ctypes.c_bool, ctypes.c_char_p
    signatures: dict[str, tuple[Any, tuple[Any, ...]]] = {
        "new": (handle, (ctypes.POINTER(Calls), byte, data, byte, ctypes.c_uint16)),
        "free": (None, (handle,)),
        "restart": (None, (handle, byte, byte, ctypes.c_uint16)),
        "receive": (flag, (handle, word, flag, flag, data, byte, long)),
        "set_bus_off": (None, (handle, flag)),
        "is_bus_off": (flag, (handle,)),
        "step": (word, (handle,)),
        "state": (byte, (handle,)),
        "refusal": (byte, (handle,)),
        "is_synced": (flag, (handle,)),
        "master_us": (long, (handle, long)),
        "digest": (word, (handle,)),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, f"pod_host_{name}")
        function.restype, function.argtypes = result, arguments
    return library


def build_library() -> Path:
    """Compile the core for this machine unless it is already, and return the library's path."""
    sources = [*sorted(_SOURCES.glob("core/pod*.c")), *sorted(_SOURCES.glob("core/bno055*.c"))]
    sources += [_SOURCES / "gen" / "pod_dbc.c", _SOURCES / "host" / "pod_host.c"]
    if not all(path.is_file() for path in sources) or len(sources) < 3:
        msg = f"{_SOURCES}: the firmware's C sources are not there; reinstall from a checkout"
        raise DriverError(msg)
    compiler = os.environ.get("CC") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        msg = "simulated CAN pods run the firmware's C core: install a C compiler (apt: gcc)"
        raise DriverError(msg)
    headers = sorted(_SOURCES.glob("*/*.h"))
    digest = hashlib.sha256(f"{compiler} {_FLAGS} {platform.machine()}".encode())
    for path in (*sources, *headers):
        digest.update(path.read_bytes())
    target = _build_folder() / f"libpod-{digest.hexdigest()[:16]}.so"
    if not target.exists():
        _compile(compiler, sources, target)
    return target


@cache
def _build_folder() -> Path:
    kept = cache_folder("pod")
    if kept is not None:
        return kept
    folder = tempfile.TemporaryDirectory(prefix="wing-pod-", ignore_cleanup_errors=True)
    atexit.register(folder.cleanup)
    return Path(folder.name)


def _compile(compiler: str, sources: list[Path], target: Path) -> None:
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        built = Path(scratch) / target.name
        command = [*compiler.split(), *_FLAGS, "-o", str(built), *map(str, sources)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            msg = f"{compiler}: building the pod's core failed:\n{done.stderr}"
            raise DriverError(msg)
        built.replace(target)  # in one step, since two processes may build at once
