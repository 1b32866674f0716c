"""Calibration offsets of the chips, kept by the chip's unique id in one JSON file."""

import json
from collections.abc import Generator
from pathlib import Path
from typing import Protocol

from drivers.bno055 import registers as reg
from drivers.bno055.registers import CALIBRATION_LENGTH, Mode
from drivers.clock import Clock
from drivers.errors import DriverError, FrameFormatError
from drivers.register_port import RegisterPort


def is_complete(status: int, mode: Mode) -> bool:
    """Return whether CALIB_STAT says that every sensor which the mode calibrates is calibrated.

    Notes
    -----
    BNO055 data sheet rev. 1.4, Sec. 4.3.54: two bits each for system, gyro, accelerometer and
    magnetometer, 3 = fully. The bits of a raw mode, which calibrates nothing, mean nothing.
    """
    wanted = 0x3F if mode.has_mag else 0x3C
    return mode.is_fusion and status & wanted == wanted


def read_offsets(port: RegisterPort, clock: Clock, mode: Mode) -> Generator[int, None, bytes]:
    """Return the calibration block; yields instants to wait for.

    The chip shows it in CONFIG mode only, and is put back into ``mode``.
    """
    port.write(reg.OPR_MODE, bytes((Mode.CONFIG,)))
    yield clock.now_ns() + reg.MODE_SWITCH_NS
    block = port.read(reg.CALIBRATION, reg.CALIBRATION_LENGTH)
    port.write(reg.OPR_MODE, bytes((mode,)))
    yield clock.now_ns() + reg.MODE_SWITCH_NS
    return block


class CalibrationStore(Protocol):
    """Where the 22 calibration bytes of a chip are kept."""

    def load(self, uid: bytes) -> bytes | None:
        """Return the bytes of one chip, None if there are none."""
        ...

    def save(self, uid: bytes, data: bytes) -> None:
        """Keep the bytes of one chip."""
        ...


class CalibrationFile:
    """A JSON object, unique id to calibration block, both in hexadecimal.

    Parameters
    ----------
    path : Path
        The file; it need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self, uid: bytes) -> bytes | None:
        """Return the bytes of one chip, None if there are none.

        Raises
        ------
        FrameFormatError
            If the file or the entry is malformed.
        """
        text = self._read().get(uid.hex())
        if text is None:
            return None
        try:
            data = bytes.fromhex(text)
        except (ValueError, TypeError):
            data = b""
        if len(data) != CALIBRATION_LENGTH:
            msg = (
                f"{self._path}: calibration of chip {uid.hex()} is {text!r:.60}, expected "
                f"{CALIBRATION_LENGTH} bytes in hexadecimal"
            )
            raise FrameFormatError(msg)
        return data

    def save(self, uid: bytes, data: bytes) -> None:
        """Keep the bytes of one chip; the file is replaced in one step.

        Raises
        ------
        DriverError
            If the file is malformed or cannot be written.
        """
        entries = {**self._read(), uid.hex(): data.hex()}
        draft = self._path.with_suffix(".tmp")
        try:
            draft.write_text(json.dumps(entries, indent=2) + "\n", encoding="utf-8")
            draft.replace(self._path)
        except OSError as error:
            msg = f"{self._path}: cannot be written: {error.strerror}"
            raise DriverError(msg) from error

    def _read(self) -> dict[str, str]:
        try:
            entries = json.loads(self._path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            msg = f"{self._path}: cannot be read as calibration file: {error}"
            raise FrameFormatError(msg) from error
        if not isinstance(entries, dict):
            msg = f"{self._path}: holds {type(entries).__name__}, expected an object"
            raise FrameFormatError(msg)
        return entries
