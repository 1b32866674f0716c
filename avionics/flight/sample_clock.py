"""The sample clock of one pod, recovered from jittered read times as they come."""

import math

import numpy as np

from avionics.records import FloatArray

# Samples over which the line is fitted, and after how many new ones it is fitted again.
WINDOW = 800
REFIT = 20
# Before this many samples the nominal period is better than a fitted one.
SLOPE_FROM = 200
# Quantiles of fewer samples than this show nothing of lateness.
SHAPE_FROM = 60
# Bowley-like skewness above which read times are taken for a clock plus delays: 0 for symmetric
# jitter, 0.36 for a half-normal delay, 0.56 for an exponential one.
LATE_SKEW = 0.25
LATE_SPREAD_S = 1e-3
# After a longer silence the clock is taken to have restarted.
RESTART_S = 10.0
BINS = 40


class SampleClock:
    """Turns read times into the times of a regular clock; causal.

    A read belongs to the period of the clock in which it falls, the periods being cut where
    hardly any reads are. Lost samples so leave their periods empty, and no miscount can last.
    Symmetric jitter is averaged; where reads are skewed to the late side, the clock is their
    lower envelope.

    Parameters
    ----------
    period_s : float
        Nominal sample period, s.
    """

    def __init__(self, period_s: float) -> None:
        self._nominal_s = period_s
        self.resets = 0
        self.is_late = False
        self._restart(0)

    def _restart(self, epoch_ns: int) -> None:
        self._epoch_ns = epoch_ns
        self._read_s = [0.0]
        self._number = [0]
        self._period_s = self._nominal_s
        self._cut_s = -0.5 * self._nominal_s
        self._tick_s = 0.0
        self._since_fit = 0
        self._last_stamp_ns: int | None = None

    def stamp(self, t_ns: int) -> int:
        """Return when the sample that was read at ``t_ns`` was due, ns."""
        read_s = (t_ns - self._epoch_ns) * 1e-9
        if self._last_stamp_ns is None or abs(read_s - self._read_s[-1]) > RESTART_S:
            self.resets += self._last_stamp_ns is not None
            self._restart(t_ns)
            return self._emit(0)
        number = math.floor((read_s - self._cut_s) / self._period_s)
        self._number.append(number)
        self._read_s.append(read_s)
        self._since_fit += 1
        if self._since_fit >= min(REFIT, len(self._number)):
            self._fit()
        return self._emit(self._number[-1])

    def _emit(self, number: int) -> int:
        due_ns = self._epoch_ns + round(1e9 * (self._tick_s + number * self._period_s))
        if self._last_stamp_ns is not None and due_ns <= self._last_stamp_ns:
            # Two reads in one period: the one before came a whole period late.
            due_ns = self._last_stamp_ns + round(0.1e9 * self._period_s)
        self._last_stamp_ns = due_ns
        return due_ns

    def _fit(self) -> None:
        self._since_fit = 0
        if len(self._number) > WINDOW:
            del self._number[:-WINDOW], self._read_s[:-WINDOW]
        k = np.array(self._number, dtype=np.float64)
        t = np.array(self._read_s)
        if len(k) >= SLOPE_FROM:
            self._period_s = _trimmed_slope(k, t, self._period_s)
        period = self._period_s
        residual = t - k * period
        cut = _emptiest_phase(residual, period)
        k += np.floor((residual - cut) / period)
        residual = t - k * period
        self._number = k.astype(int).tolist()
        self._cut_s = cut
        self._tick_s = self._place_tick(residual)

    def _place_tick(self, residual: FloatArray) -> float:
        """Return where in its period the clock ticks: amid the reads, or at their early edge."""
        first, low, middle, high = np.quantile(residual, [0.01, 0.05, 0.5, 0.95])
        spread = high - low
        if len(residual) >= SHAPE_FROM:
            skew = (high + low - 2 * middle) / spread if spread > 0 else 0.0
            limit = 0.5 * LATE_SKEW if self.is_late else LATE_SKEW
            self.is_late = bool(skew > limit and spread > LATE_SPREAD_S)
        if self.is_late:
            return float(first)
        inside = np.abs(residual - middle) <= max(1.5 * spread, 1e-6)
        return float(residual[inside].mean())


def _emptiest_phase(residual: FloatArray, period: float) -> float:
    """Return an offset with the fewest reads around it, in the middle of the widest such gap."""
    base = float(np.median(residual)) - 0.5 * period
    phase = np.mod(residual - base, period)
    counts = np.bincount((phase * (BINS / period)).astype(int) % BINS, minlength=BINS)
    smooth = counts + 0.5 * (np.roll(counts, 1) + np.roll(counts, -1))
    empty = smooth <= max(float(smooth.min()), 0.02 * float(smooth.max()))
    # Longest run of empty bins on the circle.
    run, best, best_end = 0, 0, 0
    for i in range(2 * BINS):
        run = run + 1 if empty[i % BINS] else 0
        if best < run <= BINS:
            best, best_end = run, i
    return base + period * (((best_end + 1 - 0.5 * best) / BINS) % 1.0)


def _trimmed_slope(k: FloatArray, t: FloatArray, period: float) -> float:
    """Least-squares period over the reads within two median deviations of the line."""
    for _ in range(2):
        residual = t - k * period
        middle = np.median(residual)
        deviation = np.abs(residual - middle)
        near = deviation <= max(3.0 * float(np.median(deviation)), 1e-6)
        dk, dt = k[near] - k[near].mean(), t[near] - t[near].mean()
        if not np.any(dk):
            return period
        period = float(dk @ dt / (dk @ dk))
    return period
