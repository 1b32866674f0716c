"""Simulated chips behind the methods of ``smbus2.SMBus``, with an optional TCA9548A before them."""

import contextlib
import errno
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import and_
from typing import TypeVar

from drivers.clock import Clock
from sim_bus.buses.faults import FaultPlan, flip_bit_7
from sim_bus.chip.sim_chip import ChipSilentError, SimChip

BLOCK_MAX = 32
ADDRESS_BYTES = 3
# Nine bits at 400 kHz: a byte of a chip that does not stretch the clock.
FAST_BYTE_NS = 22_500
Place = tuple[int | None, int, int]


@dataclass(frozen=True, slots=True)
class Wired:
    """One chip on the bus and the name under which faults find it."""

    chip: SimChip
    target: str


T = TypeVar("T")


def i2c_error(number: int) -> OSError:
    """Return the error that the kernel would give."""
    return OSError(number, os.strerror(number))


class SimI2cBus:
    """One I2C bus with chips and multiplexers.

    Parameters
    ----------
    clock : Clock
        The rig's clock. A transfer takes ``byte_ns`` per byte of its time.
    chips : mapping
        From (multiplexer address or None, channel, chip address) to the chip.
    faults : FaultPlan
        What goes wrong.
    byte_ns : int
        Time of one byte, ns; 180 us is what a BNO055's clock stretching makes of it. A chip that
        does not stretch the clock takes ``FAST_BYTE_NS`` at most.

    Notes
    -----
    Errors are the kernel's: EREMOTEIO (121) for a NAK, ETIMEDOUT (110) for a stuck bus, EIO (5),
    EAGAIN (11) for lost arbitration. A multiplexer connects every channel whose bit is set, and the
    wires are a wired AND: chips of one address that are on together answer together.
    """

    def __init__(
        self,
        clock: Clock,
        chips: Mapping[Place, Wired],
        faults: FaultPlan | None = None,
        *,
        byte_ns: int = 180_000,
    ) -> None:
        self._clock, self._byte_ns = clock, byte_ns
        self._chips = dict(chips)
        self._faults = FaultPlan() if faults is None else faults
        self._muxes = {place[0]: 0 for place in chips if place[0] is not None}
        self._pointer: dict[int, int] = {}
        self.is_open = True

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read ``length`` (at most 32) bytes from ``register``."""
        if not 1 <= length <= BLOCK_MAX:
            msg = f"block length {length}, wanted 1 to {BLOCK_MAX}"
            raise ValueError(msg)
        answering = self._begin(i2c_addr, length + 3)
        if not answering:
            return [self._muxes[i2c_addr]] * length
        # The chip takes its data behind the addresses; the whole is slept in one piece.
        byte_ns = self._byte_ns_of(answering)
        taken_ns = self._clock.now_ns() + ADDRESS_BYTES * byte_ns
        answers = _ask(answering, lambda chip: chip.read(register, length, taken_ns))
        self._transfer(length + ADDRESS_BYTES, byte_ns)
        spoilt = [self._spoil(wired, data) for wired, data in answers]
        if len(spoilt) == 1:  # nearly always, and a served wing has no time to spare
            return list(spoilt[0])
        return [reduce(and_, column) for column in zip(*spoilt, strict=True)]

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write at most 32 bytes from ``register`` on."""
        if len(data) > BLOCK_MAX:
            msg = f"block length {len(data)}, wanted at most {BLOCK_MAX}"
            raise ValueError(msg)
        answering = self._begin(i2c_addr, len(data) + 2)
        if not answering:
            self._muxes[i2c_addr] = data[-1] if data else register
            return
        self._transfer(len(data) + 2, self._byte_ns_of(answering))
        _ask(answering, lambda chip: chip.write(register, bytes(data), self._clock.now_ns()))
        self._pointer[i2c_addr] = register

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read one register."""
        return self.read_i2c_block_data(i2c_addr, register, 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one register."""
        self.write_i2c_block_data(i2c_addr, register, [value])

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Write the register pointer, or a multiplexer's channel mask."""
        if not self._begin(i2c_addr, 2):
            self._muxes[i2c_addr] = value
            return
        self._transfer(2)
        self._pointer[i2c_addr] = value

    def read_byte(self, i2c_addr: int) -> int:
        """Read one byte at the register pointer, or a multiplexer's channel mask."""
        return self.read_i2c_block_data(i2c_addr, self._pointer.get(i2c_addr, 0), 1)[0]

    def close(self) -> None:
        """Release the bus."""
        self.is_open = False

    def _byte_ns_of(self, answering: list[Wired]) -> int:
        is_slow = any(wired.chip.stretches_clock for wired in answering)
        return self._byte_ns if is_slow else min(self._byte_ns, FAST_BYTE_NS)

    def _transfer(self, count: int, byte_ns: int | None = None) -> None:
        ns = count * (self._byte_ns if byte_ns is None else byte_ns)
        if ns:
            self._clock.sleep_until_ns(self._clock.now_ns() + ns)

    def _spoil(self, wired: Wired, data: bytes) -> bytes:
        """Return what a chip's answer becomes on its way."""
        if self._faults.strikes("wrong_chip", wired.target, self._clock.now_ns()):
            data = bytes(len(data))
        if self._faults.strikes("spike", wired.target, self._clock.now_ns()):
            data = flip_bit_7(data, self._faults.rng)
        return data

    def _begin(self, address: int, count: int) -> list[Wired]:
        """Return the chips that answer at an address, none for a multiplexer; raise bus errors."""
        if not self.is_open:
            raise i2c_error(errno.EBADF)
        now_ns = self._clock.now_ns()
        targets = {wired.target for wired in self._chips.values()}
        if any(self._faults.strikes("stuck_bus", target, now_ns) for target in sorted(targets)):
            self._transfer(10 * count)
            raise i2c_error(errno.ETIMEDOUT)
        if address in self._muxes:
            self._transfer(2)
            return []
        answering = self._connected(address)
        for wired in answering:
            self._apply_faults(wired, now_ns)
        return answering

    def _apply_faults(self, wired: Wired, now_ns: int) -> None:
        self._faults.apply_to_chip(wired.chip, wired.target, now_ns)
        for kind, number in (
            ("nak", errno.EREMOTEIO),
            ("io_error", errno.EIO),
            ("arbitration_lost", errno.EAGAIN),
        ):
            if self._faults.strikes(kind, wired.target, now_ns):
                self._transfer(1)
                raise i2c_error(number)

    def _connected(self, address: int) -> list[Wired]:
        found = [
            wired
            for (mux, channel, at), wired in self._chips.items()
            if at == address and (mux is None or self._muxes[mux] >> channel & 1)
        ]
        if not found:
            self._transfer(1)
            raise i2c_error(errno.EREMOTEIO)
        return found


def _ask(answering: list[Wired], act: Callable[[SimChip], T]) -> list[tuple[Wired, T]]:
    """Return what each chip that is awake gives; a NAK if none is."""
    given = []
    for wired in answering:
        with contextlib.suppress(ChipSilentError):
            given.append((wired, act(wired.chip)))
    if not given:
        raise i2c_error(errno.EREMOTEIO)
    return given
