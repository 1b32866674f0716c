"""The sections of a report, in the order in which a flight is judged."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib import rc_context

from avionics.analysis.flight import Flight
from avionics.analysis.series import TrackSeries
from avionics.config import Marker, Pod
from avionics.kinds import CRG, FILTERED
from avionics.recording.attached import CONFIG_TOML
from avionics.report import plots, plots_shape
from avionics.report.page import Page
from avionics.report.scores import HEAD, NOTE
from avionics.report.subject import Subject, subjects_of
from drivers.samples import Frame

MAX_EVENTS = 60


def build_page(flight: Flight, progress: Callable[[float], None]) -> str:
    """Return the page of a log as HTML."""
    subjects = subjects_of(flight)
    page = Page(f"Flight report: {flight.path.name}", _subtitle(subjects))
    done = 0
    with rc_context(plots.STYLE):
        for subject in subjects:
            page.chapter = f"Wing {subject.config.wing.name}: " if len(subjects) > 1 else ""
            for section in (_summary, _errors, _shapes, _tip, _gyros, _camera):
                section(page, subject)
                progress(done := done + 1)
        page.chapter = ""
        for section in (_losses, _attached):
            section(page, subjects[0])
            progress(done := done + 1)
    return page.html()


def _subtitle(subjects: Sequence[Subject]) -> str:
    info, wings = subjects[0].info, [subject.config.wing for subject in subjects]
    command = info.metadata.get("command", "")
    parts = [
        *(f"wing '{wing.name}', span {wing.span_m:g} m" for wing in wings),
        f"{info.duration_s:.1f} s",
        f"recorded by 'avionics {command}'" if command else "",
        f"replayed from {source}" if (source := info.metadata.get("replayed_from")) else "",
        f"software {info.metadata.get('software_version', 'unknown')}",
    ]
    return " · ".join(part for part in parts if part)


def _summary(page: Page, subject: Subject) -> None:
    config = subject.config
    page.heading("What flew")
    if subject.info.damage.is_any:
        page.paragraph(f"The log is not whole: {subject.info.damage.text()}.", is_warning=True)
    bases = [f"{kind}: {estimates.basis}" for kind, estimates in subject.estimates.items()]
    sha = subject.info.metadata.get("config_sha256", "")
    page.table(
        (),
        [
            ("Wing", f"{config.wing.side}, span {config.wing.span_m:g} m,"
                     f" sweep {config.wing.psi0_deg:g}°"),
            ("Pods", _stations(config.pods)),
            ("Markers", _stations(config.markers)),
            ("Camera", _camera_words(subject)),
            ("Tracker", config.tracker.name),
            ("Estimator", f"form '{config.estimator.form}', late frames by"
                          f" {config.estimator.late_frames}"),
            ("Modes", "; ".join(bases) or "no estimates in the log"),
            ("Truth", {"sim": "the simulated wing", "mocap": "motion capture"}.get(
                "" if subject.truth is None else subject.truth.source, "none in the log")),
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


def _camera_words(subject: Subject) -> str:
    camera = subject.config.camera
    if camera is None:
        return "none"
    origin = "calibrated" if camera.calibrated else "nominal, not calibrated"
    return (
        f"'{camera.name}', {camera.width_px} × {camera.height_px} px at {camera.fps:g} fps,"
        f" f = {camera.f_x_px:.1f} px, tilt {camera.tilt_deg:.2f}°, {origin}"
    )


def _errors(page: Page, subject: Subject) -> None:
    page.heading("Error against the truth")
    if subject.scores.rows:
        page.table(HEAD, subject.scores.rows, numbers=1)
        page.paragraph(NOTE)
    else:
        page.paragraph(f"No figures: the log {subject.scores.why_none}.")
    if subject.scores.errors:
        page.figure(
            plots.error_figure(subject, subject.scores.errors),
            "Marker error over time",
            "Mean distance in the image between the estimated and the true positions of the"
            " visible markers (Srikanth et al., Eq. 17), px, at each frame's exposure. RG-WSE"
            " integrates the gyros alone and drifts; the camera bounds CRG-WSE.",
        )


def _shapes(page: Page, subject: Subject) -> None:
    if not subject.estimates:
        return
    page.heading("Wing shape at chosen instants")
    instants = plots_shape.choose_instants(subject)
    drawing = plots_shape.frames_figure(subject, instants, _pictures(subject, instants))
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
        plots_shape.side_figure(subject, instants),
        "Reference line seen from behind",
        "Span y to the right and up (−z), m, body axes, equal scales, at the same instants."
        " Markers stand beside the line by their own offsets.",
    )


def _pictures(subject: Subject, instants: Sequence[plots_shape.Instant]) -> dict[int, Frame]:
    """Return the pictures of some instants by frame number; those not in the log are left out."""
    frames = subject.frames
    wanted = [one.frame_index for one in instants if one.frame_index is not None]
    if frames is None:
        return {}
    return {index: frames.with_index(index) for index in wanted if index in frames.index}


def _tip(page: Page, subject: Subject) -> None:
    if not subject.estimates:
        return
    page.heading("Tip deflection")
    caption = (
        "Height of the reference line's end above the root (−z, body axes), mm. The band is"
        " ± 2 σ of CRG-WSE."
    )
    if subject.scores.truth_tip is None:
        caption += " The log holds no true tip to compare with."
    page.figure(plots.tip_figure(subject, subject.scores.truth_tip), "Tip deflection", caption)


def _gyros(page: Page, subject: Subject) -> None:
    if not subject.imu:
        return
    page.heading("Gyros")
    page.figure(
        plots.rates_figure(subject),
        "Angular rates as measured",
        "Sensor axes, °/s; bias, lag and mounting not removed.",
    )
    as_flown = subject.estimates.get(CRG)
    if as_flown is not None and np.isfinite(as_flown.bias_rad_s).any():
        page.figure(
            plots.bias_figure(subject, as_flown),
            "Gyro bias as estimated by CRG-WSE",
            "Local axes, °/s, with ± 2 σ.",
        )


def _camera(page: Page, subject: Subject) -> None:
    tracks = subject.tracks
    if tracks is None:
        return
    page.heading("Camera and tracking")
    filtered = subject.estimates.get(FILTERED)
    if filtered is not None and np.isfinite(filtered.nis).any():
        page.figure(
            plots.innovation_figure(subject, filtered),
            "Innovations",
            "Above: normalised innovation squared of each frame over its degrees of freedom"
            " (two per marker used). 95 % of a consistent filter's points lie in the green band,"
            " their mean at 1. Below: markers used and found.",
        )
    page.figure(
        plots.found_figure(subject, tracks),
        "Markers found",
        "Blue: found in the frame. Red: not found. White: no frame.",
    )
    rows = [
        (
            f"marker {subject.marker_ids[k]}",
            f"{tracks.found[:, k].mean():.1%}",
            f"{_longest_gap_s(tracks, k):.2f}",
        )
        for k in range(tracks.found.shape[1])
    ]
    page.table(("", "found", "longest gap, s"), rows, numbers=1)
    latency_ms = (tracks.arrival_ns - tracks.t_ns) * 1e-6
    median, high = np.percentile(latency_ms, [50, 95])
    page.paragraph(
        f"From exposure to fusion: median {median:.0f} ms, 95 % within {high:.0f} ms,"
        f" longest {latency_ms.max():.0f} ms."
    )


def _longest_gap_s(tracks: TrackSeries, marker: int) -> float:
    """Return the longest time without the marker, from the first to the last frame."""
    found_ns = tracks.t_ns[tracks.found[:, marker]]
    edges = np.concatenate([tracks.t_ns[:1], found_ns, tracks.t_ns[-1:]])
    step = np.median(np.diff(tracks.t_ns)) if len(tracks.t_ns) > 1 else 0
    longest = np.diff(edges).max()
    return float(longest * 1e-9) if longest > 1.5 * step else 0.0


def _losses(page: Page, subject: Subject) -> None:
    page.heading("What was recorded, and what was lost")
    rows = [
        (topic.name, topic.note, str(topic.count),
         f"{topic.rate_hz:.2f}" if np.isfinite(topic.rate_hz) else "-", topic.lost_text)
        for topic in subject.info.topics.values()
    ]  # fmt: skip
    page.table(("topic", "", "records", "rate, Hz", "lost at the source"), rows, numbers=2)
    counters = [
        (source, ", ".join(f"{name} {count}" for name, count in counts.items() if count) or "-")
        for source, counts in subject.info.counters.items()
    ]
    if counters:
        page.table(("source", "counters at the end of the flight"), counters, numbers=9)
    page.heading("Events")
    events = subject.flight.events
    if not events:
        page.paragraph("None.")
        return
    listed = [
        (f"{float(subject.seconds(event.t_ns)):.3f}", event.level, event.source, event.message)
        for event in events[:MAX_EVENTS]
    ]
    page.table(("time, s", "level", "source", "what happened"), listed, numbers=9)
    if len(events) > MAX_EVENTS:
        page.paragraph(f"And {len(events) - MAX_EVENTS} more; 'avionics export' has all.")


def _attached(page: Page, subject: Subject) -> None:
    flight = subject.flight
    page.heading("Attached to the log")
    sizes = [(name, f"{len(data)}") for name, data in flight.attachments.items()]
    page.table(("file", "bytes"), sizes, numbers=1)
    text = flight.attachments.get(CONFIG_TOML, b"").decode(errors="replace")
    if text:
        page.folded("The configuration that flew (TOML)", text)
