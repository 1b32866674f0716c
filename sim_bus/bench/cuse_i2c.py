"""A genuine /dev/i2c-N served from Python through CUSE, without libfuse.

Any program that uses i2c-dev (smbus2, i2cdetect -y, i2cget, i2ctransfer) reaches a simulated
bus. Needs /dev/cuse and the right to open it: root, or the guest of ``sim_bus.guests.uml``.
"""

import contextlib
import errno
import os
import select
import struct
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from drivers.errors import DeviceNotFoundError

# Kernel headers: linux/fuse.h, linux/i2c-dev.h, linux/i2c.h.
_IN_HEADER = struct.Struct("=IIQQIIII")
_OUT_HEADER = struct.Struct("=IiQ")
_IOCTL_IN = struct.Struct("=QIIQII")
_IOCTL_OUT = struct.Struct("=iIII")
_IOVEC = struct.Struct("=QQ")
_SMBUS = struct.Struct("=BBxxIQ")
_RDWR = struct.Struct("=QII")
_MESSAGE = struct.Struct("=HHHxxQ")

_OPEN, _READ, _WRITE, _RELEASE, _FLUSH, _INTERRUPT, _IOCTL = 14, 15, 16, 18, 25, 36, 39
_CUSE_INIT = 4096
_RETRY = 4
_I2C_RETRIES, _I2C_TIMEOUT, _I2C_SLAVE, _I2C_FUNCS = 0x701, 0x702, 0x703, 0x705
_I2C_SLAVE_FORCE, _I2C_RDWR, _I2C_PEC, _I2C_SMBUS = 0x706, 0x707, 0x708, 0x720
_M_READ = 1
# I2C_FUNC_I2C and the SMBus quick, byte, word, block and I2C-block functions.
_FUNCTIONALITY = 0x00000001 | 0x0EFF0000
_MAX_BYTES = 8192
_BLOCK_MAX = 32
_BLOCK_BYTES = 34


@dataclass(frozen=True, slots=True)
class I2cMessage:
    """One message of a transfer: bytes written, or a number of bytes to read."""

    address: int
    written: bytes = b""
    read_length: int | None = None


Transfer = Callable[[Sequence[I2cMessage]], list[bytes]]
"""Runs messages with repeated starts; returns the bytes of each read; raises OSError by number."""


@dataclass(slots=True)
class _Handle:
    address: int = 0


@dataclass(slots=True)
class CuseI2cBus:
    """Serves one /dev/i2c-N until closed.

    Parameters
    ----------
    number : int
        N of /dev/i2c-N.
    transfer : callable
        Runs the messages of one transfer on the simulated bus.
    """

    number: int
    transfer: Transfer
    _device: int = field(default=-1, init=False)
    _handles: dict[int, _Handle] = field(default_factory=dict, init=False)
    _stopped: threading.Event = field(default_factory=threading.Event, init=False)
    _thread: threading.Thread | None = field(default=None, init=False)

    @property
    def path(self) -> Path:
        """The node that appears."""
        return Path(f"/dev/i2c-{self.number}")

    def start(self, timeout_s: float = 5.0) -> None:
        """Make the node appear and answer it from a thread.

        Raises
        ------
        DeviceNotFoundError
            If /dev/cuse is missing or may not be opened, or the node does not appear.
        """
        try:
            self._device = os.open("/dev/cuse", os.O_RDWR)
        except OSError as error:
            msg = f"/dev/cuse: {error.strerror}; run as root with the cuse module loaded"
            raise DeviceNotFoundError(msg) from error
        self._thread = threading.Thread(target=self._serve, name=str(self.path), daemon=True)
        self._thread.start()
        for _ in range(round(timeout_s / 0.02)):
            if self.path.exists():
                return
            self._stopped.wait(0.02)
        self.close()
        msg = f"{self.path} did not appear within {timeout_s} s"
        raise DeviceNotFoundError(msg)

    def close(self) -> None:
        """Remove the node; programs that hold it open get errno 107."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join(2.0)
            self._thread = None
        if self._device >= 0:
            os.close(self._device)
            self._device = -1

    def _serve(self) -> None:
        while not self._stopped.is_set():
            ready, _, _ = select.select([self._device], [], [], 0.1)
            if not ready:
                continue
            try:
                request = os.read(self._device, _MAX_BYTES + 4096)
            except OSError as error:
                if error.errno in (errno.EAGAIN, errno.EINTR, errno.ENOENT):
                    continue
                return
            _, opcode, unique, *_ = _IN_HEADER.unpack_from(request)
            if opcode == _INTERRUPT:
                continue
            try:
                body, code = self._answer(opcode, request[_IN_HEADER.size :]), 0
            except OSError as error:
                body, code = b"", -(error.errno or errno.EIO)
            # A caller that was killed meanwhile makes the reply fail; the next one is unaffected.
            with contextlib.suppress(OSError):
                header = _OUT_HEADER.pack(_OUT_HEADER.size + len(body), code, unique)
                os.write(self._device, header + body)

    def _answer(self, opcode: int, body: bytes) -> bytes:
        if opcode == _CUSE_INIT:
            _, minor, *_ = struct.unpack_from("=IIII", body)
            name = f"DEVNAME=i2c-{self.number}\0".encode()
            return struct.pack("=8I40x", 7, minor, 0, 1, _MAX_BYTES, _MAX_BYTES, 0, 0) + name
        if opcode == _OPEN:
            handle = max(self._handles, default=0) + 1
            self._handles[handle] = _Handle()
            return struct.pack("=QII", handle, 1, 0)
        if opcode in (_FLUSH, _RELEASE):
            if opcode == _RELEASE:
                self._handles.pop(struct.unpack_from("=Q", body)[0], None)
            return b""
        if opcode == _READ:
            fh, _, size = struct.unpack_from("=QQI", body)
            return self.transfer([I2cMessage(self._handles[fh].address, read_length=size)])[0]
        if opcode == _WRITE:
            fh, _, size = struct.unpack_from("=QQI", body)
            self.transfer([I2cMessage(self._handles[fh].address, body[40 : 40 + size])])
            return struct.pack("=II", size, 0)
        if opcode == _IOCTL:
            return self._ioctl(body)
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    def _ioctl(self, body: bytes) -> bytes:
        fh, _, command, argument, in_size, out_size = _IOCTL_IN.unpack_from(body)
        data = body[_IOCTL_IN.size : _IOCTL_IN.size + in_size]
        if command in (_I2C_SLAVE, _I2C_SLAVE_FORCE):
            self._handles[fh].address = argument
            return _done()
        if command in (_I2C_PEC, _I2C_RETRIES, _I2C_TIMEOUT):
            return _done()
        if command == _I2C_FUNCS:
            if out_size == 0:
                return _ask([], [(argument, 8)])
            return _done(0, struct.pack("=Q", _FUNCTIONALITY))
        if command == _I2C_RDWR:
            return self._rdwr(argument, data, out_size)
        if command == _I2C_SMBUS:
            return self._smbus(self._handles[fh].address, argument, data)
        raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))

    def _rdwr(self, argument: int, data: bytes, out_size: int) -> bytes:
        # The kernel hands over memory step by step: the struct, the messages, then the buffers.
        head = (argument, _RDWR.size)
        if not data:
            return _ask([head], [])
        pointer, count, _ = _RDWR.unpack_from(data)
        if not 0 < count <= 42:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        table = (pointer, _MESSAGE.size * count)
        if len(data) == _RDWR.size:
            return _ask([head, table], [])
        entries = list(_MESSAGE.iter_unpack(data[_RDWR.size : _RDWR.size + table[1]]))
        writes = [(b, n) for _, flags, n, b in entries if not flags & _M_READ and n]
        reads = [(b, n) for _, flags, n, b in entries if flags & _M_READ and n]
        rest = data[_RDWR.size + table[1] :]
        if not rest and out_size == 0 and (writes or reads):
            return _ask([head, table, *writes], reads)
        messages, at = [], 0
        for address, flags, length, _ in entries:
            if flags & _M_READ:
                messages.append(I2cMessage(address, read_length=length))
            else:
                messages.append(I2cMessage(address, rest[at : at + length]))
                at += length
        return _done(count, b"".join(self.transfer(messages)))

    def _smbus(self, address: int, argument: int, data: bytes) -> bytes:
        head = (argument, _SMBUS.size)
        if not data:
            return _ask([head], [])
        is_read, register, size, pointer = _SMBUS.unpack_from(data)
        if pointer and len(data) == _SMBUS.size:
            block = (pointer, _BLOCK_BYTES)
            return _ask([head, block], [block] if is_read or size == 4 else [])
        messages, prefix = smbus_messages(
            address, bool(is_read), register, size, data[_SMBUS.size :]
        )
        answer = b"".join(self.transfer(messages))
        if not (pointer and (is_read or size == 4)):
            return _done()
        content = bytes([len(answer)]) + answer if prefix else answer
        return _done(0, content.ljust(_BLOCK_BYTES, b"\0"))


def smbus_messages(
    address: int, is_read: bool, register: int, size: int, block: bytes
) -> tuple[list[I2cMessage], bool]:
    """Return the I2C messages of one SMBus command, and whether its answer carries a length.

    Raises
    ------
    OSError
        EOPNOTSUPP for a command that a BNO055 bus has no use for.
    """
    command = bytes([register])
    if size == 0:  # quick
        message = I2cMessage(address, read_length=0) if is_read else I2cMessage(address)
        return [message], False
    if size == 1:  # byte, without a register
        message = I2cMessage(address, read_length=1) if is_read else I2cMessage(address, command)
        return [message], False
    lengths = {2: 1, 3: 2}
    if size in lengths:  # byte data, word data
        length = lengths[size]
        if is_read:
            return [I2cMessage(address, command), I2cMessage(address, read_length=length)], False
        return [I2cMessage(address, command + block[:length])], False
    if size in (6, 8):  # I2C block, old and new
        length = min(block[0], _BLOCK_MAX)
        if is_read:
            return [I2cMessage(address, command), I2cMessage(address, read_length=length)], True
        return [I2cMessage(address, command + block[1 : 1 + length])], False
    raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))


def _done(result: int = 0, data: bytes = b"") -> bytes:
    return _IOCTL_OUT.pack(result, 0, 0, 0) + data


def _ask(inputs: Sequence[tuple[int, int]], outputs: Sequence[tuple[int, int]]) -> bytes:
    vectors = b"".join(_IOVEC.pack(*vector) for vector in (*inputs, *outputs))
    return _IOCTL_OUT.pack(0, _RETRY, len(inputs), len(outputs)) + vectors
