"""STM32F405 peripherals for the Unicorn machine: RCC, GPIO, I2C v1, bxCAN, watchdog.

Each model has ``read(offset)`` and ``write(offset, value)`` and lives on the machine's simulated
time. Written from the reference manual RM0090, apart from the firmware's own register header.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.sim_chip import ChipSilentError

Now = Callable[[], int]


class Rcc:
    """Clocks that become ready at once, or never where a test says so; reset flags."""

    def __init__(self) -> None:
        self.words = {0x00: 0x83}
        self.has_crystal = self.has_pll = True
        self.reset_flags = 0x0C000000  # pin and power-on

    def read(self, offset: int) -> int:
        value = self.words.get(offset, 0)
        if offset == 0x00:
            value |= (value & 1) << 1
            value |= (value >> 16 & 1) << 17 if self.has_crystal else 0
            value |= (value >> 24 & 1) << 25 if self.has_pll else 0
        elif offset == 0x08:
            value |= (value & 3) << 2
        elif offset == 0x74:
            value |= self.reset_flags
        return value

    def write(self, offset: int, value: int) -> None:
        if offset == 0x74 and value & 1 << 24:
            self.reset_flags = 0
            return
        self.words[offset] = value


@dataclass
class SensorBus:
    """The two I2C lines: a chip that holds SDA lets go after some clocks."""

    hold_clocks: int = 0
    clocks_seen: int = 0
    scl: bool = True
    sda: bool = True

    @property
    def is_stuck(self) -> bool:
        return self.hold_clocks > 0

    def drive(self, scl: bool, sda: bool) -> None:
        if scl and not self.scl:
            self.clocks_seen += 1
            self.hold_clocks = max(0, self.hold_clocks - 1)
        self.scl, self.sda = scl, sda


class Gpio:
    """One port: inputs by pin, outputs kept; port B's pins 6 and 7 are the sensor bus."""

    def __init__(self, lines: SensorBus | None = None) -> None:
        self.words: dict[int, int] = {}
        self.inputs = 0xFFFF
        self.lines = lines

    def read(self, offset: int) -> int:
        if offset != 0x10:
            return self.words.get(offset, 0)
        levels = self.inputs
        if self.lines is not None:
            sda = self.lines.sda and not self.lines.is_stuck
            levels &= ~0xC0
            levels |= self.lines.scl << 6 | sda << 7
        return levels

    def write(self, offset: int, value: int) -> None:
        if offset == 0x18:
            output = self.words.get(0x14, 0)
            output = (output | value & 0xFFFF) & ~(value >> 16)
            self.words[0x14] = output
            if self.lines is not None:
                self.lines.drive(bool(output >> 6 & 1), bool(output >> 7 & 1))
        else:
            self.words[offset] = value


SB, ADDR, BTF, RXNE, TXE, AF = 1, 2, 4, 0x40, 0x80, 0x400
START, STOP, ACK, POS, SWRST = 0x100, 0x200, 0x400, 0x800, 0x8000
ORE, RXNE_USART = 0x08, 0x20


class I2c:
    """I2C v1 master with one BNO055: flags, acknowledge pipeline, clock stretching.

    ``faults`` are taken one by one at the address byte: "nak" or "hang". START and STOP stay set
    until they are on the bus. ``early_writes`` counts writes to CR1 before that, which RM0090
    Sec. 27.6.1 forbids and which are lost here; a reset is none.
    """

    STOP_NS = 30_000  # the line's rise and some stretching: longer than a few looks at the clock

    def __init__(self, now_ns: Now, chip: SimBno055, lines: SensorBus) -> None:
        self.now_ns, self.chip, self.lines = now_ns, chip, lines
        self.byte_ns = 22_500
        self.words: dict[int, int] = {}
        self.faults: list[str] = []
        self.early_writes = 0
        self.read_log: list[tuple[int, int, bytes]] = []  # register, asked bytes, their values
        self._idle()

    def _idle(self) -> None:
        self.sr1, self.phase, self.register, self.bytes_out = 0, "idle", None, 0
        self.dr: list[int] = []  # data register, then shift register
        self.block, self.block_at, self.taken = b"", 0, 0
        self.is_acked, self.wants_more, self.is_stopping = True, False, False
        self.ready_ns, self.event = 0, None
        self.is_starting, self.stop_ns = False, None

    def _after(self, event: str) -> None:
        self.event, self.ready_ns = event, self.now_ns() + self.byte_ns

    def _settle(self) -> None:
        while self.event is not None and self.now_ns() >= self.ready_ns:
            event, self.event = self.event, None
            getattr(self, f"_on_{event}")()
        is_due = self.stop_ns is not None and self.now_ns() >= self.stop_ns
        if is_due and not self.lines.is_stuck:
            self.stop_ns = None

    def _on_start(self) -> None:
        if not self.lines.is_stuck:
            self.sr1, self.phase, self.is_starting = SB, "address", False

    def _on_sent(self) -> None:
        self.sr1 |= TXE | BTF

    def _on_byte(self) -> None:
        """A byte has come in: into DR, or into the shift register behind it."""
        self.dr.append(self.block[self.block_at])
        self.block_at += 1
        control = self.words.get(0x00, 0)
        is_acked, self.is_acked = self.is_acked, bool(control & ACK)
        acknowledges = is_acked if control & POS else bool(control & ACK)
        self.sr1 |= RXNE
        if len(self.dr) == 2:
            self.sr1 |= BTF
        self.wants_more = acknowledges
        if acknowledges and len(self.dr) < 2:
            self._after("byte")

    def _address(self, value: int) -> None:
        self.sr1 &= ~SB
        fault = self.faults.pop(0) if self.faults else ""
        if fault == "hang" or self.lines.is_stuck:
            self.phase = "hung"
            return
        try:
            self.chip.read(0x07, 1, self.now_ns())
        except ChipSilentError:
            fault = "nak"
        if fault == "nak" or value >> 1 != 0x28:
            self.sr1 |= AF
            return
        self.sr1 |= ADDR
        self.phase = "receive" if value & 1 else "send"

    def _end_reception(self) -> None:
        """Note what was clocked in: a byte more than asked for is a fault of the driver."""
        if self.phase == "receive":
            self.read_log.append((self.register, self.block_at, self.block[: self.block_at]))

    def read(self, offset: int) -> int:
        self._settle()
        if offset == 0x14:
            return self.sr1
        if offset == 0x18:
            if self.sr1 & ADDR:
                self.sr1 &= ~ADDR
                self._addressed()
            return 3
        if offset == 0x10:
            return self._take()
        if offset == 0x00:
            return (
                self.words.get(0x00, 0)
                | self.is_starting * START
                | (self.stop_ns is not None) * STOP
            )
        return self.words.get(offset, 0)

    def _addressed(self) -> None:
        if self.phase == "send":
            self.sr1 |= TXE
            return
        self.block = self.chip.read(self.register, 40, self.now_ns())
        self.block_at = 0
        control = self.words.get(0x00, 0)
        self.is_acked = True if control & POS else bool(control & ACK)
        self._after("byte")

    def _take(self) -> int:
        if not self.dr:
            return 0
        value = self.dr.pop(0)
        self.taken += 1
        self.sr1 &= ~(BTF if self.dr else BTF | RXNE)
        if self.wants_more and self.event is None:
            self._after("byte")
        return value

    def write(self, offset: int, value: int) -> None:
        self._settle()
        if offset == 0x14:
            self.sr1 &= value | 0xFF
        elif offset == 0x10:
            self._put(value & 0xFF)
        elif offset == 0x00:
            self._control(value)
        else:
            self.words[offset] = value

    def _put(self, value: int) -> None:
        if self.sr1 & SB:
            self._address(value)
            return
        if self.phase != "send":
            return
        self.sr1 &= ~(TXE | BTF)
        if self.register is None:
            self.register = value
        else:
            self.chip.write(self.register, bytes((value,)), self.now_ns())
            self.register += 1
        self._after("sent")

    def _control(self, value: int) -> None:
        if value & SWRST or not value & 1:
            self.words[0x00] = value
            self._idle()
            return
        if self.is_starting or self.stop_ns is not None:
            self.early_writes += 1
            return
        if value & STOP:
            # In reception STOP follows the byte under way and what is already in.
            end_ns = self.now_ns() if self.event is None else self.ready_ns
            if self.phase == "receive":
                self.is_stopping, self.wants_more = True, False
            else:
                self._idle()
            self.stop_ns = end_ns + self.STOP_NS
        if value & START:
            register = None if self.is_stopping else self.register
            self._end_reception()
            self._idle()
            self.register, self.is_starting = register, True
            self._after("start")
        self.words[0x00] = value & ~(START | STOP)


class Usart:
    """The receiver's flags: reading SR and then DR clears them (RM0090 Sec. 30.6.1)."""

    def __init__(self) -> None:
        self.sr, self.dr, self._seen = 0, 0, 0

    @property
    def interrupts(self) -> bool:
        return bool(self.sr & (ORE | RXNE_USART))

    def read(self, offset: int) -> int:
        if offset == 0x00:
            self._seen = self.sr
            return self.sr
        if offset == 0x04:
            self.sr &= ~(self._seen & ORE | RXNE_USART)
            return self.dr
        return 0

    def write(self, offset: int, value: int) -> None:
        pass


@dataclass
class CanFrame:
    """A frame on the modelled bus."""

    id: int
    data: bytes
    is_extended: bool = False
    is_remote: bool = False
    t_us: int = 0


@dataclass
class BxCan:
    """bxCAN: three mailboxes sent by identifier, filters, one FIFO of three, bus-off."""

    now_ns: Now
    frame_ns: int = 260_000
    words: dict[int, int] = field(default_factory=dict)
    sent: list[CanFrame] = field(default_factory=list)
    fifo: list[CanFrame] = field(default_factory=list)
    mailboxes: dict[int, int] = field(default_factory=dict)
    done: int = 0
    has_overrun: bool = False
    is_bus_off: bool = False
    is_blocked: bool = False
    busy_until_ns: int = 0
    rejoins: int = 0
    rejoined_ns: int = 0

    @property
    def is_on_bus(self) -> bool:
        return not (self.words.get(0x00, 0) & 1 or self.is_bus_off or self.is_blocked)

    def next_event_ns(self) -> int | None:
        return self.busy_until_ns if self.mailboxes and self.is_on_bus else None

    def settle(self) -> None:
        """Send what is due: the lowest identifier among the mailboxes, one frame a frame time."""
        if self.rejoined_ns and self.now_ns() >= self.rejoined_ns:
            self.is_bus_off, self.rejoined_ns = False, 0
        while self.mailboxes and self.is_on_bus and self.now_ns() >= self.busy_until_ns:
            box = min(self.mailboxes, key=lambda b: (self.words[0x180 + 16 * b] >> 21, b))
            del self.mailboxes[box]
            base = 0x180 + 16 * box
            length = self.words[base + 4] & 0xF
            data = (self.words[base + 12] << 32 | self.words[base + 8]).to_bytes(8, "little")
            frame_id = self.words[base] >> 21
            self.sent.append(CanFrame(frame_id, data[:length], t_us=self.busy_until_ns // 1000))
            self.done |= 1 << 8 * box
            if self.mailboxes:
                self.busy_until_ns += self.frame_ns

    def transmit_pending(self) -> bool:
        self.settle()
        return bool(self.done and self.words.get(0x14, 0) & 1)

    def receive_pending(self) -> bool:
        return bool(self.fifo and self.words.get(0x14, 0) & 2)

    def hear(self, frame: CanFrame) -> bool:
        """Put a frame of another node on the bus; returns whether a filter took it."""
        if not self.is_on_bus or not self._passes(frame):
            return False
        if len(self.fifo) == 3:
            self.has_overrun = True
        else:
            self.fifo.append(frame)
        return True

    def _identifier(self, frame: CanFrame) -> int:
        word = frame.id << 3 | 4 if frame.is_extended else frame.id << 21
        return word | (2 if frame.is_remote else 0)

    def _passes(self, frame: CanFrame) -> bool:
        word = self._identifier(frame)
        for bank in range(28):
            if self.words.get(0x21C, 0) >> bank & 1:
                wanted, mask = (self.words.get(0x240 + 8 * bank + i, 0) for i in (0, 4))
                if word & mask == wanted & mask:
                    return True
        return False

    def read(self, offset: int) -> int:
        self.settle()
        if offset == 0x04:
            return self.words.get(0x00, 0) & 1
        if offset == 0x08:
            empty = sum(1 << 26 + b for b in range(3) if b not in self.mailboxes)
            return empty | self.done
        if offset == 0x0C:
            return len(self.fifo) | self.has_overrun << 4
        if offset == 0x18:
            return 4 if self.is_bus_off else 0
        if 0x1B0 <= offset < 0x1C0 and self.fifo:
            frame = self.fifo[0]
            payload = int.from_bytes(frame.data.ljust(8, b"\0"), "little")
            return {
                0: self._identifier(frame),
                4: len(frame.data),
                8: payload & 0xFFFFFFFF,
                12: payload >> 32,
            }[offset - 0x1B0]
        return self.words.get(offset, 0)

    def write(self, offset: int, value: int) -> None:
        self.settle()
        if offset == 0x08:
            self.done &= ~value
            for box in range(3):
                if value >> 8 * box + 7 & 1:
                    self.mailboxes.pop(box, None)
            return
        if offset == 0x0C:
            if value & 0x20 and self.fifo:
                self.fifo.pop(0)
            if value & 0x10:
                self.has_overrun = False
            return
        if offset == 0x00 and self.words.get(0, 0) & 1 and not value & 1 and self.is_bus_off:
            self.rejoins += 1
            self.rejoined_ns = self.now_ns() + 128 * 11 * 2_000
        self.words[offset] = value
        if 0x180 <= offset < 0x1B0 and offset % 16 == 0 and value & 1:
            if not self.mailboxes:
                self.busy_until_ns = max(self.busy_until_ns, self.now_ns()) + self.frame_ns
            self.mailboxes[(offset - 0x180) // 16] = value


class Watchdog:
    """Notes how long it was left alone at most."""

    def __init__(self, now_ns: Now) -> None:
        self.now_ns, self.last_ns, self.longest_ns, self.is_started = now_ns, 0, 0, False

    def read(self, offset: int) -> int:
        return 0

    def write(self, offset: int, value: int) -> None:
        if offset == 0 and value == 0xCCCC:
            self.is_started, self.last_ns = True, self.now_ns()
        if offset == 0 and value == 0xAAAA and self.is_started:
            self.longest_ns = max(self.longest_ns, self.now_ns() - self.last_ns)
            self.last_ns = self.now_ns()
