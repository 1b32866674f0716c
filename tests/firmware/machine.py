"""The linked ARM ELF in Unicorn: memory, peripherals, simulated time and its interrupts.

Time moves with each look at the SysTick counter and, at WFI, to the next event. Unicorn delivers
no interrupts, so the machine runs the handlers by symbol whenever the core sleeps or a millisecond
has passed. Handlers therefore never cut into the middle of a statement: races show in QEMU only.
"""

from pathlib import Path

import numpy as np
from elftools.elf.elffile import ELFFile
from stm32_models import BxCan, Gpio, I2c, Rcc, SensorBus, Usart, Watchdog
from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_MODE_MCLASS, UC_MODE_THUMB, Uc
from unicorn.arm_const import (
    UC_ARM_REG_LR,
    UC_ARM_REG_PC,
    UC_ARM_REG_SP,
    UC_CPU_ARM_CORTEX_M4,
)

from sim_bus.chip.bno055.chip import SimBno055

FLASH, RAM, UID, STOP_AT = 0x0800_0000, 0x2000_0000, 0x1FFF_7000, 0x0800_F000
LOOK_NS = 8_000  # what one look at the counter and the code around it take
TICK_NS = 1_000_000


class Machine:
    """One pod's microcontroller with its chip and its bus.

    Parameters
    ----------
    elf : Path
        The flight ELF.
    motion
        What moves the chip (``sim_bus`` Motion).
    node : int
        Node number as strapped.
    """

    def __init__(self, elf: Path, motion, *, node: int = 3, uid: bytes = bytes(range(12))) -> None:
        self.now = 0
        self.chip = SimBno055(motion, np.random.default_rng(7))
        self.lines = SensorBus()
        self.rcc, self.i2c = Rcc(), I2c(self._now_ns, self.chip, self.lines)
        self.can, self.watchdog = BxCan(self._now_ns), Watchdog(self._now_ns)
        self.gpio_a, self.gpio_b, self.gpio_c = Gpio(), Gpio(self.lines), Gpio()
        self.gpio_a.inputs &= ~(node << 4)
        self.gpio_c.inputs &= ~(1 << 4)
        self.usart3, self.usart6 = Usart(), Usart()
        self.resets = 0
        self._elf, self._uid = elf, uid
        self._blocks = {
            0x40005400: self.i2c, 0x40006400: self.can, 0x40003000: self.watchdog,
            0x40023800: self.rcc, 0x40020000: self.gpio_a, 0x40020400: self.gpio_b,
            0x40020800: self.gpio_c, 0x40023C00: Gpio(), 0x40007000: Gpio(),
            0x40004800: self.usart3, 0x40011400: self.usart6,
        }  # fmt: skip
        self.power_up()

    def _now_ns(self) -> int:
        return self.now

    def power_up(self) -> None:
        """Load the ELF into fresh memory and put the core at its reset vector."""
        uc = self.uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS, UC_CPU_ARM_CORTEX_M4)
        uc.mem_map(FLASH, 0x100000)
        uc.mem_map(RAM, 0x20000)
        uc.mem_map(UID, 0x1000)
        uc.mem_write(0x080E0000, b"\xff" * 0x20000)
        uc.mem_write(0x1FFF7A10, self._uid)
        with self._elf.open("rb") as stream:
            image = ELFFile(stream)
            for segment in image.iter_segments():
                if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]:
                    uc.mem_write(segment["p_paddr"], segment.data())
            table = image.get_section_by_name(".symtab")
            self.symbols = {s.name: s["st_value"] for s in table.iter_symbols() if s.name}
        uc.mmio_map(0x4000_0000, 0x30000, self._read, 0x40000000, self._write, 0x40000000)
        uc.mmio_map(0xE000_E000, 0x1000, self._read_core, None, self._write_core, None)
        self.boot()

    def boot(self) -> None:
        """Reset the core; memory keeps what it held."""
        self.systick: dict[int, int] = {}
        self.tick_at = self._ticked_ns = self.now
        self._pending_tick = self._is_in_handler = False
        stack, entry = np.frombuffer(bytes(self.uc.mem_read(FLASH, 8)), dtype="<u4").tolist()
        self.uc.reg_write(UC_ARM_REG_SP, stack)
        self.pc = entry
        self.reset_wanted = False

    # Memory-mapped registers.

    def _read(self, _uc, offset: int, _size: int, base: int) -> int:
        address = base + offset
        block = self._blocks.get(address & ~0x3FF)
        return block.read(address & 0x3FF) if block else 0

    def _write(self, _uc, offset: int, _size: int, value: int, base: int) -> None:
        address = base + offset
        block = self._blocks.get(address & ~0x3FF)
        if block:
            block.write(address & 0x3FF, value)

    def _read_core(self, uc, offset: int, _size: int, _data) -> int:
        if offset == 0x18:
            self.now += LOOK_NS
            self._tick(uc)
            counts = self.systick.get(0x14, 0) + 1
            passed = (self.now - self.tick_at) % TICK_NS
            return counts - 1 - passed * counts // TICK_NS
        if offset == 0xD04:
            return self._pending_tick << 26
        return self.systick.get(offset, 0)

    def _tick(self, uc) -> None:
        if self.systick.get(0x10, 0) & 1 and self.now - self.tick_at >= TICK_NS:
            self._pending_tick = True
            if not self._is_in_handler:  # one priority: a handler runs to its end
                uc.emu_stop()

    def _write_core(self, uc, offset: int, _size: int, value: int, _data) -> None:
        self.systick[offset] = value
        if offset == 0x10:
            self.tick_at = self.now
        if offset == 0xD0C and value & 4:
            self.reset_wanted = True
            uc.emu_stop()

    # Running.

    def call(self, symbol: str) -> None:
        """Run an interrupt handler: registers saved, return to a stop address."""
        saved = self.uc.context_save()
        self.uc.reg_write(UC_ARM_REG_LR, STOP_AT | 1)
        self.uc.reg_write(UC_ARM_REG_SP, self.uc.reg_read(UC_ARM_REG_SP) - 32)
        self._is_in_handler = True
        self.uc.emu_start(self.symbols[symbol] | 1, STOP_AT)
        self._is_in_handler = False
        assert self.uc.reg_read(UC_ARM_REG_PC) == STOP_AT, f"{symbol} did not return"
        self.uc.context_restore(saved)

    def _interrupts(self) -> None:
        while self.now - self.tick_at >= TICK_NS and self.systick.get(0x10, 0) & 1:
            self.tick_at += TICK_NS
            self._pending_tick = False
            self.call("SysTick_Handler")
        while self.can.receive_pending():
            self.call("CAN1_RX0_Handler")
        if self.can.transmit_pending():
            self.call("CAN1_TX_Handler")

    def run(self, duration_s: float) -> None:
        """Let the core run for ``duration_s`` of simulated time."""
        end_ns = self.now + round(duration_s * 1e9)
        while self.now < end_ns:
            self.uc.emu_start(self.pc | 1, STOP_AT)
            self.pc = self.uc.reg_read(UC_ARM_REG_PC)
            if self.reset_wanted:
                self.resets += 1
                self.rcc.reset_flags = 1 << 28
                self.boot()
                continue
            if not self._pending_tick:
                self._sleep()
            self._interrupts()

    def _sleep(self) -> None:
        """WFI: time goes on to the next tick, or to the end of a frame on the bus."""
        wake_ns = self.tick_at + TICK_NS
        frame_ns = self.can.next_event_ns()
        if frame_ns is not None:
            wake_ns = min(wake_ns, max(frame_ns, self.now))
        self.now = max(self.now, wake_ns)

    # Measuring.

    def stack_used(self) -> int:
        """Bytes of the stack that were ever written, after ``paint_stack``."""
        bottom, top = self.symbols["stack_bottom"], self.symbols["stack_top"]
        content = bytes(self.uc.mem_read(bottom, top - bottom))
        untouched = len(content) - len(content.lstrip(b"\xa5"))
        return top - bottom - untouched

    def paint_stack(self) -> None:
        bottom, top = self.symbols["stack_bottom"], self.symbols["stack_top"]
        self.uc.mem_write(bottom, b"\xa5" * (top - bottom))

    def count_steps(self) -> list[int]:
        """Count instructions of every ``pod_step`` from now on; the list grows as it runs."""
        counts: list[int] = []
        entry = self.symbols["pod_step"] & ~1

        def on_instruction(_uc, address, _size, _data):
            if address == entry:
                counts.append(0)
            if counts:
                counts[-1] += 1

        self._hook = self.uc.hook_add(UC_HOOK_CODE, on_instruction)
        self.uc.ctl_flush_tb()  # what is translated already knows no hook
        return counts
