"""Writes the report of a flight: one self-contained HTML page."""

from collections.abc import Callable
from pathlib import Path

from avionics.analysis.flight import Flight
from avionics.desk import desk_imports
from avionics.errors import RecordingError
from avionics.output_paths import claim_file

Progress = Callable[[float], None]


def write_report(
    flight: Flight, output: Path, *, force: bool = False, progress: Progress | None = None
) -> None:
    """Write the report of a log.

    Parameters
    ----------
    flight : Flight
        The log; may be cut.
    output : Path
        The HTML file.
    force : bool
        Replace an existing file.
    progress : callable, optional
        Called with the number of figures drawn.

    Raises
    ------
    OutputExistsError
        If ``output`` exists and ``force`` is False.
    RecordingError
        If the log cannot be read or the page cannot be written.
    AvionicsError
        If matplotlib is not installed.
    """
    claim_file(output, force=force)
    with desk_imports("a report"):
        from avionics.report.sections import build_page  # noqa: PLC0415
    html = build_page(flight, progress or (lambda _done: None))
    try:
        output.write_text(html, encoding="utf-8")
    except OSError as error:
        msg = f"{output}: cannot be written ({error.strerror})"
        raise RecordingError(msg) from error
