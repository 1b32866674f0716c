"""The guest itself: a real kernel with CAN, CUSE and an overlay that keeps the host clean."""

import socket
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.uml


def test_guest_has_socketcan() -> None:
    subprocess.run(["ip", "link", "add", "vcan9", "type", "vcan"], check=True)
    subprocess.run(["ip", "link", "set", "vcan9", "up"], check=True)
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sender:
        sender.bind(("vcan9",))
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as receiver:
            receiver.bind(("vcan9",))
            receiver.settimeout(2)
            frame = (0x123).to_bytes(4, "little") + bytes([2, 0, 0, 0, 0x11, 0x22]) + bytes(6)
            sender.send(frame)
            assert receiver.recv(16) == frame
    subprocess.run(["ip", "link", "del", "vcan9"], check=True)


def test_guest_has_cuse() -> None:
    assert Path("/dev/cuse").is_char_device()


def test_guest_cannot_write_the_host() -> None:
    assert "overlay" in Path("/proc/mounts").read_text().split("\n")[0] or any(
        line.split()[1:3] == ["/", "overlay"]
        for line in Path("/proc/mounts").read_text().split("\n")
        if line
    )
