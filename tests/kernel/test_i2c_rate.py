"""Two sensors on one genuine I2C bus at 100 Hz: the achieved rate, its jitter, every loss."""

import contextlib
import os
import time
from pathlib import Path

import numpy as np
import pytest

from avionics.config.load import load_config
from drivers.prompt_threads import prompt_threads
from drivers.samples import ImuSample
from tests import machine
from tests.kernel import hil
from tests.opening import open_imus

pytestmark = pytest.mark.uml

CHIP = 'chip={{mode="gyronly",rate_hz={0}}}'
PODS = (
    f'pods=[{{{{id=0,s_m=0.6,{CHIP},link={{{{kind="i2c",bus=1,address=0x28}}}}}}}},'
    f'{{{{id=1,s_m=1.2,{CHIP},link={{{{kind="i2c",bus=1,address=0x29}}}}}}}}]'
)
# Each is a tick without a sample; a bring-up takes ticks that nothing counts, and must not occur.
LOST_TICK = ("ticks_missed", "read_failed", "read_slow", "rejected", "all_zero", "stale")


@pytest.mark.timeout(300)
@pytest.mark.parametrize("seconds", [10, pytest.param(60, marks=pytest.mark.proof)])
def test_two_sensors_at_100_hz(seconds: int, machine_speed: float, record_property) -> None:
    """100 Hz on a machine of speed 1; on a slower one less, with the same share to be kept."""
    wanted_hz = machine.rate_hz(100, machine_speed)
    folder = Path(os.environ["RIG_OUT"]) / f"rate-{seconds}"
    folder.mkdir()
    pods = PODS.format(wanted_hz)
    bench = hil.serve(folder, "--i2c-dev", "5", "--set", pods, socket=Path("/run/rate.sock"))
    try:
        config = load_config(bench.config)
        samples: list[ImuSample] = []
        with prompt_threads(), contextlib.closing(open_imus(config.pods)) as imus:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                sample = imus.read(0.1)
                if sample is not None:
                    samples.append(sample)
            health = imus.health()
    finally:
        bench.stop()
    report, kept, medians_ms = [f"{wanted_hz} Hz wanted"], [], []
    for pod in config.pod_names:
        mine = [s for s in samples if s.pod == pod]
        steps_ms = np.diff([s.t_ns for s in mine]) * 1e-6
        ticks = mine[-1].seq - mine[0].seq + 1
        lost = ticks - len(mine)
        counted = sum(health[f"pod {pod}"].get(name, 0) for name in LOST_TICK)
        rate_hz = len(mine) / seconds
        report.append(
            f"pod {pod}: {rate_hz:.2f} Hz, step {np.median(steps_ms):.2f} ms in the median, "
            f"{np.percentile(steps_ms, 99):.2f} ms at 99 %, {lost} of {ticks} lost"
        )
        kept.append(rate_hz / wanted_hz)
        medians_ms.append(float(np.median(steps_ms)))
        assert health[f"pod {pod}"].get("reinitialised", 0) == 0
        assert lost <= counted
    record_property("report", "; ".join(report))
    assert min(kept) > 0.9, report
    assert medians_ms == pytest.approx([1000 / wanted_hz] * 2, abs=0.5), report
