"""can-utils and cantools understand our traffic by our DBC, and we understand theirs."""

import contextlib
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cantools.database
import numpy as np
import pytest

from drivers.can.imus import CanImus
from drivers.can.pod.codec import encode, filters
from drivers.can.pod.messages import ConfigKey, ConfigRequest
from drivers.can.pod.replicate import dbc_text
from drivers.can.socketcan import SocketCanPort
from drivers.clock import SteadyClock
from sim_bus.bench.served_can import ServedCan
from sim_bus.buses.can_pod import SimPod

pytestmark = pytest.mark.uml

DATABASE = cantools.database.load_string(dbc_text(), "dbc")
DPS = np.degrees(1)
LINE = re.compile(r"\(([\d.]+)\) (\S+) ([0-9A-F]+)#([0-9A-F]*)")


@pytest.fixture
def pod(vcan: str, make_chip) -> Iterator[SimPod]:
    """A pod that flies on vcan5."""
    clock = SteadyClock()
    station = ServedCan("socketcan", vcan, None, clock)
    made = SimPod(3, make_chip(), station.tap(), clock, uid=bytes(range(12)))
    station.start([made])
    yield made
    station.close()


def dumped(channel: str, count: int) -> list[tuple[int, bytes]]:
    """Return frames that candump heard."""
    text = subprocess.run(
        ["candump", "-L", "-n", str(count), "-T", "10000", channel],
        capture_output=True, text=True, check=True, timeout=60,
    ).stdout  # fmt: skip
    found = [LINE.fullmatch(line) for line in text.splitlines()]
    assert len(found) == count, text[-500:]
    return [(int(m[3], 16), bytes.fromhex(m[4])) for m in found]


def test_candump_and_cantools_decode_our_traffic(vcan: str, pod: SimPod, rate_rad_s) -> None:
    time.sleep(1.0)
    frames = dumped(vcan, 200)
    gyros = []
    for identifier, data in frames:
        message = DATABASE.get_message_by_frame_id(identifier)
        signals = message.decode(data)
        assert len(data) == message.length
        if message.name == "Pod03_Gyro":
            gyros.append([signals[axis] for axis in "xyz"])
    assert len(gyros) > 50
    # 2000 deg/s over 15 bits: the chip's own default after the pod has set it up.
    found = np.median(gyros, axis=0) * 2000 / 32768 / DPS
    assert found == pytest.approx(rate_rad_s, abs=0.01)


def test_cantools_own_command_line_decodes_candump(vcan: str, pod: SimPod, tmp_path: Path) -> None:
    dbc = tmp_path / "pod.dbc"
    dbc.write_text(dbc_text(), encoding="latin-1")
    text = "\n".join(
        f"(0.0) {vcan} {identifier:03X}#{data.hex().upper()}"
        for identifier, data in dumped(vcan, 50)
    )
    shown = subprocess.run(
        [sys.executable, "-m", "cantools", "decode", "--single-line", str(dbc)],
        input=text, capture_output=True, text=True, check=True, timeout=60,
    ).stdout  # fmt: skip
    assert shown.count("Pod03_") == 50
    assert "Unknown" not in shown


def test_cansend_can_ask_a_pod(vcan: str, pod: SimPod) -> None:
    identifier, data = encode(ConfigRequest(3, 77, int(ConfigKey.RATE_HZ), 50))
    with contextlib.closing(SocketCanPort(vcan, SteadyClock())) as port:
        subprocess.run(["cansend", vcan, f"{identifier:03X}#{data.hex()}"], check=True)
        give_up = time.monotonic() + 10
        while time.monotonic() < give_up:
            frame = port.recv(0.1)
            if frame is not None and frame.arbitration_id == 0x213:
                reply = DATABASE.get_message_by_name("Pod03_ConfigReply").decode(frame.data)
                assert (reply["token"], reply["value"], reply["result"]) == (77, 50, "done")
                return
    pytest.fail("the pod gave no answer to cansend")


def test_canplayer_flies_a_recorded_bus(vcan: str, pod: SimPod, tmp_path: Path) -> None:
    time.sleep(1.0)
    log = tmp_path / "bus.log"
    log.write_text(
        subprocess.run(
            ["candump", "-L", "-n", "400", vcan], capture_output=True, text=True, check=True
        ).stdout
    )
    subprocess.run(["ip", "link", "add", "vcan6", "type", "vcan"], check=True)
    subprocess.run(["ip", "link", "set", "vcan6", "up"], check=True)
    try:
        port = SocketCanPort("vcan6", SteadyClock(), identifiers=filters())
        imus = CanImus(port, {3: "3"}, SteadyClock())
        player = subprocess.Popen(["canplayer", "-I", str(log), f"vcan6={vcan}"])
        samples = []
        while (sample := imus.read(0.2)) is not None or player.poll() is None:
            samples += [] if sample is None else [sample]
        health = imus.health()
        imus.close()
        wanted = log.read_text().count(" 133#")
        assert abs(len(samples) - wanted) <= 2, (len(samples), wanted, health)
    finally:
        subprocess.run(["ip", "link", "del", "vcan6"], check=False)
