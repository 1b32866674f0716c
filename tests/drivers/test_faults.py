"""The fault matrix: recovery in time, nothing wrong passed on, everything counted."""

import pytest

from tests.drivers.cameras import camera_faults
from tests.drivers.fault_matrix import CASES, HEAD, PAGE, Case, Row, rows, run

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_fault_is_survived_and_counted(case: Case) -> None:
    outcome = run(case)
    assert outcome.recovery_s <= case.recovery_s
    assert outcome.wrong_s <= case.wrong_s
    assert outcome.wrong_after == 0
    count = outcome.counters.get(case.counter, 0)
    assert count > 0
    # Seeded and simulated: the page's figures are this run's.
    line = rows()[CASES.index(case)].line(outcome.recovery_s, str(max(0, outcome.lost)), count)
    assert line in PAGE.read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("case", camera_faults.CASES, ids=lambda case: case.kind)
def test_camera_fault_is_survived_and_counted(case: camera_faults.CameraCase) -> None:
    outcome = camera_faults.run(case)
    assert outcome.counters.get(case.counter, 0) > 0
    assert outcome.recovery_s <= case.recovery_s


def test_matrix_is_large_enough() -> None:
    assert len({(case.bus, case.kind) for case in CASES}) >= 20


def test_the_page_says_of_every_case_what_the_matrix_would_write() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert HEAD in text
    found = [Row.read(line) for line in text.split(HEAD)[1].splitlines()]
    assert [row for row, _, _ in found] == rows()
    for row, recovery_s, count in found:
        assert recovery_s <= float(row.at_most_s), row
        assert count > 0, row
