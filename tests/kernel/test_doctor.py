"""`avionics rig doctor` on a bare machine names every missing piece and what installs it."""

import os
import subprocess
import sys

import pytest

from sim_bus.guests.tiers import TIERS, Piece, Tier

TOOLS = (
    "linux.uml", "candump", "cansend", "canplayer", "gst-launch-1.0", "gst-inspect-1.0",
    "arm-none-eabi-gcc", "qemu-system-arm", "qemu-system-x86_64", "busybox", "cpio",
    "C compiler", "gdppay",
)  # fmt: skip
PACKAGES = ("user-mode-linux", "can-utils", "gstreamer1.0-plugins-bad", "gcc-arm-none-eabi",
            "qemu-system-arm", "qemu-system-x86", "busybox-static")  # fmt: skip


def test_bare_machine_is_told_everything() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "avionics", "rig", "doctor"],
        capture_output=True, text=True, timeout=120, check=False,
        env={"PATH": "", "HOME": os.environ.get("HOME", "/"), "COLUMNS": "250"},
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    for word in (*TOOLS, *PACKAGES):
        assert word in done.stdout, word


@pytest.mark.parametrize("tier", TIERS, ids=lambda tier: tier.name)
def test_every_piece_says_what_installs_it(tier: Tier) -> None:
    assert all(piece.remedy for piece in tier.pieces)


def test_reason_names_all_missing_pieces_and_each_remedy_once() -> None:
    gone = [Piece(name, lambda: False, "apt-get install x") for name in ("this", "that")]
    tier = Tier("t", "c", (*gone, Piece("here", lambda: True, "y")))
    assert tier.missing() == "this, that not found; apt-get install x"
