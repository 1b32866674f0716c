"""docs/bring-up.md does what it says: its script gives a pod its number."""

import re
import time
from pathlib import Path

import can
import numpy as np
import pytest
from bench import Wobble

from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.buses.can_pod import SimPod
from sim_bus.buses.pod_core import NODE_NONE
from sim_bus.realtime import PacedClock

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bring-up.md"
CHANNEL = "bring-up page"


def script(old: int, new: int) -> str:
    found = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    text = found[1]
    for ours, theirs in (
        ('interface="socketcan", channel="can0"', f'interface="virtual", channel="{CHANNEL}"'),
        ("OLD, NEW = 15, 4", f"OLD, NEW = {old}, {new}"),
    ):
        assert ours in text
        text = text.replace(ours, theirs)
    return text


@pytest.mark.parametrize(("node", "wire", "new"), [(NODE_NONE, 15, 4), (3, 3, 7)])
def test_script_gives_a_number_that_holds_after_the_reset(capsys, node, wire, new) -> None:
    clock = PacedClock()
    chip = SimBno055(Wobble(), np.random.default_rng(7), power_on_ns=clock.now_ns())
    bus = can.Bus(interface="virtual", channel=CHANNEL)
    pod = SimPod(node, chip, bus, clock)
    with can.Bus(interface="virtual", channel=CHANNEL) as ear:
        clock.on_advance(pod.step)
        try:
            exec(script(wire, new), {})
            assert capsys.readouterr().out == "NODE DONE\nRESET DONE\n"
            give_up = time.monotonic() + 20.0
            while time.monotonic() < give_up:
                message = ear.recv(1.0)
                if message is not None and message.arbitration_id == 0x300 + new:
                    break
            else:
                pytest.fail(f"no Identity of node {new}")
        finally:
            clock.close()
            pod.close()
