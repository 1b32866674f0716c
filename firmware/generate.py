"""Write gen/pod_dbc.[ch] from drivers/can/pod/pod.dbc with cantools.

The C codec is made for the messages of one pod; the node number is added to the identifier at run
time. Line 4 of either file carries the generator's version and the date, so a comparison drops it.
"""

import sys
import tempfile
from pathlib import Path

from cantools import _main as cantools_main

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parent))
from drivers.can.pod.replicate import dbc_text, node_zero_text  # noqa: E402 - found by the line above


def generate(folder: Path) -> None:
    """Write ``pod_dbc.c`` and ``pod_dbc.h`` into ``folder``."""
    with tempfile.TemporaryDirectory() as scratch:
        layout = Path(scratch) / "pod.dbc"
        layout.write_text(node_zero_text(dbc_text()), encoding="utf-8")
        options = ["--no-floating-point-numbers", "--database-name", "pod_dbc", "-o", str(folder)]
        sys.argv = ["cantools", "generate_c_source", *options, str(layout)]
        cantools_main()


if __name__ == "__main__":
    generate(FOLDER / "gen" if len(sys.argv) < 2 else Path(sys.argv[1]))
