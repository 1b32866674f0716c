"""Write the messages of pods 1 to 15 into ``pod.dbc`` from those of pod 0.

The layout is edited in one place, the ``Pod00`` messages; every other pod has the same frames at
identifier + node. ``python -m drivers.can.pod.replicate`` rewrites the file.
"""

import re
from importlib import resources
from pathlib import Path

NODES = 16

_MESSAGE = re.compile(r"^BO_ (\d+) (\w+): .*\n(?: SG_ .*\n)+\n?", re.MULTILINE)
_VALUES = re.compile(r"^VAL_ (\d+) .*\n", re.MULTILINE)
_COMMENT = re.compile(r"^CM_ (?:BO_|SG_) (\d+) .*\n", re.MULTILINE)


def dbc_text() -> str:
    """Return the text of the packaged ``pod.dbc``."""
    return resources.files("drivers.can.pod").joinpath("pod.dbc").read_text(encoding="utf-8")


def node_zero_text(text: str) -> str:
    """Return the layout of one pod: pods 1 to 15 left out and the prefix ``Pod00_`` dropped.

    This is what the firmware's C codec is generated from.
    """
    other = {int(m[1]) for m in _MESSAGE.finditer(text) if re.match(r"Pod(?!00_)\d\d_", m[2])}
    for pattern in (_MESSAGE, _VALUES, _COMMENT):
        text = pattern.sub(lambda m: "" if int(m[1]) in other else m[0], text)
    return text.replace(" Pod00_", " ")


def replicate(text: str) -> str:
    """Return ``text`` with the messages of pods 1 to 15 copied from those of pod 0."""
    own = {int(m[1]): m for m in _MESSAGE.finditer(text) if m[2].startswith("Pod00_")}
    other = {int(m[1]) for m in _MESSAGE.finditer(text) if re.match(r"Pod(?!00_)\d\d_", m[2])}
    for pattern in (_MESSAGE, _VALUES, _COMMENT):
        text = pattern.sub(lambda m: "" if int(m[1]) in other else m[0], text)

    def moved(match: "re.Match[str]", node: int) -> str:
        base = int(match[1])
        block = match[0].replace(f" {base} ", f" {base + node} ", 1)
        return block.replace(" Pod00_", f" Pod{node:02d}_", 1).rstrip("\n") + "\n"

    blocks = "".join(moved(own[b], n) + "\n" for n in range(1, NODES) for b in sorted(own))
    values = [m for m in _VALUES.finditer(text) if int(m[1]) in own]
    tables = "".join(moved(m, n) for n in range(1, NODES) for m in values)
    comments_at = text.index('CM_ "')
    return text[:comments_at] + blocks + text[comments_at:] + tables


def main() -> None:
    """Rewrite ``pod.dbc`` beside this file."""
    path = Path(__file__).with_name("pod.dbc")
    path.write_text(replicate(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
