"""A flight's log and the truth that was served to it, joined into one log on the flight's clock."""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from avionics.analysis.clock_fit import ClockFit, Rates, fit_clocks
from avionics.analysis.flight import Flight, read_flight
from avionics.analysis.series import in_time_order
from avionics.config import Config, one_wing
from avionics.errors import JoinError
from avionics.output_paths import refuse_inputs
from avionics.recording import LogReader, LogWriter
from avionics.recording.attached import CONFIG_TOML
from avionics.records import Event, Truth
from avionics.topics import Record

Alignment = Literal["auto", "shared", "rates"]
SAMPLES: Final = ("/imu/*",)
ROLE: Final = "truth"
MARGIN_NS: Final = 500_000_000
TRUTH_CONFIG: Final = "truth-config.toml"


@dataclass(frozen=True, slots=True)
class JoinReport:
    """How the clocks were aligned, and what was joined.

    Attributes
    ----------
    method : str
        "shared clock" or "gyro rates".
    offset_s, sigma_s : float
        Flight time minus truth time at the middle of the truth, s, and its one-sigma.
    drift_ppm, drift_sigma_ppm : float
        How much faster the flight's clock runs.
    correlation : float or None
        Of measured and true rates.
    check_s : float or None
        Where the clock is shared, the offset that the rates would have given, s.
    truths : int
        Shapes joined.
    is_truth_closed : bool
        Whether the truth was written to its end; False while the bench runs or after it was killed.
    """

    method: str
    offset_s: float
    sigma_s: float
    drift_ppm: float
    drift_sigma_ppm: float
    correlation: float | None
    check_s: float | None
    truths: int
    is_truth_closed: bool

    def text(self) -> str:
        """Return the report for a person."""
        lines = [
            f"clocks:  {self.method}; flight = truth + {self.offset_s:.6f} s "
            f"(one sigma {1e3 * self.sigma_s:.2f} ms)"
        ]
        if self.method != "shared clock":
            lines.append(
                f"drift:   {self.drift_ppm:+.1f} ppm (one sigma {self.drift_sigma_ppm:.1f}), "
                f"correlation {self.correlation or 0:.3f}"
            )
        elif self.check_s is not None:
            lines.append(f"check:   the gyro rates agree to {1e3 * self.check_s:+.2f} ms")
        lines.append(f"joined:  {self.truths} true shapes")
        if not self.is_truth_closed:
            lines.append(
                "note:    the truth is not closed; joined is what it held just now. End the bench "
                "with `avionics rig stop` and join again"
            )
        return "\n".join(lines)

    def to_json_dict(self) -> dict[str, Any]:
        """Return the report for programs."""
        return {name: getattr(self, name) for name in self.__slots__}


def join(
    flight: Path,
    truth: Path,
    output: Path,
    *,
    alignment: Alignment = "auto",
    force: bool = False,
) -> JoinReport:
    """Write a log that holds a flight and its truth, on the flight's clock.

    Parameters
    ----------
    flight, truth : Path
        Log of ``avionics run`` and log of ``avionics rig serve``.
    output : Path
        The log to write.
    alignment : str
        "shared": both ran on one machine since one start of it; "rates": fit measured to true
        gyro rates; "auto": shared if both logs carry the same boot id.
    force : bool
        Replace an existing output.

    Raises
    ------
    JoinError
        If the logs do not belong together or cannot be aligned.
    RecordingError
        If a log cannot be read or written.

    Notes
    -----
    An output that could not be finished is removed.
    """
    refuse_inputs(output, flight, truth)
    flown, served = read_flight(flight, SAMPLES), read_flight(truth, SAMPLES)
    _check(flown, served)
    is_shared = _is_shared(flown, served) if alignment == "auto" else alignment == "shared"
    fit, why = _fit(flown, served)
    if is_shared:
        method, sigma_s = "shared clock", 0.0
        check_s = None if fit is None else fit.offset_ns * 1e-9
        used = ClockFit(0.0, 0.0, 0.0, 0.0, 0, fit.correlation if fit else 0.0)
    elif fit is None:
        raise JoinError(why)
    else:
        method, sigma_s, check_s, used = "gyro rates", fit.sigma_ns * 1e-9, None, fit
    report = JoinReport(
        method, used.offset_ns * 1e-9, sigma_s, 1e6 * used.drift, 1e6 * used.drift_sigma,
        None if fit is None else fit.correlation, check_s, 0, not served.damage.truncated,
    )  # fmt: skip
    attachments = {k: v for k, v in flown.attachments.items() if not k.startswith("config.")}
    attachments[TRUTH_CONFIG] = served.attachments.get(CONFIG_TOML, b"")
    writer = LogWriter(
        output,
        flown.config,
        utc_offset_ns=flown.utc_offset_ns,
        metadata={**flown.metadata, **_metadata(truth, served, report)},
        attachments=attachments,
        force=force,
    )
    try:
        with writer:
            return replace(report, truths=_merge(flown, served, used, writer))
    except BaseException:  # half a flight that `evaluate` would take for a whole one
        if output.is_file():
            output.unlink()
        raise


def _check(flown: Flight, served: Flight) -> None:
    if served.metadata.get("role") != ROLE:
        msg = f"{served.path}: is no truth of `avionics rig serve`; give the flight first, then it"
        raise JoinError(msg)
    if flown.metadata.get("role") == ROLE:
        msg = f"{flown.path}: is a truth of `avionics rig serve`; give the flight first"
        raise JoinError(msg)
    if (held := flown.metadata.get("joined_truth")) is not None:
        msg = f"{flown.path}: is joined already, with {held}; give the log of `avionics run`"
        raise JoinError(msg)
    ours, theirs = (one_wing(log.config, f"{log.path}: join") for log in (flown, served))
    markers = [c.truth_markers or c.markers for c in (ours, theirs)]
    if len(markers[0]) != len(markers[1]):
        msg = (
            f"{flown.path}: flies {len(markers[0])} markers, {served.path} served "
            f"{len(markers[1])}; the same configuration must describe both"
        )
        raise JoinError(msg)
    if ours.wing.name != theirs.wing.name:
        msg = f"{flown.path}: flies wing {ours.wing.name}, {served.path} is of {theirs.wing.name}"
        raise JoinError(msg)


def _is_shared(flown: Flight, served: Flight) -> bool:
    boots = [reader.metadata.get("boot_id", "") for reader in (flown, served)]
    return boots[0] == boots[1] != ""


def _fit(flown: Flight, served: Flight) -> tuple[ClockFit | None, str]:
    """Return how the rates align the clocks, or None and why they cannot."""
    config = one_wing(flown.config, f"{flown.path}: join")
    lags = {pod.name: _lag_s(config, pod.name) for pod in config.pods}
    expected_ns = served.utc_offset_ns - flown.utc_offset_ns
    try:
        fit = fit_clocks(
            _rates(flown),
            _rates(served),
            {name: lag for name, (lag, _) in lags.items()},
            expected_ns=float(expected_ns) if flown.utc_offset_ns else None,
        )
    except JoinError as error:
        return None, str(error)
    # Where between two latches of the chip a read falls is not known.
    phase_ns = 1e9 * max((phase for _, phase in lags.values()), default=0.0)
    return replace(fit, sigma_ns=float(np.hypot(fit.sigma_ns, phase_ns))), ""


def _lag_s(config: Config, name: str) -> tuple[float, float]:
    """Return the mean delay of a pod's rates, s, and the one-sigma of the sampling phase."""
    pod = next(p for p in config.pods if p.name == name)
    delay, chosen = pod.chip.delay, config.estimator.gyro_lag_s
    return delay.mean_s if isinstance(chosen, str) else chosen, delay.spread_s / 3**0.5


def _rates(flight: Flight) -> dict[str, Rates]:
    ordered = {pod: in_time_order(samples) for pod, samples in flight.imu.items()}
    return {pod: Rates(one.t_ns, one.rate_rad_s) for pod, one in ordered.items()}


def _metadata(truth: Path, served: Flight, report: JoinReport) -> dict[str, str]:
    of_join = {f"join_{k}": str(v) for k, v in report.to_json_dict().items() if k != "truths"}
    of_truth = {f"truth_{k}": served.metadata.get(k, "") for k in ("scenario", "seed", "boot_id")}
    return {"joined_truth": truth.name, **of_join, **of_truth}


def _merge(flown: Flight, served: Flight, fit: ClockFit, writer: LogWriter) -> int:
    """Write both in order of arrival; returns how many true shapes."""
    if not flown.topics:
        msg = f"{flown.path}: holds no records; there is nothing to join"
        raise JoinError(msg)
    counts = flown.topics.values()
    first_ns = min(one.first_ns for one in counts) - MARGIN_NS
    last_ns = max(one.last_ns for one in counts) + MARGIN_NS

    def of_flight() -> Iterator[tuple[int, int, Record]]:
        for message in LogReader(flown.path).messages(decode_images=False):
            yield message.arrival_ns, 0, message.record

    count = 0

    def of_truth() -> Iterator[tuple[int, int, Record]]:
        latest_ns = first_ns
        for message in LogReader(served.path).messages(["/wing/*/truth", "/event"]):
            record = message.record
            if isinstance(record, Truth | Event):
                t_ns = fit.flight_ns(record.t_ns)
                if first_ns <= t_ns <= last_ns:
                    latest_ns = max(latest_ns, t_ns)
                    yield latest_ns, 1, replace(record, t_ns=t_ns)

    ordered = heapq.merge(of_flight(), of_truth(), key=lambda entry: entry[:2])
    for arrival_ns, _, record in ordered:
        if isinstance(record, Truth):
            count += 1
        writer.write(record, arrival_ns)
    if count == 0:
        msg = f"{served.path}: holds no truth of the time of {flown.path}"
        raise JoinError(msg)
    return count
