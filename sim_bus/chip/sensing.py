"""The analog half of every simulated IMU: from true motion to what the chip latches.

Low-pass filters, noise, zero-rate offset that drifts and warms, scale error and misalignment, all
in physical units; counts and registers are the chip's.
"""

import threading
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi

FloatArray = NDArray[np.float64]
# First latch; rate, force and flux of each.
_Block = tuple[int, FloatArray, FloatArray, FloatArray]
SETTLE_S, FINEST_STEP_S = 0.1, 1e-3
WARM_UP_S, WARM_UP_K = 300.0, 8.0


class Motion(Protocol):
    """What moves the chip."""

    def sense(self, t_ns: NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return true angular rate, specific force and magnetic flux in the sensor's frame.

        Parameters
        ----------
        t_ns : ndarray of int64, shape (n,)
            Instants, ns.

        Returns
        -------
        rate_rad_s, specific_force_m_s2, flux_t : ndarray, shape (n, 3)
        """
        ...

    def attitude(self, t_ns: int) -> FloatArray:
        """Return the direction cosine matrix that takes earth (north, east, down) to sensor."""
        ...


@dataclass(frozen=True, slots=True)
class ImuGrade:
    """How good a chip is; BNO055 data sheet rev. 1.4, Sec. 0.4, unless stated otherwise.

    Attributes
    ----------
    gyro_noise_dps_sqrthz : float
        White noise density.
    gyro_offset_dps : float
        Largest zero-rate offset; uniform.
    gyro_walk_dps_sqrts : float
        Random walk of the offset; 6 deg/s/sqrt(h) per hour is a fair chip.
    gyro_offset_dps_per_k : float
        Largest slope of the offset with temperature.
    gyro_scale : float
        One-sigma of the scale error of each axis.
    misalignment_deg : float
        One-sigma of each small rotation of the axes against the package.
    acc_noise_m_s2_sqrthz, acc_offset_m_s2 : float
        Noise density and largest offset of the accelerometer.
    mag_noise_t, mag_offset_t : float
        Noise per sample and largest offset of the magnetometer.
    clock_ppm : float
        One-sigma of the error of the chip's own sample clock; the internal oscillator is far
        worse than a crystal (data sheet: percent), a fair chip here is within 100 ppm.
    """

    gyro_noise_dps_sqrthz: float = 0.014
    gyro_offset_dps: float = 1.0
    gyro_walk_dps_sqrts: float = 5e-4
    gyro_offset_dps_per_k: float = 0.03
    gyro_scale: float = 0.01
    misalignment_deg: float = 0.2
    acc_noise_m_s2_sqrthz: float = 1.5e-3
    acc_offset_m_s2: float = 0.5
    mag_noise_t: float = 5e-7
    mag_offset_t: float = 2e-5
    clock_ppm: float = 40.0


PERFECT = ImuGrade(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


@dataclass(frozen=True, slots=True, eq=False)
class ImuErrors:
    """The errors of one particular chip, drawn from its grade."""

    grade: ImuGrade
    gyro_matrix: FloatArray
    gyro_offset_rad_s: FloatArray
    gyro_rad_s_per_k: FloatArray
    acc_offset_m_s2: FloatArray
    mag_offset_t: FloatArray
    clock_scale: float

    @classmethod
    def draw(cls, grade: ImuGrade, rng: np.random.Generator) -> "ImuErrors":
        """Draw one chip."""
        x, y, z = np.radians(grade.misalignment_deg) * rng.standard_normal(3)
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        scale = np.diag(1 + grade.gyro_scale * rng.standard_normal(3))
        return cls(
            grade=grade,
            gyro_matrix=scale @ (np.eye(3) + skew),
            gyro_offset_rad_s=np.radians(grade.gyro_offset_dps) * rng.uniform(-1, 1, 3),
            gyro_rad_s_per_k=np.radians(grade.gyro_offset_dps_per_k) * rng.uniform(-1, 1, 3),
            acc_offset_m_s2=grade.acc_offset_m_s2 * rng.uniform(-1, 1, 3),
            mag_offset_t=grade.mag_offset_t * rng.uniform(-1, 1, 3),
            clock_scale=1 + 1e-6 * grade.clock_ppm * float(rng.standard_normal()),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Latch:
    """What the chip took over at one tick of its clock."""

    index: int
    t_ns: int
    rate_rad_s: FloatArray
    specific_force_m_s2: FloatArray
    flux_t: FloatArray
    temperature_c: float


class Sensing:
    """The sampled, filtered and spoilt motion of one chip, made in blocks of a second.

    Parameters
    ----------
    motion : Motion
        What moves the chip.
    errors : ImuErrors
        The chip's own errors.
    rng : numpy.random.Generator
        Source of noise and drift.
    power_on_ns : int
        When the chip's clock began to run, ns.
    """

    def __init__(
        self, motion: Motion, errors: ImuErrors, rng: np.random.Generator, power_on_ns: int
    ) -> None:
        self._motion, self._errors, self._rng = motion, errors, rng
        # When the chip latches is not known outside: the phase is its own.
        self._power_on_ns = power_on_ns - round(float(rng.random()) * 1e7)
        self._gyro_hz, self._acc_hz, self._data_hz = 32.0, 62.5, 100.0
        self._orders: tuple[int, int] = (2, 2)
        self._delay_s: float | None = None
        self._block: _Block | None = None
        self._next: _Block | None = None
        self._lock = threading.Lock()
        self._filters: tuple[int, FloatArray, FloatArray] | None = None
        self._walk_rad_s, self._walk_index = np.zeros(3), 0
        self.ambient_c = 24.0

    def configure(
        self,
        gyro_hz: float,
        acc_hz: float,
        data_hz: float = 100.0,
        *,
        orders: tuple[int, int] = (2, 2),
        delay_s: float | None = None,
    ) -> None:
        """Set the low-passes and the data rate; filters settle again where one changes.

        Parameters
        ----------
        gyro_hz, acc_hz : float
            Corners of the low-passes (Butterworth), Hz.
        data_hz : float
            How often the chip latches, Hz.
        orders : tuple of int
            Orders of both low-passes.
        delay_s : float, optional
            Delay of the gyro's whole path at low frequency, s: what the low-pass does not make
            of it is the same at all frequencies. The low-pass alone if absent.
        """
        wanted = (gyro_hz, acc_hz, data_hz, orders, delay_s)
        if wanted == (
            self._gyro_hz, self._acc_hz, self._data_hz, self._orders, self._delay_s,
        ):  # fmt: skip
            return
        with self._lock:
            self._gyro_hz, self._acc_hz, self._data_hz = gyro_hz, acc_hz, data_hz
            self._orders, self._delay_s = orders, delay_s
            self._block = self._next = self._filters = None
            self._walk_index = 0

    @property
    def _period_ns(self) -> float:
        return 1e9 / self._data_hz * self._errors.clock_scale

    @property
    def _per_block(self) -> int:
        return round(self._data_hz)

    def latch_index(self, t_ns: int) -> int:
        """Return the number of the last latch at or before ``t_ns``."""
        return int(np.floor((t_ns - self._power_on_ns) / self._period_ns))

    def latch_time_ns(self, index: int) -> int:
        """Return when a latch happens."""
        return self._power_on_ns + round(index * self._period_ns)

    def latch(self, index: int) -> Latch:
        """Return the data of one latch."""
        block = self._block
        if block is None or not self._has(block, index):
            with self._lock:
                ahead, self._next = self._next, None
                is_there = ahead is not None and self._has(ahead, index)
                block = ahead if ahead is not None and is_there else self._make_block(index)
                self._block = block
        first, rate, force, flux = block
        row, t_ns = index - first, self.latch_time_ns(index)
        return Latch(index, t_ns, rate[row], force[row], flux[row], self._temperature_c(t_ns))

    def compute_ahead(self, t_ns: int) -> None:
        """Make the block of an instant soon to come, so that its reader does not wait for it.

        For a live chip, from another thread than its reader's. The block begins where the last one
        ended, also if the reader were to leave that latch out.
        """
        index, block = self.latch_index(t_ns), self._block
        if block is None or self._next is not None or index < block[0] + self._per_block:
            return
        with self._lock:
            if self._block is block and self._next is None:
                self._next = self._make_block(block[0] + self._per_block)

    def _has(self, block: _Block, index: int) -> bool:
        return block[0] <= index < block[0] + self._per_block

    def _temperature_c(self, t_ns: float) -> float:
        age_s = (t_ns - self._power_on_ns) * 1e-9
        return float(self.ambient_c + WARM_UP_K * (1 - np.exp(-max(age_s, 0.0) / WARM_UP_S)))

    def _substeps(self) -> int:
        finest_s = FINEST_STEP_S / (2 if max(self._gyro_hz, self._acc_hz) > 150 else 1)
        return int(np.ceil(1 / (self._data_hz * finest_s)))

    def _make_block(self, index: int) -> _Block:
        """Sample and filter one block; the filters go on where the last block ended."""
        errors, n_sub = self._errors, self._substeps()
        step_s = self._period_ns * 1e-9 / n_sub
        continues = self._filters is not None and self._filters[0] == index
        settle = 0 if continues else round(SETTLE_S * self._data_hz)
        count = (self._per_block + settle) * n_sub
        ticks = (index - settle - 1) * n_sub + 1 + np.arange(count)
        t_ns = self._power_on_ns + np.rint(ticks * (self._period_ns / n_sub)).astype(np.int64)
        rate, force, flux = self._motion.sense(t_ns - self._pure_delay_ns(step_s))
        rate = rate @ errors.gyro_matrix.T + self._noise(
            count, np.radians(errors.grade.gyro_noise_dps_sqrthz), step_s
        )
        force = force + self._noise(count, errors.grade.acc_noise_m_s2_sqrthz, step_s)
        rate, gyro_state = self._low_pass(rate, 0, step_s, continues=continues)
        force, acc_state = self._low_pass(force, 1, step_s, continues=continues)
        self._filters = (index + self._per_block, gyro_state, acc_state)
        at_latch = slice(settle * n_sub + n_sub - 1, None, n_sub)
        flux = flux[at_latch] + errors.mag_offset_t
        flux = flux + errors.grade.mag_noise_t * self._rng.standard_normal(flux.shape)
        return (
            index,
            rate[at_latch] + self._offset_rad_s(index),
            force[at_latch] + errors.acc_offset_m_s2,
            flux,
        )

    def _noise(self, count: int, density: float, step_s: float) -> FloatArray:
        sigma = density * np.sqrt(0.5 / step_s)
        return np.asarray(sigma * self._rng.standard_normal((count, 3)))

    def _pure_delay_ns(self, step_s: float) -> int:
        """Return the part of the wanted delay that the gyro's low-pass does not make, ns."""
        if self._delay_s is None:
            return 0
        sos, _ = _design(self._orders[0], min(self._gyro_hz, 0.45 / step_s), 1 / step_s)
        taps = np.arange(3)
        b, a = sos[:, :3], sos[:, 3:]
        own = float((b @ taps / b.sum(axis=1) - a @ taps / a.sum(axis=1)).sum()) * step_s
        return round(1e9 * max(self._delay_s - own, 0.0))

    def _low_pass(
        self, signal: FloatArray, sensor: int, step_s: float, *, continues: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Filter the gyro's (0) or the accelerometer's (1) signal; return it and the end state."""
        corner_hz = (self._gyro_hz, self._acc_hz)[sensor]
        sos, at_rest = _design(self._orders[sensor], min(corner_hz, 0.45 / step_s), 1 / step_s)
        zi: Any = at_rest * signal[0]
        if continues and self._filters is not None:
            zi = self._filters[1 + sensor]
        filtered, zf = sosfilt(sos, signal, axis=0, zi=zi)
        return filtered, zf

    def _offset_rad_s(self, index: int) -> FloatArray:
        """Return the zero-rate offset at each latch of a block, shape (n, 3)."""
        step_rad_s = np.radians(self._errors.grade.gyro_walk_dps_sqrts) * self._data_hz**-0.5
        skipped = max(index - self._walk_index, 0)
        start = self._walk_rad_s + step_rad_s * np.sqrt(skipped) * self._rng.standard_normal(3)
        steps = step_rad_s * self._rng.standard_normal((self._per_block, 3))
        walk = start + np.cumsum(steps, axis=0)
        self._walk_rad_s, self._walk_index = walk[-1], index + self._per_block
        t_ns = self._power_on_ns + (index + np.arange(self._per_block)) * self._period_ns
        age_s = np.maximum(t_ns - self._power_on_ns, 0.0) * 1e-9
        warm_k = WARM_UP_K * -np.expm1(-age_s / WARM_UP_S)
        fixed = self._errors.gyro_offset_rad_s
        return np.asarray(fixed + walk + np.outer(warm_k, self._errors.gyro_rad_s_per_k))


@lru_cache(maxsize=64)
def _design(order: int, corner_hz: float, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return the low-pass and its state under a constant input of one."""
    sos = butter(order, corner_hz, fs=rate_hz, output="sos")
    return sos, sosfilt_zi(sos)[:, :, None]
