"""The figures in docs/firmware.md that a program can compute are the ones it gives."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_bus_load_table_is_the_computed_one() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "firmware" / "bus_load.py")],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout in (ROOT / "docs" / "firmware.md").read_text(encoding="utf-8")
