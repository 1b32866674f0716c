"""GStreamer Data Protocol: the frames that ``gdppay`` writes into a pipe."""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.errors import FrameFormatError

HEADER_BYTES: Final = 62
LARGEST_PAYLOAD: Final = 1 << 28
NO_TIME: Final = (1 << 64) - 1
_BUFFER, _CAPS, _EVENT_BASE = 1, 2, 64
_VERSION: Final = b"\x01\x00"


@dataclass(frozen=True, slots=True, eq=False)
class GdpFrame:
    """One raw video buffer.

    Attributes
    ----------
    pts_ns : int or None
        Presentation time, ns of the pipeline's running time.
    image : ndarray, shape (H, W) or (H, W, 3), uint8
        The picture.
    """

    pts_ns: int | None
    image: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class _Caps:
    width: int
    height: int
    channels: int

    @property
    def stride(self) -> int:
        return (self.width * self.channels + 3) // 4 * 4


class GdpParser:
    """Puts pieces of the byte stream together; feed bytes, take frames."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._caps: _Caps | None = None

    @property
    def is_midway(self) -> bool:
        """Whether a part of a packet is there."""
        return bool(self._buffer)

    @property
    def missing(self) -> int:
        """Number of bytes missing from the packet being received; at least one."""
        wanted = HEADER_BYTES
        if len(self._buffer) >= HEADER_BYTES:
            wanted += struct.unpack_from(">I", self._buffer, 6)[0]
        return max(1, wanted - len(self._buffer))

    def feed(self, data: bytes) -> Iterator[GdpFrame]:
        """Take bytes and return the frames that they complete.

        Raises
        ------
        FrameFormatError
            If the stream is not GDP, or its pictures are neither BGR nor GRAY8.
        """
        self._buffer += data
        while len(self._buffer) >= HEADER_BYTES:
            if self._buffer[:2] != _VERSION:
                msg = f"stream of frames: header begins {self._buffer[:4].hex()}, expected 0100"
                raise FrameFormatError(msg)
            kind, length, pts_ns = struct.unpack_from(">HIQ", self._buffer, 4)
            if length > LARGEST_PAYLOAD:
                msg = f"stream of frames: packet of {length} bytes"
                raise FrameFormatError(msg)
            if len(self._buffer) < HEADER_BYTES + length:
                return
            payload = bytes(self._buffer[HEADER_BYTES : HEADER_BYTES + length])
            del self._buffer[: HEADER_BYTES + length]
            if kind == _CAPS:
                self._caps = _parse_caps(payload)
            elif kind == _BUFFER:
                yield GdpFrame(None if pts_ns == NO_TIME else pts_ns, self._picture(payload))

    def _picture(self, payload: bytes) -> NDArray[np.uint8]:
        if self._caps is None:
            msg = "stream of frames: a picture before its format"
            raise FrameFormatError(msg)
        caps = self._caps
        if len(payload) != caps.stride * caps.height:
            msg = (
                f"stream of frames: picture of {len(payload)} bytes, expected "
                f"{caps.stride * caps.height} for {caps.width} x {caps.height}"
            )
            raise FrameFormatError(msg)
        rows = np.frombuffer(payload, dtype=np.uint8).reshape(caps.height, caps.stride)
        image = rows[:, : caps.width * caps.channels]
        if caps.channels == 1:
            return image
        return np.ascontiguousarray(image).reshape(caps.height, caps.width, 3)


def _parse_caps(payload: bytes) -> _Caps:
    text = payload.rstrip(b"\x00").decode("ascii", errors="replace")
    found = dict(re.findall(r"(format|width|height)=\(\w+\)([\w]+)", text))
    channels = {"BGR": 3, "GRAY8": 1}.get(found.get("format", ""))
    width, height = (
        int(number) if number.isdigit() else 0
        for number in (found.get("width", ""), found.get("height", ""))
    )
    if channels is None or not width or not height:
        msg = f"stream of frames: format '{text:.120}', expected video/x-raw in BGR or GRAY8"
        raise FrameFormatError(msg)
    return _Caps(width, height, channels)
