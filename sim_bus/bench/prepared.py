"""What a bench plays back: the motion, the truth and the pictures of a flight, made beforehand.

Times count from the scenario's time zero. A table of motion has a row each millisecond; between
two rows a cubic through four of them is exact to 1e-4 of a signal of 50 Hz.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from avionics.config import Pod
from avionics.records import Truth
from sim_bus.camera.strip import Strip
from sim_bus.wing.motion import PodMotion
from sim_bus.wing.sim_wing import SimWing

FloatArray = NDArray[np.float64]
ROW_NS: Final = 1_000_000
# Rate, specific force and flux with three columns each, then the nine of the attitude.
COLUMNS: Final = 18
_MOTION, _STRIP = "motion ", "strip "


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A flight from its time zero on.

    Attributes
    ----------
    end_ns : int
        Up to where it goes, ns.
    motion : dict of str to ndarray of float32, shape (n, 18)
        By pod: rate (rad/s), specific force (m/s^2), flux (T), attitude (row by row).
    truth_ns : int
        Time between two shapes, ns.
    markers_m, line_m, angles_rad : ndarray, shape (n, K, 3), (n, S, 3), (n, 3, S)
        The shapes, as ``Truth`` has them; angles are phi, theta and psi.
    tail_number : int
    tail : ndarray
        As ``SimWing.last_blocks``: where the motion goes on.
    strip : Strip or None
        The pictures, if there is a camera.
    """

    end_ns: int
    motion: dict[str, NDArray[np.float32]]
    truth_ns: int
    markers_m: FloatArray
    line_m: FloatArray
    angles_rad: FloatArray
    tail_number: int
    tail: FloatArray
    strip: Strip | None

    def truth(self, t_ns: int, wing: str, *, epoch_ns: int) -> Truth | None:
        """Return the shape at an instant of the rig's clock, None if it was not prepared."""
        row, beside = divmod(t_ns - epoch_ns, self.truth_ns)
        if beside or not 0 <= row < len(self.line_m):
            return None
        phi, theta, psi = self.angles_rad[row]
        return Truth(
            t_ns=t_ns, wing=wing, source="sim", marker_in_body_m=self.markers_m[row],
            line_in_body_m=self.line_m[row], phi_rad=phi, theta_rad=theta, psi_rad=psi,
        )  # fmt: skip

    def save(self, path: Path) -> None:
        """Write it to a file, in one step: another bench may write the same one.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        arrays: dict[str, Any] = {f"{_MOTION}{pod}": table for pod, table in self.motion.items()}
        if self.strip is not None:
            arrays |= {f"{_STRIP}{name}": array for name, array in self.strip.arrays().items()}
        part = path.with_name(f"{path.name}.{np.random.default_rng().integers(1 << 62):x}")
        try:
            with part.open("wb") as stream:
                np.savez(
                    stream, numbers=np.array([self.end_ns, self.truth_ns, self.tail_number]),
                    markers=self.markers_m, line=self.line_m, angles=self.angles_rad,
                    tail=self.tail, **arrays,
                )  # fmt: skip
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)

    @classmethod
    def load(cls, path: Path) -> "Prepared":
        """Read what ``save`` wrote.

        Raises
        ------
        OSError, ValueError, KeyError, zipfile.BadZipFile
            If it is not there or not whole.
        """
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as found:
            arrays = {name: found[name] for name in found.files}
        end_ns, truth_ns, tail_number = arrays["numbers"].tolist()
        motion = {
            name.removeprefix(_MOTION): table
            for name, table in arrays.items()
            if name.startswith(_MOTION)
        }
        strip = {
            name.removeprefix(_STRIP): array
            for name, array in arrays.items()
            if name.startswith(_STRIP)
        }
        return cls(
            end_ns, motion, truth_ns, arrays["markers"], arrays["line"], arrays["angles"],
            tail_number, arrays["tail"], Strip.from_arrays(strip) if strip else None,
        )  # fmt: skip


class PlayedMotion:
    """The motion of one pod from a table, where there is one; a ``sensing.Motion``.

    Parameters
    ----------
    wing : SimWing
        The wing: its time zero, and what no table has.
    pod : Pod
        The pod.
    """

    def __init__(self, wing: SimWing, pod: Pod) -> None:
        self._wing, self._computed = wing, PodMotion(wing, pod)
        self._table: NDArray[np.float32] | None = None

    def play(self, table: NDArray[np.float32]) -> None:
        """Take the motion from a table of ``Prepared`` from now on."""
        self._table = table

    def sense(self, t_ns: NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return angular rate (rad/s), specific force (m/s^2) and flux (T), each (n, 3)."""
        if self._table is None:
            return self._computed.sense(t_ns)
        age_ns = t_ns - self._wing.epoch_ns
        is_played = age_ns <= (len(self._table) - 1) * ROW_NS
        found = np.empty((len(t_ns), 9))
        found[is_played] = _between(self._table[:, :9], age_ns[is_played])
        if not is_played.all():
            found[~is_played] = np.hstack(self._computed.sense(t_ns[~is_played]))
        return found[:, :3], found[:, 3:6], found[:, 6:]

    def attitude(self, t_ns: int) -> FloatArray:
        """Return the direction cosine matrix, north-east-down to sensor."""
        age_ns = t_ns - self._wing.epoch_ns
        if self._table is None or age_ns > (len(self._table) - 1) * ROW_NS:
            return self._computed.attitude(t_ns)
        return _between(self._table[:, 9:], np.array([age_ns])).reshape(3, 3)


def _between(table: NDArray[np.float32], age_ns: NDArray[np.int64]) -> FloatArray:
    """Return the rows at instants, by the cubic through four rows; before the first one, that."""
    place = np.maximum(age_ns, 0) / ROW_NS
    first = np.clip(place.astype(np.int64) - 1, 0, len(table) - 4)
    x = (place - first)[:, None]
    weights = (
        (x - 1) * (x - 2) * (3 - x) / 6, x * (x - 2) * (x - 3) / 2,
        x * (x - 1) * (3 - x) / 2, x * (x - 1) * (x - 2) / 6,
    )  # fmt: skip
    return np.asarray(sum(w * table[first + k] for k, w in enumerate(weights)))
