"""Functions as machine code: the one place that knows numba, and where its results are kept.

Without numba (an extra of the package) functions stay the plain Python they are written in: same
results, a thousand times slower. Where there is no cache they are compiled in each process.
"""

import hashlib
import logging
import pickle
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from avionics.cache import cache_folder, locked

try:
    import numba
    from numba.core import caching
except ImportError:  # the flight computer goes without
    numba = caching = None  # type: ignore[assignment]

_LOG = logging.getLogger(__name__)
Function = TypeVar("Function", bound=Callable[..., Any])
IS_COMPILED = numba is not None
_SETTINGS: Any = None if numba is None else numba.config
_FunctionCache: Any = object if caching is None else caching.FunctionCache


class _SharedCache(_FunctionCache):  # type: ignore[misc]
    """numba's cache of one function, for processes that compile at once, and for damaged files.

    numba reads its index, adds to it and writes it back: two processes that do so at once can
    make it name the other's machine code.
    """

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            with locked(Path(self.cache_path)):
                super().save_overload(sig, data)
        except OSError as error:
            self._do_without(error)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except (EOFError, pickle.UnpicklingError):  # cut off, as by a loss of power
            self.flush()
        except OSError as error:
            self._do_without(error)
        return None

    def _do_without(self, error: OSError) -> None:
        self.disable()
        _warn_once(self.cache_path, error.strerror or str(error))


@cache
def _warn_once(folder: str, why: str) -> None:
    _LOG.warning("%s: the cache of compiled code fails (%s); going on without", folder, why)


def cached_compiler(name: str, sources: Iterable[Path]) -> Callable[[Function], Function]:
    """Return a decorator that compiles functions, free of the interpreter's lock.

    Parameters
    ----------
    name : str
        What is compiled, for the folder in the cache.
    sources : iterable of Path
        All files whose functions and constants go into the machine code. numba watches the file
        of a function only, so a change of what it calls would go unnoticed.
    """
    if numba is None or _SETTINGS.DISABLE_JIT:
        return lambda function: function
    digest = hashlib.sha256()
    for path in sorted(sources):
        digest.update(path.read_bytes())
    part = f"{name}-{digest.hexdigest()[:12]}"
    wanted = _SETTINGS.CACHE_DIR  # of NUMBA_CACHE_DIR
    folder = Path(wanted) / part if wanted else cache_folder(f"compiled/{part}")

    def compiled(function: Function) -> Function:
        made: Any = numba.njit(nogil=True, error_model="numpy")(function)
        if folder is not None:
            made._cache = _cache_in(str(folder), function)
        return cast(Function, made)

    return compiled


def _cache_in(folder: str, function: Callable[..., Any]) -> Any:
    before = _SETTINGS.CACHE_DIR
    _SETTINGS.CACHE_DIR = folder
    try:
        return _SharedCache(function)
    finally:
        _SETTINGS.CACHE_DIR = before
