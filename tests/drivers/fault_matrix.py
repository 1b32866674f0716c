"""Faults on every sensor bus: what is injected, what is allowed, and what happened.

``python -m tests.drivers.fault_matrix`` writes the table of ``docs/faults.md``.
"""

import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from avionics.config.chips import Bno055Settings, Icm42688Settings
from sim_bus.guests.uml import missing, run_in_guest
from tests.drivers import kernel_faults
from tests.drivers.cameras import camera_faults
from tests.drivers.wing_bench import LAG_NS, SECOND, Bench, Swing, make_bench

LEAD_S, TAIL_S = 1.5, 3.5
# A lost tick or two is no outage.
OUTAGE_NS = 60_000_000
PAGE = Path(__file__).resolve().parents[2] / "docs" / "faults.md"


@dataclass(frozen=True)
class Case:
    """One fault on one bus.

    ``recovery_s`` is the longest time from the end of the fault to unbroken samples, ``counter``
    what must have counted it, ``wrong_s`` for how long wrong rates may pass (0 = never).
    """

    bus: str
    kind: str
    for_s: float
    counter: str
    recovery_s: float
    expected: str
    probability: float = 1.0
    value: float = 1.0
    wrong_s: float = 0.0

    @property
    def name(self) -> str:
        chance = "" if self.probability == 1.0 else f" p={self.probability:g}"
        return f"{self.bus} {self.kind}{chance} {self.for_s:g} s"


@dataclass(frozen=True)
class Outcome:
    """What a case did."""

    recovery_s: float
    lost: int
    wrong_s: float
    wrong_after: int
    counters: dict[str, int]


RESET = "set up again, self-test and settings read back"
ASKED = "all-zero data: state asked, then set up again"
ONCE = "one repetition, then the sample is left out"
CASES = (
    Case("i2c", "nak", 0.3, "i2c_nak", 0.3, "brought up again in the background"),
    Case("i2c", "nak", 1.0, "i2c_nak", 0.1, ONCE, probability=0.2),
    Case("i2c", "stuck_bus", 0.5, "i2c_timeout", 0.6, "brought up again in the background"),
    Case("i2c", "io_error", 0.5, "i2c_io", 0.3, "brought up again in the background"),
    Case("i2c", "arbitration_lost", 1.0, "i2c_arbitration_lost", 0.1, ONCE, probability=0.2),
    Case("i2c", "spike", 1.0, "spikes", 0.1, "second look at what departs from the motion", 0.3),
    Case("i2c", "brown_out", 0.001, "reinitialised", 1.2, RESET),
    Case("i2c", "config_reset", 0.001, "reinitialised", 0.4, ASKED),
    Case("i2c", "page_left", 0.001, "wrong_page", 0.1, "page 0 written back"),
    Case("i2c", "freeze", 1.0, "frozen", 0.9, "reset after 25 equal bursts", wrong_s=0.06),
    Case("i2c", "zero", 0.5, "all_zero", 0.9, "refused; reset if it lasts"),
    Case("i2c", "wrong_chip", 0.5, "identify_retries", 0.3, "refused until the right one answers"),
    Case("spi", "io_error", 0.5, "spi_io", 0.3, "brought up again in the background"),
    Case("spi", "spi_low", 0.5, "all_zero", 0.3, "refused until the right chip id is back"),
    Case("spi", "spi_high", 0.5, "all_ones", 0.3, "refused until the right chip id is back"),
    Case("spi", "spike", 1.0, "spikes", 0.1, "second look at what departs from the motion", 0.3),
    Case("spi", "brown_out", 0.001, "reinitialised", 0.2, "reset, set up again, read back"),
    Case("spi", "config_reset", 0.001, "resets", 0.2, "the next burst says so; set up again"),
    Case("spi", "page_left", 0.001, "wrong_bank", 0.1, "bank 0 written back"),
    Case("spi", "freeze", 1.0, "frozen", 0.9, "reset after 25 equal bursts", wrong_s=0.06),
    Case("spi", "zero", 0.5, "all_zero", 0.9, "refused; reset if it lasts"),
    Case("uart", "uart_overrun", 1.0, "uart_overrun", 0.2, "repeated after 40 ms", 0.3),
    Case("uart", "uart_silence", 0.5, "uart_timeout", 0.6, "brought up again in the background"),
    Case("uart", "uart_garbage", 1.0, "uart_wrong_answer", 0.6, "answer must fit the request", 0.3),
    Case("uart", "uart_late", 1.0, "uart_late", 0.3, "late bytes dropped, then silence", 0.2, 0.06),
    Case("uart", "uart_truncate", 1.0, "uart_timeout", 0.3, "40 ms of silence, then again", 0.2),
    Case("uart", "brown_out", 0.001, "reinitialised", 1.4, RESET),
    Case("uart", "config_reset", 0.001, "reinitialised", 0.6, ASKED),
    Case("uart", "page_left", 0.001, "wrong_page", 0.1, "page 0 written back"),
    Case("uart", "freeze", 1.0, "frozen", 1.1, "reset after 25 equal bursts", wrong_s=0.06),
    Case("uart", "zero", 0.5, "all_zero", 1.1, "refused; reset if it lasts"),
    Case("can", "nak", 0.3, "reported_nak", 1.2, "pod brings its chip up again"),
    Case("can", "io_error", 0.3, "reported_nak", 1.2, "as `nak`: the pod cannot tell them apart"),
    Case("can", "stuck_bus", 0.5, "reported_bus_timeout", 1.5, "nine clocks, then set up again"),
    Case("can", "spike", 1.0, "reported_spike", 0.2, "second look at leaps", 0.5, wrong_s=0.06),
    Case("can", "brown_out", 0.001, "reported_reinit", 1.5, RESET),
    Case("can", "config_reset", 0.001, "reported_reinit", 1.0, RESET),
    Case("can", "page_left", 0.001, "reported_reinit", 1.5, "seen by the check", wrong_s=0.06),
    Case("can", "freeze", 1.0, "reported_frozen", 1.2, "pod resets its chip", wrong_s=0.06),
    Case("can", "pod_silent", 1.5, "silences", 1.2, "reported once, configured again on return"),
    Case("can", "frame_drop", 1.0, "samples_lost", 0.1, "counted by the sequence number", 0.1),
    Case("can", "frame_duplicate", 1.0, "duplicates", 0.1, "dropped by the sequence number"),
    Case("can", "bus_off", 0.5, "samples_lost", 1.5, "pod rejoins after its wait"),
)  # fmt: skip


def run(case: Case, *, seed: int = 3) -> Outcome:
    """Fly one case."""
    chip = Icm42688Settings(kind="icm42688") if case.bus == "spi" else Bno055Settings(mode="amg")
    bench = make_bench(case.bus, chip=chip, seed=seed)
    try:
        return _run(bench, case)
    finally:
        bench.imus.close()
        for pod in bench.pods:
            pod.close()


def _run(bench: Bench, case: Case) -> Outcome:
    bench.imus.open()
    bench.fly(LEAD_S)
    before = _counters(bench)
    start_ns = bench.clock.now_ns()
    end_ns = start_ns + round(case.for_s * SECOND)
    bench.fault(case.kind, 0, 0.0, case.for_s, probability=case.probability, value=case.value)
    samples = bench.fly(case.for_s + TAIL_S)
    times = np.array([start_ns, *(s.t_ns for s in samples), bench.clock.now_ns()])
    gaps = np.flatnonzero(np.diff(times) > OUTAGE_NS)
    back_ns = int(times[gaps[-1] + 1]) if len(gaps) else end_ns
    t_ns = np.array([s.t_ns for s in samples])
    rates = np.array([s.rate_rad_s for s in samples])
    # A register is up to 15 ms old when it is read twice; what lies outside of that is wrong.
    truth = Swing.rate(t_ns - LAG_NS - np.arange(0, 16_000_000, 1_000_000)[:, None])
    low, high = truth.min(axis=0) - 0.03, truth.max(axis=0) + 0.03
    is_wrong = (rates[:, 0] < low) | (rates[:, 0] > high) | (np.abs(rates[:, 2] + 0.3) > 0.03)
    after = _counters(bench)
    counted = {k: v - before.get(k, 0) for k, v in after.items() if v > before.get(k, 0)}
    return Outcome(
        recovery_s=max(0.0, (back_ns - end_ns) / SECOND),
        lost=round((case.for_s + TAIL_S) * 100) - len(samples),
        wrong_s=float(is_wrong.sum()) * 0.01,
        wrong_after=int(is_wrong[t_ns > back_ns + 50_000_000].sum()),
        counters=counted,
    )


def _counters(bench: Bench) -> dict[str, int]:
    return dict(bench.imus.health()["pod 0"])


@dataclass(frozen=True)
class Row:
    """What a row of the table says beside what was measured."""

    bus: str
    fault: str
    lasts: str
    expected: str
    at_most_s: str
    counter: str

    def line(self, recovery_s: float, lost: str, count: int) -> str:
        """Return the row with its measured values, in Markdown."""
        return (
            f"| {self.bus} | {self.fault} | {self.lasts} | {self.expected} "
            f"| {recovery_s:.2f} s (at most {self.at_most_s}) | {lost} "
            f"| `{self.counter}` {count} |"
        )

    @classmethod
    def read(cls, line: str) -> tuple["Row", float, int]:
        """Return a row, its recovery time, s, and its count from a line of the table."""
        bus, fault, lasts, expected, back, _, counted = line.strip("| \n").split(" | ")
        recovery, at_most = back.removesuffix(")").split(" s (at most ")
        counter, count = counted.split()
        row = cls(bus, fault, lasts, expected, at_most, counter.strip("`"))
        return row, float(recovery), int(count)


HEAD = """\
| bus | fault | lasts | expected | back after its end | samples lost | counted |
| --- | --- | --- | --- | --- | --- | --- |
"""


def rows() -> list[Row]:
    """Return what the table must say of all cases, in its order."""
    found = []
    for case in CASES:
        chance = "" if case.probability == 1.0 else f", {case.probability:.0%} of transfers"
        found.append(_row(case.bus, case, f"{case.for_s:g} s", chance))
    found += [_row("camera", case, "once") for case in camera_faults.CASES]
    found += [_row("can, kernel", case, f"{case.for_s:g} s") for case in kernel_faults.CASES]
    return found


def _row(
    bus: str,
    case: Case | camera_faults.CameraCase | kernel_faults.KernelCase,
    lasts: str,
    chance: str = "",
) -> Row:
    fault, at_most_s = f"`{case.kind}`{chance}", f"{case.recovery_s:g}"
    return Row(bus, fault, lasts, case.expected, at_most_s, case.counter)


def table() -> str:
    """Return the table of all cases as Markdown; flies them."""
    done: list[tuple[float, str, dict[str, int]]] = []
    for case in CASES:
        outcome = run(case)
        done.append((outcome.recovery_s, str(max(0, outcome.lost)), outcome.counters))
    for camera_case in camera_faults.CASES:
        seen = camera_faults.run(camera_case)
        done.append((seen.recovery_s, "-", seen.counters))
    done += [(k["recovery_s"], str(k["lost"]), k["counters"]) for k in kernel_outcomes()]
    lines = (
        row.line(recovery_s, lost, counters.get(row.counter, 0))
        for row, (recovery_s, lost, counters) in zip(rows(), done, strict=True)
    )
    return HEAD + "\n".join(lines) + "\n"


def kernel_outcomes() -> list[dict[str, Any]]:
    """Return what became of the faults that only a kernel has, flown in a guest."""
    if (reason := missing()) is not None:
        msg = f"the kernel's rows cannot be made here: {reason}"
        raise SystemExit(msg)
    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        command = [sys.executable, "-m", "tests.drivers.kernel_faults"]
        result = run_in_guest(command, Path(folder), limit_s=300)
        if result.status != 0:
            raise SystemExit(result.stderr or result.failure())
        outcomes: list[dict[str, Any]] = json.loads(result.stdout)
    return outcomes


def main() -> None:
    """Write ``docs/faults.md``."""
    head = (
        "# Faults on the sensor buses\n\n"
        "Made by `python -m tests.drivers.fault_matrix` from seeded flights of the simulated chip\n"
        "behind each bus (on SPI an ICM-42688-P, elsewhere a BNO055), from a scripted GStreamer\n"
        "child, and from a pod on vcan in a guest's kernel (`can, kernel`); the tests assert the\n"
        "bounds.\n\n"
    )
    PAGE.write_text(head + table(), encoding="utf-8")


if __name__ == "__main__":
    main()
