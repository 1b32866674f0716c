"""The simulated wing in flight: the truth at any time, integrated ahead as it is asked for."""

import threading
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from avionics.config import Marker
from avionics.records import Truth
from sim_bus.wing.beam import Beam, BeamError
from sim_bus.wing.rod_integration import integrate
from sim_bus.wing.rod_shape import along, between
from sim_bus.wing.root_motion import RootMotion

FloatArray = NDArray[np.float64]
TimeArray = NDArray[np.int64]
# Computed at a time: a bench's wing must not keep the only CPU of a guest from its chips for long.
BLOCK_S = 0.1
# In the mirror a vector turns its y around, a rate the others.
MIRROR, SPIN_MIRROR = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
# Strong numerical damping of what 2 ms cannot resolve (axial waves), 0.2 % at the bending modes.
SPECTRAL_RADIUS = 0.8
# Instants whose states are made together: those of more leave the cache, and fresh memory is slow
# in a guest kernel.
AT_ONCE = 100


class Loads(Protocol):
    """What pushes the wing, beside its root."""

    def fill(self, table: FloatArray, t_s: FloatArray) -> None:
        """Add the loads at the instants ``t_s`` (n,) to a drive table (n, columns)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Stations:
    """The motion of stations on the line.

    Attributes
    ----------
    r_in_body_m : ndarray, shape (n, S, 3)
    D_body_from_local : ndarray, shape (n, S, 3, 3)
    rate_rad_s, specific_force_m_s2 : ndarray, shape (n, S, 3)
        Inertial, in local axes, at the line.
    """

    r_in_body_m: FloatArray
    D_body_from_local: FloatArray
    rate_rad_s: FloatArray
    specific_force_m_s2: FloatArray


class SimWing:
    """A wing that flies one scenario.

    Parameters
    ----------
    beam : Beam
        What it is made of.
    loads : Loads
        What pushes it; before time zero it rests under gravity and the loads of time zero.
    root : RootMotion
        How its root moves.
    epoch_ns : int
        Clock reading at time zero of the scenario, ns.
    step_s : float
        Time step of the beam, s.
    name : str
        Name of the wing in ``Truth``.
    markers : tuple of Marker
        The truth markers.
    stations : int
        Number of points of the line in ``Truth``.
    keep_s : float
        How far back the flight is remembered, s.
    is_left : bool
        Whether it is a left wing: the mirror image of the right one in the plane of symmetry. Its
        loads point, as a right wing's do, to y outboard; all that comes out is in body axes, and
        local axes are the mirrored ones (y inboard).
    """

    def __init__(
        self,
        beam: Beam,
        loads: Loads,
        *,
        root: RootMotion | None = None,
        epoch_ns: int = 0,
        step_s: float = 0.002,
        name: str = "right",
        markers: tuple[Marker, ...] = (),
        stations: int = 31,
        keep_s: float = 40.0,
        is_left: bool = False,
    ) -> None:
        self.beam, self._loads = beam, loads
        self._root = RootMotion() if root is None else root
        self.epoch_ns, self.name, self._markers = epoch_ns, name, markers
        self._step_s, self._keep_s = step_s, keep_s
        self._sides = MIRROR if is_left else np.ones(3)
        self._spins = SPIN_MIRROR if is_left else np.ones(3)
        self._rows = round(BLOCK_S / step_s)
        self._s_m = np.linspace(0.0, beam.span_m, stations)
        self._offset = _offsets(markers)
        first = self._table(0, 1)[0]
        rest = beam.static(first)
        zero = np.zeros_like(rest)
        self._rest = np.stack([rest, zero, zero])
        self._at_rest = np.repeat(self._rest[:, None], self._rows + 1, axis=1)
        self._lock = threading.Lock()
        self._blocks: dict[int, FloatArray] = {}
        self._end, self._state = 0, self._rest

    def _table(self, first: int, count: int) -> FloatArray:
        t_s = np.asarray((first + np.arange(count)) * self._step_s, dtype=np.float64)
        table = np.zeros((count, self.beam.drive().size))
        table[:, :12] = self._root_drive(t_s)
        self._loads.fill(table, t_s)
        return table

    def _root_drive(self, t_s: FloatArray) -> FloatArray:
        """Return the root's motion as the beam has it, shape (n, 12)."""
        signs = (self._spins, self._spins, self._sides, self._sides)
        return np.asarray(self._root.drive(t_s) * np.concatenate(signs))

    def _integrate(self) -> None:
        """Compute the next block; row k of block b is the state at (b rows + k) steps."""
        table = self._table(self._end * self._rows, self._rows + 1)
        history = np.empty((3, self._rows + 1, *self._rest.shape[1:]))
        history[:, 0] = self._state
        strains, speeds, accels = (np.empty_like(history[0, 1:]) for _ in range(3))
        stiffness = self.beam.element_stiffness
        done = integrate(
            self._state, table, self._step_s, SPECTRAL_RADIUS, self.beam.root, self.beam.length_m,
            self.beam.body, self.beam.air, stiffness, self.beam.damping_s * stiffness,
            self.beam.unstrained, strains, speeds, accels,
        )  # fmt: skip
        if done < self._rows:
            at_s = (self._end * self._rows + done) * self._step_s
            msg = f"wing {self.name}: no equilibrium at {at_s:.3f} s; are the loads too hard?"
            raise BeamError(msg)
        history[0, 1:], history[1, 1:], history[2, 1:] = strains, speeds, accels
        self._state = np.ascontiguousarray(history[:, -1])
        self._blocks[self._end] = history
        self._end += 1
        if self._end * BLOCK_S > self._keep_s:
            self._blocks.pop(self._end - 1 - round(self._keep_s / BLOCK_S), None)

    def compute_until(self, t_ns: int) -> None:
        """Compute the motion up to an instant, so that nobody who asks for it has to wait."""
        self._block(int(np.floor((t_ns - self.epoch_ns) * 1e-9 / BLOCK_S)))

    def last_blocks(self) -> tuple[int, FloatArray]:
        """Return the number of the last block but one, and the states of both, for ``go_on``."""
        numbers = (self._end - 2, self._end - 1)
        return numbers[0], np.stack([self._block(number) for number in numbers])

    def go_on(self, number: int, states: FloatArray) -> None:
        """Continue where another wing of the same flight stopped; what was before is forgotten.

        Parameters
        ----------
        number : int
        states : ndarray, shape (2, 3, rows + 1, N, 4)
            As ``last_blocks`` of that wing returned them.
        """
        with self._lock:
            self._blocks = {number: states[0], number + 1: states[1]}
            self._end = number + 2
            self._state = np.ascontiguousarray(states[1][:, -1])

    def _block(self, number: int) -> FloatArray:
        """Return the states of one block of ``BLOCK_S``; a negative number is rest."""
        if number < 0:
            return self._at_rest
        # In a live run several threads ask; what is there never changes, and needs no integration.
        found = self._blocks.get(number)
        if found is None:
            with self._lock:
                while self._end <= number:
                    self._integrate()
                found = self._blocks.get(number)
        if found is None:
            msg = f"wing {self.name}: {number * BLOCK_S:.1f} s is forgotten; ask in order of time"
            raise ValueError(msg)
        return found

    def _states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return strains and two derivatives at times, each of shape (n, N, 4)."""
        shape = (t_s.size, *self._rest.shape[1:])
        q, v, a = np.empty(shape), np.empty(shape), np.empty(shape)
        step = t_s / self._step_s
        number = np.floor(step / self._rows).astype(np.int64)
        for block in sorted(set(number.tolist())):
            history, mask = self._block(block), number == block
            start = block * self._rows
            if mask.all():
                between(history, step - start, self._step_s, q, v, a)
            else:
                part = tuple(np.empty((int(mask.sum()), *shape[1:])) for _ in range(3))
                between(history, step[mask] - start, self._step_s, *part)
                q[mask], v[mask], a[mask] = part
        return q, v, a

    def stations(self, t_ns: TimeArray, s_m: FloatArray) -> Stations:
        """Return the motion of stations at instants.

        Parameters
        ----------
        t_ns : ndarray of int64, shape (n,)
            Instants on the rig's clock, ns.
        s_m : ndarray, shape (S,)
            Arc lengths, m, in any order.
        """
        t_s = np.asarray((t_ns - self.epoch_ns) * 1e-9, dtype=np.float64)
        order = np.argsort(s_m, kind="stable")
        element, within = self.beam.place(s_m[order])
        n, count = t_s.size, s_m.size
        position, rate, felt = (np.empty((n, count, 3)) for _ in range(3))
        frame = np.empty((n, count, 9))
        for first in range(0, n, AT_ONCE):
            some = slice(first, first + AT_ONCE)
            along(
                *self._states(t_s[some]), self._root_drive(np.maximum(t_s[some], 0.0)),
                self.beam.root, self.beam.length_m, element, within,
                position[some], frame[some], rate[some], felt[some],
            )  # fmt: skip
        back = np.argsort(order)
        frames = frame.reshape(n, count, 3, 3)[:, back]
        return Stations(
            position[:, back] * self._sides,
            frames * np.outer(self._sides, self._sides),
            rate[:, back] * self._spins,
            felt[:, back] * self._sides,
        )

    def points(self, t_ns: TimeArray, markers: tuple[Marker, ...]) -> FloatArray:
        """Return where markers are, shape (n, K, 3), body axes, m."""
        s_m = np.array([marker.s_m for marker in markers])
        found = self.stations(t_ns, s_m)
        arm = np.einsum("nkij,kj->nki", found.D_body_from_local, _offsets(markers))
        return np.asarray(found.r_in_body_m + arm)

    def body_from_earth(self, t_ns: TimeArray) -> FloatArray:
        """Return the root's attitude, north-east-down to body, shape (n, 3, 3)."""
        return self._root.attitude(np.maximum((t_ns - self.epoch_ns) * 1e-9, 0.0))

    def truth(self, t_ns: int) -> Truth:
        """Return the shape at one instant."""
        count = self._s_m.size
        marker_s = np.array([marker.s_m for marker in self._markers])
        at = np.array([t_ns], dtype=np.int64)
        found = self.stations(at, np.concatenate([self._s_m, marker_s]))
        # The angles of a left wing are those of the right one that it mirrors.
        frames = found.D_body_from_local[0, :count] * np.outer(self._sides, self._sides)
        local_from_body = frames.transpose(0, 2, 1)
        arm = np.einsum("kij,kj->ki", found.D_body_from_local[0, count:], self._offset)
        return Truth(
            t_ns=t_ns,
            wing=self.name,
            source="sim",
            marker_in_body_m=found.r_in_body_m[0, count:] + arm,
            line_in_body_m=found.r_in_body_m[0, :count],
            phi_rad=np.arctan2(local_from_body[:, 1, 2], local_from_body[:, 2, 2]),
            theta_rad=-np.arcsin(np.clip(local_from_body[:, 0, 2], -1.0, 1.0)),
            psi_rad=np.arctan2(local_from_body[:, 0, 1], local_from_body[:, 0, 0]),
        )


def _offsets(markers: tuple[Marker, ...]) -> FloatArray:
    """Return the markers' places in their sections, shape (K, 3), m."""
    return np.array([[m.x_m, 0.0, m.z_m] for m in markers], dtype=np.float64).reshape(-1, 3)
