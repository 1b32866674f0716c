"""The virtual machine itself: several CPUs, drivers of hardware, a host that stays clean."""

import os
import subprocess
import time
from pathlib import Path

import pytest

from sim_bus.guests.guest import guest_kind

pytestmark = pytest.mark.vm


def test_guest_knows_that_it_is_one() -> None:
    assert guest_kind() == "vm"


def test_guest_has_two_processors_and_a_steady_clock() -> None:
    assert os.cpu_count() == 2
    start = time.monotonic()
    subprocess.run(["sleep", "1"], check=True)
    assert 1.0 <= time.monotonic() - start < 3.0


def test_guest_finds_the_modules_of_its_own_kernel() -> None:
    done = subprocess.run(
        ["modprobe", "--show-depends", "vivid"], check=True, capture_output=True, text=True
    )
    assert os.uname().release in done.stdout


def test_guest_cannot_write_the_host() -> None:
    lines = [line.split() for line in Path("/proc/mounts").read_text().splitlines()]
    assert ["/", "overlay"] in [line[1:3] for line in lines]
    assert [line[2] for line in lines if line[1] == os.environ["RIG_OUT"]] == ["9p"]
