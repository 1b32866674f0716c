"""Fixtures that every test may use; the tiers are in ``sim_bus.guests.pytest_plugin``."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import machine

SHARED = Path(__file__).resolve().parents[1].parent / "shared"

# In the background of a script Ctrl-C is ignored, also by what a test starts and ends with it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the recorded data beside the project."""
    path = SHARED / "data"
    if not path.is_dir():
        pytest.skip("recorded data (../shared/data) is absent")
    return path


@pytest.fixture
def machine_speed(request: pytest.FixtureRequest, record_property) -> float:
    """Speed of this machine now, 1 at most; see ``tests.machine``."""
    found = machine.speed()
    record_property("machine speed", round(found, 2))
    if found < machine.LEAST:
        reason = (
            f"this machine does {found:.0%} of the reference work, {machine.LEAST:.0%} are wanted: "
            "nothing that runs against the wall clock can be judged; run it where less else runs"
        )
        if request.config.getoption("--require") or os.environ.get("RIG_REQUIRE"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@pytest.fixture
def vcan() -> Iterator[str]:
    """A virtual CAN bus that is up; for tests in a guest, whose kernel is theirs."""
    for words in (("add", "vcan5", "type", "vcan"), ("set", "vcan5", "up")):
        subprocess.run(["ip", "link", *words], check=True, capture_output=True)
    yield "vcan5"
    subprocess.run(["ip", "link", "del", "vcan5"], check=False, capture_output=True)
