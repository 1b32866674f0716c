"""Where results go: no file that is there already is replaced unasked."""

from collections.abc import Iterable
from pathlib import Path

from avionics.errors import OutputExistsError, RecordingError


def claim_file(path: Path, *, force: bool) -> Path:
    """Return the path of a file that may be written.

    Parameters
    ----------
    path : Path
        The file; its folder must be there.
    force : bool
        Whether a file that is there may be replaced.

    Raises
    ------
    OutputExistsError
        If it is there and ``force`` is False.
    RecordingError
        If it is a folder, or its folder is not there.
    """
    if path.is_dir():
        msg = f"{path}: is a folder; give the name of a file"
        raise RecordingError(msg)
    _refuse(path, force=force)
    if not path.parent.is_dir():
        msg = f"{path}: the folder {path.parent} does not exist; make it first"
        raise RecordingError(msg)
    return path


def claim_folder(path: Path, *, force: bool, files: Iterable[str] | None = None) -> Path:
    """Return a folder that may be written into; it is made if it is not there.

    Parameters
    ----------
    path : Path
        The folder.
    force : bool
        Whether files that are there may be replaced.
    files : iterable of str, optional
        Names of the files to be written; others may be there. None: the folder must be empty.

    Raises
    ------
    OutputExistsError
        If such a file, or a file in place of the folder, is there and ``force`` is False.
    RecordingError
        If the folder cannot be made.
    """
    if path.is_file():
        msg = f"{path}: is a file; give the name of a folder"
        raise OutputExistsError(msg)
    if files is not None:
        for name in files:
            _refuse(path / name, force=force)
    elif path.is_dir() and any(path.iterdir()):
        _refuse(path, force=force)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        msg = f"{path}: cannot be made a folder ({error.strerror})"
        raise RecordingError(msg) from error
    return path


def refuse_inputs(output: Path, *inputs: Path) -> None:
    """Do nothing if an output is none of the files that it is made from.

    Raises
    ------
    RecordingError
        If it is one of them.
    """
    for source in inputs:
        if output.exists() and source.exists() and output.samefile(source):
            msg = f"{output}: is the log itself that is read; write to another file"
            raise RecordingError(msg)


def _refuse(path: Path, *, force: bool) -> None:
    if path.exists() and not force:
        msg = f"{path}: exists already; choose another name, or replace it with --force"
        raise OutputExistsError(msg)
