"""The libraries of the desk, which a flight computer goes without, and what to say without them."""

import contextlib
from collections.abc import Iterator

from avionics.errors import AvionicsError

LIBRARIES = frozenset(["matplotlib", "numba", "pandas", "pyarrow"])
"""What the extra ``desk`` of the package adds to a plain install."""


def missing(what: str, library: str, otherwise: str = "") -> AvionicsError:
    """Return the error that names a missing library and the command that installs it.

    Parameters
    ----------
    what : str
        What cannot be done.
    library : str
        What it needs.
    otherwise : str
        What can be done without.
    """
    tail = f", or {otherwise}" if otherwise else ""
    return AvionicsError(f'{what} needs {library}: pip install "wing-avionics[desk]"{tail}')


@contextlib.contextmanager
def desk_imports(what: str, otherwise: str = "") -> Iterator[None]:
    """Turn the missing library of an import in the block into ``missing``'s error.

    Raises
    ------
    AvionicsError
        If a library of the desk is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in LIBRARIES:
            raise
        raise missing(what, library, otherwise) from error
