"""The user's cache, for what can be made again: machine code above all.

It lies in ``$XDG_CACHE_HOME/wing-avionics`` or ``~/.cache/wing-avionics``, never in the checkout or
the environment, which may be read-only. Whoever finds no place there works without.
"""

import contextlib
import fcntl
import logging
import os
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

_LOG = logging.getLogger(__name__)


def cache_home() -> Path:
    """Return the folder of all caches of the user.

    Raises
    ------
    RuntimeError
        If the user has no home folder and ``XDG_CACHE_HOME`` is not an absolute path.
    """
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return given if given.is_absolute() else Path.home() / ".cache"


def cache_path(part: str) -> Path:
    """Return where a part of our cache belongs, whether it is there or not.

    Raises
    ------
    RuntimeError
        As ``cache_home``.
    """
    return cache_home() / "wing-avionics" / part


def cache_folder(part: str) -> Path | None:
    """Return a folder of the cache that can be written, made if need be.

    Returns
    -------
    Path or None
        None if there is no such place; a warning in the process's log, once, says why.
    """
    try:
        folder = cache_path(part)
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        _warn_once(f"{error.filename} cannot be written ({error.strerror})")
    except RuntimeError as error:
        _warn_once(str(error))
    else:
        return folder
    return None


@cache
def _warn_once(why: str) -> None:
    _LOG.warning(
        "no cache: %s; compiled code and prepared flights are made again each time. Set "
        "XDG_CACHE_HOME to a folder that can be written",
        why,
    )


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder of the cache against other processes while the block lasts.

    Raises
    ------
    OSError
        If the lock cannot be made.
    """
    with (folder / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # released when the file closes
        yield
