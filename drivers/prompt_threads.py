"""How long a thread that its device has woken waits for the interpreter."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

# Python's own 5 ms are as long as the whole burst of a chip: while another thread computes, the end
# of a transfer is noticed late, and the sample is thrown away as one that was held up.
SWITCH_S: Final = 5e-4


@contextmanager
def prompt_threads() -> Iterator[None]:
    """Let threads take turns every half millisecond while the block lasts."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before_s)
