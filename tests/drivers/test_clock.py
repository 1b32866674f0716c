"""Kernel receive stamps to steady time, also when CLOCK_REALTIME steps."""

import random

import pytest

from drivers.clock import SteadyStamps
from tests.drivers.wing_bench import SECOND

OFFSET = 1_700_000_000 * SECOND


@pytest.mark.parametrize(
    "step_ns", [-7 * SECOND, -30_000_000, 30_000_000, 5 * SECOND, 3600 * SECOND]
)
def test_step_of_realtime_bends_nothing(step_ns) -> None:
    # GIVEN frames every 10 ms read up to 8 ms late WHEN the clock steps in between
    rng, stamps = random.Random(2), SteadyStamps()
    offset, errors = OFFSET, []
    for k in range(1000):
        true_ns = 100 * SECOND + k * 10_000_000
        stamp_ns = true_ns + offset  # the kernel stamps at reception
        if k == 500:
            offset += step_ns  # between reception and reading
        read_ns = true_ns + rng.randrange(50_000, 8_000_000)
        errors.append(abs(stamps.convert(stamp_ns, read_ns, read_ns + offset + 2_000) - true_ns))
    # THEN every stamp is right to a few microseconds
    assert max(errors) < 10_000
    assert stamps.steps == 1


def test_stamp_that_cannot_be_becomes_the_present() -> None:
    stamps = SteadyStamps()
    now_ns = 50 * SECOND
    assert stamps.convert(OFFSET + 999 * SECOND, now_ns, OFFSET + now_ns) == now_ns
    assert stamps.convert(0, now_ns, OFFSET + now_ns) == now_ns
