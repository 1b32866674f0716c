"""The sections of a report, in the order in which a flight is judged."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context

from avionics.config import Marker, Pod
from avionics.kinds import CRG, FILTERED
from avionics.recording import Damage, LogReader
from avionics.recording.attached import CONFIG_TOML
from avionics.report import plots, plots_shape
from avionics.report.data import Flight, Series, read_flight, read_frames
from avionics.report.page import Page
from avionics.report.scores import HEAD, NOTE, Scores, read_scores

MAX_EVENTS = 60


def build_page(log: Path, progress: Callable[[float], None]) -> str:
    """Return the page of a log as HTML."""
    flight = read_flight(log)
    scores = read_scores(log)
    page = Page(f"Flight report: {log.name}", _subtitle(flight))
    sections: tuple[Callable[[], None], ...] = (
        lambda: _summary(page, flight),
        lambda: _errors(page, flight, scores),
        lambda: _shapes(page, flight),
        lambda: _tip(page, flight, scores),
        lambda: _gyros(page, flight),
        lambda: _camera(page, flight),
        lambda: _losses(page, flight),
        lambda: _attached(page, log),
    )
    with rc_context(plots.STYLE):
        for number, section in enumerate(sections):
            section()
            progress(number + 1)
    return page.html()


def _subtitle(flight: Flight) -> str:
    info, wing = flight.info, flight.config.wing
    command = info.metadata.get("command", "")
    said = [
        f"wing '{wing.name}', span {wing.span_m:g} m",
        f"{info.duration_s:.1f} s",
        f"recorded by 'avionics {command}'" if command else "",
        f"replayed from {source}" if (source := info.metadata.get("replayed_from")) else "",
        f"software {info.metadata.get('software_version', 'unknown')}",
    ]
    return " · ".join(part for part in said if part)


def _summary(page: Page, flight: Flight) -> None:
    config = flight.config
    page.heading("What flew")
    if flight.info.damage != Damage():
        page.paragraph(f"The log is not whole: {flight.info.damage.text()}.", is_warning=True)
    bases = [f"{kind}: {history.basis}" for kind, history in flight.estimates.items()]
    sha = flight.info.metadata.get("config_sha256", "")
    page.table(
        (),
        [
            ("Wing", f"{config.wing.side}, span {config.wing.span_m:g} m,"
                     f" sweep {config.wing.psi0_deg:g}°"),
            ("Pods", _stations(config.pods)),
            ("Markers", _stations(config.markers)),
            ("Camera", _camera_words(flight)),
            ("Tracker", config.tracker.name),
            ("Estimator", f"form '{config.estimator.form}', late frames by"
                          f" {config.estimator.late_frames}"),
            ("Modes", "; ".join(bases) or "no estimates in the log"),
            ("Truth", {"sim": "the simulated wing", "mocap": "motion capture"}.get(
                flight.truth_source, "none in the log")),
            ("Configuration", f"SHA-256 {sha[:16]}… (whole at the end of the page)"),
        ],
        numbers=9,
    )  # fmt: skip


def _stations(items: Sequence[Pod | Marker]) -> str:
    """Return ids by station, e.g. "0, 1 at 0.6 m; 4, 5 at 1.5 m"."""
    at: dict[float, list[str]] = {}
    for item in items:
        at.setdefault(item.s_m, []).append(str(item.id))
    return "; ".join(f"{', '.join(ids)} at {s:.4g} m" for s, ids in at.items()) or "none"


def _camera_words(flight: Flight) -> str:
    camera = flight.config.camera
    if camera is None:
        return "none"
    origin = "calibrated" if camera.calibrated else "nominal, not calibrated"
    return (
        f"'{camera.name}', {camera.width_px} × {camera.height_px} px at {camera.fps:g} fps,"
        f" f = {camera.f_x_px:.1f} px, tilt {camera.tilt_deg:.2f}°, {origin}"
    )


def _errors(page: Page, flight: Flight, scores: Scores) -> None:
    page.heading("Error against the truth")
    if scores.rows:
        page.table(HEAD, scores.rows, numbers=1)
        page.paragraph(NOTE)
    else:
        page.paragraph(f"No figures: the log {scores.why_none}.")
    if scores.errors:
        page.figure(
            plots.error_figure(flight, scores.errors),
            "Marker error over time",
            "Mean distance in the image between the estimated and the true positions of the"
            " visible markers (Srikanth et al., Eq. 17), px, at each frame's exposure. RG-WSE"
            " integrates the gyros alone and drifts; the camera bounds CRG-WSE.",
        )


def _shapes(page: Page, flight: Flight) -> None:
    if not flight.estimates:
        return
    page.heading("Wing shape at chosen instants")
    instants = plots_shape.choose_instants(flight)
    wanted = {one.frame_index for one in instants if one.frame_index is not None}
    drawing = plots_shape.frames_figure(flight, instants, read_frames(flight.path, wanted))
    if drawing is not None:
        page.figure(
            drawing,
            "Markers over the camera's picture",
            "The start; then the lowest, the highest and the lowest tip in the first, second and"
            " last third of the flight. Blue squares: where the tracker found the markers. White"
            " circles: RG-WSE. Red circles: CRG-WSE as flown. Green crosses: the truth, projected."
            " The picture is brightened.",
        )
    page.figure(
        plots_shape.side_figure(flight, instants),
        "Reference line seen from behind",
        "Span y to the right and up (−z), m, body axes, equal scales, at the same instants."
        " Markers stand beside the line by their own offsets.",
    )


def _tip(page: Page, flight: Flight, scores: Scores) -> None:
    if not flight.estimates:
        return
    page.heading("Tip deflection")
    caption = (
        "Height of the reference line's end above the root (−z, body axes), mm. The band is"
        " ± 2 σ of CRG-WSE."
    )
    if scores.truth_tip is None:
        caption += " The log holds no true tip to compare with."
    page.figure(plots.tip_figure(flight, scores.truth_tip), "Tip deflection", caption)


def _gyros(page: Page, flight: Flight) -> None:
    if not flight.rates:
        return
    page.heading("Gyros")
    page.figure(
        plots.rates_figure(flight),
        "Angular rates as measured",
        "Sensor axes, °/s; bias, lag and mounting not removed.",
    )
    history = flight.estimates.get(CRG)
    if history is not None and np.isfinite(history.bias_rad_s).any():
        page.figure(
            plots.bias_figure(flight, history),
            "Gyro bias as estimated by CRG-WSE",
            "Local axes, °/s, with ± 2 σ.",
        )


def _camera(page: Page, flight: Flight) -> None:
    if flight.found is None:
        return
    page.heading("Camera and tracking")
    history = flight.estimates.get(FILTERED)
    if history is not None and np.isfinite(history.nis).any():
        page.figure(
            plots.innovation_figure(flight, history),
            "Innovations",
            "Above: normalised innovation squared of each frame over its degrees of freedom"
            " (two per marker used). 95 % of an honest filter's points lie in the green band,"
            " their mean at 1. Below: markers used and found.",
        )
    page.figure(
        plots.found_figure(flight, flight.found),
        "Markers found",
        "Blue: found in the frame. Red: not found. White: no frame.",
    )
    found = flight.found.values
    ids = [marker.id for marker in flight.config.markers] or list(range(found.shape[1]))
    rows = [
        (f"marker {ids[k]}", f"{found[:, k].mean():.1%}", f"{_longest_gap_s(flight.found, k):.2f}")
        for k in range(found.shape[1])
    ]
    page.table(("", "found", "longest gap, s"), rows, numbers=1)
    if flight.latency_s is not None:
        median, high = np.percentile(flight.latency_s.values * 1e3, [50, 95])
        most = flight.latency_s.values.max() * 1e3
        page.paragraph(
            f"From exposure to fusion: median {median:.0f} ms, 95 % within {high:.0f} ms,"
            f" longest {most:.0f} ms."
        )


def _longest_gap_s(found: Series, marker: int) -> float:
    """Return the longest time between two sightings, or from start or to end of the frames."""
    seen = found.t_ns[found.values[:, marker] > 0]
    edges = np.concatenate([found.t_ns[:1], seen, found.t_ns[-1:]])
    step = np.median(np.diff(found.t_ns)) if len(found.t_ns) > 1 else 0
    longest = np.diff(edges).max()
    return float(longest * 1e-9) if longest > 1.5 * step else 0.0


def _losses(page: Page, flight: Flight) -> None:
    page.heading("What was recorded, and what was lost")
    rows = [
        (topic.name, topic.note, str(topic.count),
         f"{topic.rate_hz:.2f}" if np.isfinite(topic.rate_hz) else "-", topic.lost_text)
        for topic in flight.info.topics.values()
    ]  # fmt: skip
    page.table(("topic", "", "records", "rate, Hz", "lost at the source"), rows, numbers=2)
    counters = [
        (source, ", ".join(f"{name} {count}" for name, count in counts.items() if count) or "-")
        for source, counts in flight.info.counters.items()
    ]
    if counters:
        page.table(("source", "counters at the end of the flight"), counters, numbers=9)
    page.heading("Events")
    if not flight.events:
        page.paragraph("None.")
        return
    events = [
        (f"{float(flight.seconds(event.t_ns)):.3f}", event.level, event.source, event.message)
        for event in flight.events[:MAX_EVENTS]
    ]
    page.table(("time, s", "level", "source", "what happened"), events, numbers=9)
    if len(flight.events) > MAX_EVENTS:
        page.paragraph(f"And {len(flight.events) - MAX_EVENTS} more; 'avionics export' has all.")


def _attached(page: Page, log: Path) -> None:
    reader = LogReader(log)
    page.heading("Attached to the log")
    sizes = [(name, f"{len(data)}") for name, data in reader.attachments.items()]
    page.table(("file", "bytes"), sizes, numbers=1)
    text = reader.attachments.get(CONFIG_TOML, b"").decode(errors="replace")
    if text:
        page.folded("The configuration that flew (TOML)", text)
