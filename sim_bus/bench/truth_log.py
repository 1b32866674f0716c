"""The truth of a bench, recorded on the serving side: shapes, and what perfect sensors would feel.

A log like any other: ``/wing/NAME/truth``, ``/imu/POD`` without chip errors or delay, and events.
``avionics rig join`` puts it beside the log of the flight.
"""

from collections import deque
from pathlib import Path
from types import TracebackType
from typing import Final

import numpy as np

from avionics.recording import LogWriter
from drivers.clock import boot_id, utc_offset_ns
from drivers.events import Event
from drivers.samples import ImuSample
from sim_bus.bench.bench import Bench

ROLE: Final = "truth"
IMU_PERIOD_NS: Final = 10_000_000


class TruthLog:
    """Writes what is due whenever it is called; a context manager.

    Parameters
    ----------
    path : Path
        The log to write.
    bench : Bench
        The bench.
    force : bool
        Replace an existing log.

    Raises
    ------
    OutputExistsError
        If the log exists and ``force`` is False.
    """

    def __init__(self, path: Path, bench: Bench, *, force: bool = False) -> None:
        self._bench = bench
        self._said: deque[Event] = deque()
        self._period_ns = round(1e9 / bench.scenario.truth_hz)
        self._truth_ns = self._imu_ns = bench.clock.now_ns()
        self._index = 0
        self._writer = LogWriter(
            path,
            bench.config,
            utc_offset_ns=utc_offset_ns(),
            metadata={
                "role": ROLE,
                "boot_id": boot_id(),
                "scenario": bench.scenario.name,
                "seed": str(bench.seed),
            },
            force=force,
        )

    def say(self, message: str) -> None:
        """Keep an event for the log; may be called from any thread."""
        self._said.append(Event(self._bench.clock.now_ns(), "bench", "info", message))

    def write_due(self) -> None:
        """Write what became true since the last call."""
        now_ns = self._bench.clock.now_ns()
        while self._truth_ns <= now_ns:
            # From the scenario's time zero on, the instants count from there.
            if self._truth_ns - self._period_ns < self._bench.wing.epoch_ns < self._truth_ns:
                self._truth_ns = self._bench.wing.epoch_ns
            truth = self._bench.truth(self._truth_ns)
            self._writer.write(truth, now_ns)
            self._truth_ns += self._period_ns
        times = np.arange(self._imu_ns, now_ns, IMU_PERIOD_NS, dtype=np.int64)
        if times.size:
            self._imu_ns = int(times[-1]) + IMU_PERIOD_NS
            self._write_imus(times, now_ns)
        while self._said:
            event = self._said.popleft()
            self._writer.write(event, now_ns)

    def _write_imus(self, times: "np.ndarray[tuple[int], np.dtype[np.int64]]", now_ns: int) -> None:
        for pod, motion in self._bench.motions.items():
            rate, force, flux = motion.sense(times)
            for k, t_ns in enumerate(times.tolist()):
                sample = ImuSample(t_ns, pod, self._index + k, rate[k], force[k], flux[k])
                self._writer.write(sample, now_ns)
        self._index += len(times)

    def __enter__(self) -> "TruthLog":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self.write_due()
        self._writer.close()
