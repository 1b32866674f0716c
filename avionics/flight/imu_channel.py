"""One IMU's samples on their way into the estimator: screened, timed, turned to local axes."""

import math

import numpy as np

from avionics.config import Estimator, Pod, RootImu
from avionics.flight.health import HealthLog
from avionics.flight.sample_clock import SampleClock
from drivers.samples import ImuSample

# A step of the rate between samples beyond what the recent motion explains. The floor lets a
# wing that is struck pass: 40 deg/s in one sample; a flipped sign bit makes 2048.
SPIKE_FLOOR_RAD_S = 0.7
SPIKE_FACTOR = 8.0
SPIKE_MEMORY = 0.05
# Consecutive samples that must agree before a step is accepted.
ACCEPTED_AFTER = 2
WILD_RAD_S = 10.0
ACCEPTED_AFTER_WILD = 4
SILENCE_S = 0.25
# Across a longer gap the motion says nothing about the next sample.
JOINED_PERIODS = 3


class SpikeScreen:
    """Rejects single samples that jump away from the line through the two before."""

    def __init__(self) -> None:
        self._kept: list[list[float]] = []
        self._variance = 0.0
        self._suspects: list[list[float]] = []

    def forget(self) -> None:
        """Restart after a gap; the activity of the wing is kept."""
        self._kept.clear()
        self._suspects.clear()

    def passes(self, rate: list[float]) -> bool:
        """Return whether a sample (P, Q, R), rad/s, is accepted."""
        if len(self._kept) < 2:
            self._kept.append(rate)
            return True
        before, last = self._kept
        expected = [2.0 * b - a for a, b in zip(before, last, strict=True)]
        # Right after a strike the line overshoots; the last value is then the better guess.
        miss = min(_apart(rate, expected), _apart(rate, last))
        limit = max(SPIKE_FLOOR_RAD_S, SPIKE_FACTOR * self._variance**0.5)
        capped = min(miss, 2.0 * limit)
        self._variance += SPIKE_MEMORY * (capped**2 - self._variance)
        if miss > limit and not self._agrees(rate, miss, limit):
            return False
        self._kept = [self._suspects[-1] if self._suspects else self._kept[1], rate]
        self._suspects.clear()
        return True

    def _agrees(self, rate: list[float], miss: float, limit: float) -> bool:
        """Return whether earlier suspects say the same; remembers this one if not."""
        if self._suspects and _apart(rate, self._suspects[-1]) > 2.0 * limit:
            self._suspects.clear()
        needed = ACCEPTED_AFTER_WILD if miss > WILD_RAD_S else ACCEPTED_AFTER
        if len(self._suspects) + 1 >= needed:
            return True
        self._suspects.append(rate)
        return False


def _apart(a: list[float], b: list[float]) -> float:
    """Return the largest difference of any axis."""
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


class ImuChannel:
    """What is known of one pod, or of the root, as a source of rates.

    Parameters
    ----------
    source : str
        Name in health records and events.
    imu : Pod or RootImu
        The pod, or the IMU at the root.
    estimator : Estimator
        Lag and clock settings.
    is_mirrored : bool
        Whether the pod sits on a left wing.
    health : HealthLog
        Counts what is lost, repeated or rejected.
    """

    def __init__(
        self,
        source: str,
        imu: Pod | RootImu,
        estimator: Estimator,
        *,
        is_mirrored: bool,
        health: HealthLog,
    ) -> None:
        self._source = source
        self._health = health
        chip = imu.chip
        period_s = 1.0 / chip.rate_hz
        general = estimator.form == "general"
        lag_s = estimator.gyro_lag_s
        if not general and isinstance(lag_s, str):
            lag_s = 0.0
        elif lag_s == "filter":
            lag_s = chip.delay.filter_s
        elif lag_s == "auto":
            lag_s = chip.delay.mean_s
        self._lag_ns = round(1e9 * float(lag_s))
        # Our drivers know when a chip measured: a late poll has read newer data. What others
        # recorded may be late stamps of a regular clock.
        recovers = estimator.sample_clock
        if recovers == "auto":
            recovers = general and imu.link is None
        self._clock = SampleClock(period_s) if recovers else None
        self._period_ns = round(1e9 * period_s)
        sensor_from_local = (
            imu.R_sensor_from_local if isinstance(imu, Pod) else imu.R_sensor_from_body
        )
        local_from_sensor = np.array(sensor_from_local).T
        # Mirrored in y an angular rate keeps its y component and turns the others around.
        mirror = np.diag([-1.0, 1.0, -1.0]) if is_mirrored else np.eye(3)
        self._model_from_sensor: list[list[float]] = (mirror @ local_from_sensor).tolist()
        self._screen = SpikeScreen()
        self._last: ImuSample | None = None
        self._is_repeat = False
        self._arrived_ns: int | None = None
        self.is_silent = False
        self._is_late = False
        health.declare(source, "received", "lost", "repeated", "spikes", "disordered", "late")

    def take(self, sample: ImuSample, arrival_ns: int) -> tuple[int, list[float]] | None:
        """Return when a sample was true, ns, and its rate in model axes; None if it is not used."""
        self._health.count(self._source, "received")
        self._end_silence(arrival_ns)
        last, self._last = self._last, sample
        if last is not None:
            if sample.t_ns <= last.t_ns:
                self._health.count(self._source, "disordered")
                self._last = last
                return None
            self._count_losses(last, sample)
            if sample.t_ns - last.t_ns > JOINED_PERIODS * self._period_ns:
                self._screen.forget()
        t_ns = sample.t_ns
        if self._clock is not None:
            t_ns = self._clock.stamp(t_ns)
        if last is not None and self._repeats(last, sample):
            return None
        axes = sample.rate_rad_s.tolist()
        if not all(map(math.isfinite, axes)) or not self._screen.passes(axes):
            self._health.count(self._source, "spikes")
            shown = np.degrees(sample.rate_rad_s).round(1).tolist()
            message = f"rate {shown} deg/s rejected"
            self._health.report(self._source, "warning", message, arrival_ns)
            return None
        x, y, z = axes
        rate = [a * x + b * y + c * z for a, b, c in self._model_from_sensor]
        return t_ns - self._lag_ns, rate

    def _count_losses(self, last: ImuSample, sample: ImuSample) -> None:
        seq_step = sample.seq - last.seq
        by_time = round((sample.t_ns - last.t_ns) / self._period_ns)
        lost = seq_step - 1 if seq_step > 1 else by_time - 1
        if lost > 0:
            self._health.count(self._source, "lost", lost)

    def _repeats(self, last: ImuSample, sample: ImuSample) -> bool:
        """Tell a poll that found no new sample; two in a row are a sensor that truly rests."""
        same = last.rate_rad_s.tolist() == sample.rate_rad_s.tolist()
        if same:
            self._health.count(self._source, "repeated")
        self._is_repeat = same and not self._is_repeat
        return self._is_repeat

    def _end_silence(self, arrival_ns: int) -> None:
        if self.is_silent and self._arrived_ns is not None:
            away_s = (arrival_ns - self._arrived_ns) * 1e-9
            message = f"back after {away_s:.2f} s"
            self._health.report(self._source, "info", message, arrival_ns)
            self.is_silent = False
        self._arrived_ns = arrival_ns

    def note_age(self, t_ns: int, known_ns: int, now_ns: int) -> None:
        """Count a sample that came after the filter had gone on without it; report one that is old.

        Parameters
        ----------
        t_ns, known_ns, now_ns : int
            When the sample was true, how far the filter is, and now, ns.
        """
        is_late = t_ns < known_ns
        if is_late:
            self._health.count(self._source, "late")
        age_s = (now_ns - t_ns) * 1e-9
        if is_late and age_s > SILENCE_S and not self._is_late:
            self._is_late = True
            message = f"samples come {age_s:.2f} s late; the estimator went on without them"
            self._health.report(self._source, "warning", message, now_ns)
        elif self._is_late and not is_late:
            self._is_late = False
            self._health.report(self._source, "info", "samples come in time again", now_ns)

    def watch(self, now_ns: int) -> None:
        """Report once when nothing has come for a quarter of a second."""
        if self._arrived_ns is None or self.is_silent:
            return
        if now_ns - self._arrived_ns > SILENCE_S * 1e9:
            self.is_silent = True
            self._health.report(self._source, "warning", "silent; going on without it", now_ns)
