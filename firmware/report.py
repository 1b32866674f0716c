"""Report what the ELFs take of the board, and fail when it is too much.

Code and constants, static memory, and a bound of the stack: the deepest path through the call
graph that gcc writes (``-fcallgraph-info=su``). A call through the HAL table may reach any function
that is stored in one; interrupts of one priority do not nest, so the deepest handler and its
exception frame come on top once.
"""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

FLASH_LIMIT, RAM_LIMIT = 32 * 1024, 8 * 1024
# Eight registers that the core stacks, and the word that keeps the stack at eight bytes.
EXCEPTION_FRAME = 36
# Functions that libgcc brings, without a call graph: 64-bit division (read from its listing).
LIBRARY_FRAME = 48
NODE = re.compile(r'node: \{ title: "([^"]+)" label: "([^"]*)"')
EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
BYTES = re.compile(r"(\d+) bytes \((static|dynamic[^)]*)\)")
# What the HAL tables and the register ports hold (main.c).
STORED = {
    "flight": "i2c_read i2c_write i2c_timed_out i2c_is_ready recover_imu can_send can_receive "
    "can_lost can_is_bus_off can_restart store_node watchdog_kick board_reset ticks_now_us",
    "serial": "bno055_uart_read bno055_uart_write bno055_uart_timed_out bno055_uart_is_ready "
    "recover_imu slcan_link_send slcan_link_receive slcan_link_lost slcan_link_is_bus_off "
    "slcan_link_restart "
    "store_node watchdog_kick board_reset ticks_now_us usart_read usart_write ticks_rest",
}
# Who calls through which table: the HAL is called by the core, the serial line by bno055_uart.c.
SERIAL_LINE = ["usart_read", "usart_write", "ticks_now_us", "ticks_rest"]
HANDLERS = {
    "SysTick_Handler", "CAN1_RX0_Handler", "CAN1_TX_Handler", "USART3_Handler", "USART6_Handler"
}  # fmt: skip


class CallGraph:
    """Frame sizes and calls of one variant, from gcc's ``.ci`` files."""

    def __init__(self, folder: Path) -> None:
        self.variant = folder.name
        self.frames: dict[str, int] = {}
        self.calls: dict[str, set[str]] = {}
        for path in sorted(folder.rglob("*.ci")):
            text = path.read_text(encoding="utf-8")
            for title, label in NODE.findall(text):
                size = BYTES.search(label)
                if size is not None:
                    assert size[2] == "static", f"{title}: its frame is not of a fixed size"
                    self.frames[title] = int(size[1])
            for source, target in EDGE.findall(text):
                self.calls.setdefault(source, set()).add(target)

    def depth(self, function: str) -> tuple[int, list[str]]:
        """Return the deepest stack below ``function``, bytes, and the path to it."""

        @cache
        def below(name: str, path: tuple[str, ...]) -> tuple[int, tuple[str, ...]]:
            assert name not in path, f"recursion: {' -> '.join((*path, name))}"
            own = self.frames.get(name, LIBRARY_FRAME)
            deepest: tuple[int, tuple[str, ...]] = (0, ())
            for target in self._targets(name):
                deepest = max(deepest, below(target, (*path, name)))
            return own + deepest[0], (name, *deepest[1])

        size, path = below(function, ())
        return size, list(path)

    def _targets(self, name: str) -> set[str]:
        direct = self.calls.get(name, set())
        targets = {t for t in direct if t != "__indirect_call"}
        if "__indirect_call" in direct:
            # bno055_uart.c calls the serial line alone, the rest of the core the HAL.
            is_line = "bno055_uart" in name
            through = SERIAL_LINE if is_line else STORED[self.variant].split()
            targets |= {t for t in self.frames if _plain(t) in through}
        return targets


def _plain(title: str) -> str:
    """Return the function's name without the file that gcc puts before a static one."""
    name = title.rsplit(":", maxsplit=1)[-1]
    return re.sub(r"\.(constprop|isra|part)\.\d+", "", name)


def stack_bound(folder: Path) -> tuple[int, list[str]]:
    """Return the bound of the stack of one variant, bytes, and the deepest path of main."""
    graph = CallGraph(folder)
    size, path = graph.depth("Reset_Handler")
    handlers = [graph.depth(name)[0] for name in graph.frames if _plain(name) in HANDLERS]
    return size + EXCEPTION_FRAME + max(handlers), path


def sizes(elf: Path) -> tuple[int, int, int]:
    """Return flash, static memory and reserved stack of an ELF, bytes."""
    done = subprocess.run(
        ["arm-none-eabi-size", "-A", str(elf)], capture_output=True, text=True, check=True
    )
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith(".")]
    found = {name: int(size) for name, size, _address in lines}
    flash = found[".text"] + found[".data"]
    return flash, found[".data"] + found[".bss"] + found[".noinit"], found[".stack"]


def main(elves: list[str]) -> int:
    """Print one line per ELF; returns 1 if one is too large."""
    is_good = True
    for elf in map(Path, elves):
        flash, memory, reserved = sizes(elf)
        bound, path = stack_bound(elf.with_suffix(""))
        sys.stdout.write(
            f"{elf.name}: flash {flash} of {FLASH_LIMIT} B; RAM {memory + reserved} of "
            f"{RAM_LIMIT} B ({memory} static, {reserved} stack); stack bound {bound} B\n"
            f"  deepest: {' -> '.join(map(_plain, path))}\n"
        )
        is_good &= flash <= FLASH_LIMIT and memory + reserved <= RAM_LIMIT and bound <= reserved
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
