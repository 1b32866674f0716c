"""The fault matrix's rows that need a real kernel: recovery in time, everything counted."""

import pytest

from tests.drivers.kernel_faults import CASES, KernelCase, run

pytestmark = [pytest.mark.uml, pytest.mark.usefixtures("machine_speed")]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.kind)
def test_kernel_fault_is_survived_and_counted(case: KernelCase) -> None:
    outcome = run(case)
    counted = outcome.counters
    assert counted.get(case.counter, 0) > 0, outcome
    if case.kind == "link_down":
        assert counted["returned"] == 1, outcome
    elif case.kind == "reader_stalled":
        dropped = counted["rx_dropped"]
        assert counted["frames_sent"] == counted["frames_received"] + dropped, outcome
    elif case.kind == "foreign_bus_busy":
        assert (outcome.lost, counted.get("foreign_frames", 0)) == (0, 0), outcome
    assert outcome.recovery_s <= case.recovery_s, outcome
