"""A guest ends with the command that started it, however that ends; a shell stands for it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sim_bus.guests.guest import STATUS_DIED, prepare, run_to_the_end

RUN = """
import signal
import sys
from pathlib import Path
from sim_bus.guests.guest import prepare, run_to_the_end

# A test run under nohup, or in the background, has them ignored.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
out = Path(sys.argv[1])
prepare(out, ["true"], [])
run_to_the_end(["sh", "-c", sys.argv[2]], out, limit_s=60, echo=True)
"""


def is_alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def wait_until(condition, what: str) -> None:
    give_up = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < give_up, what
        time.sleep(0.02)


def children(pid: int) -> set[int]:
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return {int(word) for task in tasks for word in task.read_text().split()}


def numbers(path: Path) -> list[int]:
    return [int(word) for word in path.read_text().split()] if path.exists() else []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGKILL])
def test_guest_ends_with_its_parent(tmp_path: Path, number: signal.Signals) -> None:
    # GIVEN a guest that runs, with a process of its own
    pids = tmp_path / "pids"
    parent = subprocess.Popen(
        [sys.executable, "-c", RUN, str(tmp_path), f"sleep 60 & echo $$ $! > {pids}; wait"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    wait_until(lambda: len(numbers(pids)) == 2, "the guest did not start")
    guest, helper = numbers(pids)
    wait_until(lambda: len(children(parent.pid)) == 4, "it is not watched, or nothing echoes it")
    others = children(parent.pid) - {guest}
    try:
        # WHEN the command that started it is ended
        parent.send_signal(number)
        status = parent.wait(20)
        # THEN nothing is left, and the status tells the signal
        wait_until(lambda: not any(map(is_alive, (guest, helper))), "the guest lives on")
        wait_until(lambda: not any(map(is_alive, others)), "what serves it lives on")
        if number in {signal.SIGTERM, signal.SIGHUP}:
            assert status == 128 + number
    finally:
        for pid in (guest, helper):
            if is_alive(pid):
                os.kill(pid, signal.SIGKILL)


def test_handlers_of_before_come_back(tmp_path: Path) -> None:
    before = [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)]
    prepare(tmp_path, ["true"], [])
    result = run_to_the_end(["sh", "-c", "echo booting"], tmp_path, limit_s=20, echo=False)
    assert result.status == STATUS_DIED
    assert "booting" in result.failure()
    assert [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)] == before


def test_guest_that_runs_too_long_is_ended_and_told(tmp_path: Path) -> None:
    prepare(tmp_path, ["true"], [])
    result = run_to_the_end(["sleep", "60"], tmp_path, limit_s=1, echo=False)
    assert result.status == STATUS_DIED
    assert "ran longer than 1 s" in result.failure()
