"""A scenario's loads as columns of the beam's drive table."""

import numpy as np
from numpy.typing import NDArray

from sim_bus.wing import rod_dynamics as drive
from sim_bus.wing.root_motion import smooth_step
from sim_bus.wing.scenario import Force, Gust, Load, Sweep

FloatArray = NDArray[np.float64]
DRYDEN_TONES = 60


def unit(direction: tuple[float, float, float]) -> FloatArray:
    """Return the unit vector.

    Raises
    ------
    ValueError
        If the direction has no length.
    """
    vector = np.array(direction, dtype=np.float64)
    length = float(np.linalg.norm(vector))
    if length == 0:
        msg = "a load's direction must have a length, found (0, 0, 0)"
        raise ValueError(msg)
    return vector / length


class ScenarioLoads:
    """Everything of a scenario that pushes the wing.

    Parameters
    ----------
    loads : tuple of Load
        In any order; what overlaps is added, save sweeps, which replace one another.
    rest_tip_m : ndarray, shape (3,)
        The tip at rest, body axes: a sweep's zero.
    node_y_m : ndarray, shape (N + 1,)
        Spanwise place of the beam's nodes.
    rng : numpy.random.Generator
        Phases of the turbulence.
    """

    def __init__(
        self,
        loads: tuple[Load, ...],
        *,
        rest_tip_m: FloatArray,
        node_y_m: FloatArray,
        rng: np.random.Generator,
    ) -> None:
        self._loads, self._rest_tip_m, self._node_y_m = loads, rest_tip_m, node_y_m
        self._phases = [rng.uniform(0, 2 * np.pi, (2, DRYDEN_TONES)) for _ in loads]

    def fill(self, table: FloatArray, t_s: FloatArray) -> None:
        """Add the loads at the instants ``t_s``, shape (n,), to a drive table."""
        for load, phases in zip(self._loads, self._phases, strict=True):
            match load:
                case Force():
                    _fill_force(table, t_s, load)
                case Sweep():
                    self._fill_sweep(table, t_s, load)
                case Gust():
                    self._fill_gust(table, t_s, load, phases)

    def _fill_sweep(self, table: FloatArray, t_s: FloatArray, load: Sweep) -> None:
        rows = (t_s >= load.at_s) & (t_s < load.at_s + load.for_s)
        if not rows.any():
            return
        age = t_s[rows] - load.at_s
        # Numerical derivative of a smooth command: exact enough for a damper.
        command, ahead = _sweep(load, age), _sweep(load, age + 1e-4)
        direction = unit(load.direction)
        zero = float(direction @ self._rest_tip_m)
        table[rows, drive.GUIDE : drive.GUIDE + 3] = direction
        table[rows, drive.HANDLE] = zero + command
        table[rows, drive.HANDLE_SPEED] = (ahead - command) / 1e-4
        grip = smooth_step(age / 0.5)[0]
        table[rows, drive.HOLD] = load.stiffness_n_m * grip
        table[rows, drive.DAMP] = load.damping_n_s_m * grip
        part = (command - load.offset_m * grip) / load.amplitude_m
        table[rows, drive.TIP_TORQUE + 1] += load.torque_nm * part
        table[rows, drive.TIP_FORCE] += load.side_n * part

    def _fill_gust(
        self, table: FloatArray, t_s: FloatArray, load: Gust, phases: FloatArray
    ) -> None:
        up = smooth_step((t_s - load.at_s) / 2.0)[0]
        fade = up * smooth_step((load.at_s + load.for_s - t_s) / 2.0)[0]
        table[:, drive.AIRSPEED] += load.airspeed_m_s * fade
        gust = np.zeros((t_s.size, self._node_y_m.size))
        if load.sigma_m_s > 0:
            gust += _dryden(load, t_s, self._node_y_m, phases)
        if load.peak_m_s != 0:
            length_s = 2 * load.gradient_m / load.airspeed_m_s
            age = np.mod(t_s - load.at_s, load.every_s)
            inside = (age < length_s) & (t_s >= load.at_s)
            shape = np.where(inside, 0.5 * (1 - np.cos(2 * np.pi * age / length_s)), 0.0)
            gust += load.peak_m_s * shape[:, None]
        # The table's gust points down, the scenario's up.
        table[:, drive.GUST :] -= gust * fade[:, None]


def _fill_force(table: FloatArray, t_s: FloatArray, load: Force) -> None:
    age = t_s - load.at_s
    history = np.where((age >= 0) & (age < load.for_s), smooth_step(age / load.rise_s)[0], 0.0)
    if load.fall_s > 0:
        history = history * smooth_step((load.for_s - age) / load.fall_s)[0]
    if load.hz > 0:
        history = history * np.sin(2 * np.pi * load.hz * age)
    column = drive.TIP_FOLLOW if load.follows_tip else drive.TIP_FORCE
    table[:, column : column + 3] += load.newtons * history[:, None] * unit(load.direction)
    table[:, drive.TIP_TORQUE + 1] += load.torque_nm * history


def _sweep(load: Sweep, age: FloatArray) -> FloatArray:
    """Return the commanded displacement: exponential sweep, smooth changes of amplitude."""
    ratio = np.log(load.to_hz / load.from_hz)
    x = np.clip(age / load.for_s, 0.0, 1.0)
    if ratio == 0:
        phase, hz = load.from_hz * age, np.full_like(age, load.from_hz)
    else:
        phase = load.from_hz * load.for_s / ratio * np.expm1(ratio * x)
        hz = load.from_hz * np.exp(ratio * x)
    omega = 2 * np.pi * hz
    bounded = np.minimum(load.speed_m_s / omega, load.accel_m_s2 / omega**2)
    bounded = np.minimum(load.amplitude_m, bounded)
    block, within = np.divmod(age, load.block_s)
    level = np.where(block % 2 == 0, 1.0, load.small)
    before = np.where(block % 2 == 0, load.small, 1.0)
    before = np.where(block == 0, level, before)
    blend = smooth_step(within / min(1.0, load.block_s))[0]
    wave = bounded * (before + (level - before) * blend) * np.sin(2 * np.pi * phase)
    return np.asarray((load.offset_m + wave) * smooth_step(age / 0.5)[0])


def _dryden(load: Gust, t_s: FloatArray, y_m: FloatArray, phases: FloatArray) -> FloatArray:
    """Return Dryden vertical turbulence as a sum of tones, shape (n, nodes), m/s.

    Of the same strength all along; root and tip feel different eddies, the middle both.
    """
    low, high = 0.02, 12.0
    edges = np.geomspace(low, high, DRYDEN_TONES + 1)
    hz = np.sqrt(edges[1:] * edges[:-1])
    x = load.length_m * 2 * np.pi * hz / load.airspeed_m_s
    density = 2 * load.length_m / load.airspeed_m_s * (1 + 3 * x**2) / (1 + x**2) ** 2
    amplitude = load.sigma_m_s * np.sqrt(2 * density * np.diff(edges))
    angle = 2 * np.pi * np.outer(t_s, hz)
    at_root, at_tip = (np.sin(angle + phase) @ amplitude for phase in phases)
    blend = 0.5 * np.pi * y_m / y_m[-1]
    return np.asarray(np.outer(at_root, np.cos(blend)) + np.outer(at_tip, np.sin(blend)))
