"""The one place that knows the compiler: ``@compiled`` functions run as machine code.

Without numba (an extra of the package) they run as the plain Python they are written in: same
results, a thousand times slower. The results of both ways are compared under test.
"""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

try:
    import numba
except ImportError:  # the flight computer goes without
    numba = None  # type: ignore[assignment]

Array = NDArray[np.float64]
IndexArray = NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., Any])
IS_COMPILED = numba is not None


def _cache_folder() -> str:
    """Name a cache of this very source: numba's own watches a function's file, not its callees."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    folder = Path(__file__).parent / "__pycache__" / f"compiled-{digest.hexdigest()[:12]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return ""
    return str(folder) if os.access(folder, os.W_OK) else ""


_CACHE = _cache_folder() if numba is not None else ""


def compiled(function: Function) -> Function:
    """Return the function compiled, cached on disk and free of the interpreter's lock."""
    if numba is None:
        return function
    settings: Any = numba.config
    before = settings.CACHE_DIR
    settings.CACHE_DIR = before or _CACHE
    try:
        made = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        settings.CACHE_DIR = before
    return cast(Function, made)
