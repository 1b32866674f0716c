"""The file under a log: append only, and whole again after a failed write.

The MCAP writer must never see an error half-way, or its index is wrong for good. So it writes into
memory here; ``commit`` brings that to the disk and, when the disk refuses, takes the file back to
its last whole record and keeps the bytes for another try.
"""

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from avionics.errors import RecordingError, StorageError
from avionics.output_paths import claim_file

MAX_PENDING_BYTES = 64 * 1024 * 1024


@contextlib.contextmanager
def appearing_whole(path: Path, *, force: bool = False) -> Iterator[Path]:
    """Yield where to write a log that takes the place of ``path`` when the block succeeds.

    Until then, and if the block fails, what stood there stays; a part of a log is not left behind.
    For logs made from other files. A flight is written where it belongs from its first second on.

    Raises
    ------
    OutputExistsError
        If the file exists and ``force`` is False.
    RecordingError
        If it cannot be there.
    """
    claim_file(path, force=force)
    if path.exists() and not path.is_file():
        yield path
        return
    target = path.resolve()
    part = target.with_name(f"{target.name}.part")
    try:
        yield part
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    part.replace(target)


class LogFile:
    """Bytes on their way to one file.

    Parameters
    ----------
    path : Path
        Created; never appended to.
    force : bool
        Replace an existing file. The old one stays whole for who has it open.

    Raises
    ------
    OutputExistsError
        If the file exists and ``force`` is False.
    RecordingError
        If it cannot be created.
    """

    def __init__(self, path: Path, *, force: bool = False) -> None:
        claim_file(path, force=force)
        self._path = path
        self._pending = bytearray()
        self._committed = 0
        self._is_entered = False
        flags = os.O_WRONLY | os.O_CREAT | getattr(os, "O_CLOEXEC", 0)
        try:
            if path.exists() and stat.S_ISREG(path.stat().st_mode):
                path.unlink()
            if not path.exists():
                flags |= os.O_EXCL
            self._descriptor = os.open(path, flags, 0o666)
        except OSError as error:
            msg = f"{path}: cannot be created ({error.strerror})"
            raise RecordingError(msg) from error

    @property
    def is_full(self) -> bool:
        """Whether so much waits for a disk that refuses that no more may be added."""
        return len(self._pending) > MAX_PENDING_BYTES

    @property
    def is_pending(self) -> bool:
        """Whether bytes wait for the next ``commit``."""
        return bool(self._pending)

    def write(self, data: bytes) -> int:
        """Take bytes; they reach the disk with the next ``commit``."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the offset of the next byte."""
        return self._committed + len(self._pending)

    def flush(self) -> None:
        """Do nothing: the MCAP library's writer calls it, ``commit`` decides."""

    def commit(self) -> None:
        """Hand everything to the operating system, where a SIGKILL cannot reach it.

        Raises
        ------
        StorageError
            If the disk is full or fails; the file ends with its last whole record and the bytes
            wait for the next call.
        """
        done, data = 0, memoryview(bytes(self._pending))
        try:
            while done < len(data):
                done += os.write(self._descriptor, data[done:])
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, self._committed)
                os.lseek(self._descriptor, self._committed, os.SEEK_SET)
            msg = f"{self._path}: cannot be written ({error.strerror}) after {self._committed} B"
            raise StorageError(msg) from error
        self._committed += done
        self._pending.clear()

    def sync(self) -> None:
        """Have the device store what was committed, so that it survives a power cut.

        Raises
        ------
        StorageError
            If the device fails.
        """
        try:
            os.fsync(self._descriptor)
            if not self._is_entered:
                self._sync_directory()
        except OSError as error:
            if not stat.S_ISREG(os.fstat(self._descriptor).st_mode):
                return
            msg = f"{self._path}: cannot be synchronised ({error.strerror})"
            raise StorageError(msg) from error

    def _sync_directory(self) -> None:
        """Store the file's name too: a new file without it is gone after a power cut."""
        directory = os.open(self._path.parent, os.O_RDONLY)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)
        self._is_entered = True

    def discard(self) -> None:
        """Close and remove a file that holds nothing of worth."""
        self.close()
        with contextlib.suppress(OSError):
            self._path.unlink()

    def close(self) -> None:
        """Release the file without writing; may be called twice."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
