"""What commands have in common: the log to read, progress, tables."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from avionics.errors import AvionicsError

if TYPE_CHECKING:
    from avionics.recording import Damage

PROGRESS_AFTER_S = 2.0


def read_log_path(path: Path) -> Path:
    """Return ``path`` if it is a file.

    Raises
    ------
    AvionicsError
        If there is no such file.
    """
    if not path.is_file():
        msg = f"{path}: no such log; give the path of an .mcap file"
        raise AvionicsError(msg)
    return path


def warn_of_damage(path: Path, damage: "Damage") -> None:
    """Write one line to stderr if a log that was read is not whole."""
    if damage.is_any:
        print(f"{path}: {damage.text()}", file=sys.stderr)


@contextlib.contextmanager
def progress_bar(title: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """Show a bar on stderr where it is a terminal and the work lasts longer than two seconds.

    Without a total it shows the seconds of flight that are done.
    """
    if not sys.stderr.isatty():
        yield lambda _done: None
        return
    from rich.console import Console  # noqa: PLC0415 (only where a bar may be drawn)
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        Progress,
        TaskID,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    start_s = time.monotonic()
    share = (TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn())
    bar = Progress(
        TextColumn(title),
        BarColumn(),
        *(share if total else (TextColumn("{task.completed:.0f} s"), TimeElapsedColumn())),
        console=Console(stderr=True),
        transient=True,
    )
    task: list[TaskID] = []

    def update(done: float) -> None:
        if not task:
            if time.monotonic() - start_s < PROGRESS_AFTER_S:
                return
            bar.start()
            task.append(bar.add_task(title, total=total))
        bar.update(task[0], completed=done)

    try:
        yield update
    finally:
        if task:
            bar.stop()
