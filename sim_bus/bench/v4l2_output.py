"""A V4L2 output device, such as v4l2loopback's or vivid's, as a taker of frames.

Buffers are mapped and queued: the kernel's emulation of ``write`` refuses every frame of a device
that looks at the payload (vivid, Linux 6.1).
"""

import contextlib
import fcntl
import logging
import mmap
import os
import struct
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.errors import DeviceNotFoundError
from drivers.samples import Frame

# linux/videodev2.h, 64-bit
VIDIOC_QUERYCAP, VIDIOC_G_FMT, VIDIOC_S_FMT = 0x80685600, 0xC0D05604, 0xC0D05605
VIDIOC_REQBUFS, VIDIOC_QUERYBUF = 0xC0145608, 0xC0585609
VIDIOC_QBUF, VIDIOC_DQBUF, VIDIOC_STREAMON = 0xC058560F, 0xC0585611, 0x40045612
CAP_OUTPUT, TYPE_OUTPUT, FIELD_NONE, MEMORY_MMAP = 0x2, 2, 1, 1
_CAPABILITY = struct.Struct("=16s32s32sIII12x")
_FORMAT = struct.Struct("=I4x12I")
FORMAT_BYTES: Final = 208
_REQUEST = struct.Struct("=3I8x")
# index, type, bytesused, flags, field | stamp, timecode, sequence | memory, offset, length
_BUFFER = struct.Struct("=5I40xII4xI12x")
BUFFERS: Final = 4
_log = logging.getLogger(__name__)


class V4l2Output:
    """Shows frames on a V4L2 output device.

    Parameters
    ----------
    device : str
        Node, e.g. ``/dev/video10``.
    width_px, height_px : int
        Size of the frames.

    Attributes
    ----------
    written, lost : int
        Frames that the device took, and that it did not take in time.

    Raises
    ------
    DeviceNotFoundError
        If the device is absent, is no output device, or takes no grey or BGR pictures.
    """

    is_watched = True

    def __init__(self, device: str, width_px: int, height_px: int) -> None:
        self.device = device
        self.written = self.lost = 0
        self._is_taking = True
        self._shape = (height_px, width_px)
        self._maps: list[mmap.mmap] = []
        self._free: list[int] = []
        self._fd = -1
        try:
            self._fd = os.open(device, os.O_RDWR | os.O_NONBLOCK)
            answer = bytearray(_CAPABILITY.size)
            fcntl.ioctl(self._fd, VIDIOC_QUERYCAP, answer)
        except OSError as error:
            self.close()
            msg = (
                f"{device}: is no V4L2 device that can be written ({error.strerror}); load one: "
                "`apt-get install v4l2loopback-dkms && modprobe v4l2loopback video_nr=10`, then "
                "--camera-device /dev/video10; or use --camera pipe"
            )
            raise DeviceNotFoundError(msg) from error
        capabilities = _CAPABILITY.unpack(answer)[5] or _CAPABILITY.unpack(answer)[4]
        if not capabilities & CAP_OUTPUT:
            self.close()
            msg = f"{device}: is a V4L2 device, but takes no output; name a loopback's node"
            raise DeviceNotFoundError(msg)
        self._channels = self._ask_format()
        try:
            self._map_buffers()
        except OSError as error:
            self.close()
            msg = f"{device}: gives no buffers ({error.strerror}); does another program feed it?"
            raise DeviceNotFoundError(msg) from error

    @property
    def counters(self) -> dict[str, int]:
        """Frames written and lost."""
        return {"written": self.written, "lost": self.lost}

    def send(self, frame: Frame) -> None:
        """Show a frame; one for which no buffer is free is lost, and counted."""
        self._take_back()
        if self._queue(self._pixels(frame.image).tobytes()):
            self.written += 1
            self._is_taking = True
            return
        self.lost += 1
        if self._is_taking:
            self._is_taking = False
            _log.warning("%s takes no frames just now; %d lost so far", self.device, self.lost)

    def close(self) -> None:
        """Release the device; may be called twice."""
        for mapped in self._maps:
            mapped.close()
        self._maps.clear()
        self._free.clear()
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _ask_format(self) -> int:
        """Agree on GREY or BGR3; returns the channels. What the device is set to comes first."""
        height, width = self._shape
        current = bytearray(_FORMAT.pack(TYPE_OUTPUT, *[0] * 12).ljust(FORMAT_BYTES, b"\0"))
        with contextlib.suppress(OSError):
            fcntl.ioctl(self._fd, VIDIOC_G_FMT, current)
        found = _FORMAT.unpack_from(current)[3]
        choices = [(int.from_bytes(name, "little"), n) for name, n in ((b"GREY", 1), (b"BGR3", 3))]
        for code, channels in sorted(choices, key=lambda choice: choice[0] != found):
            wish = _FORMAT.pack(
                TYPE_OUTPUT, width, height, code, FIELD_NONE, width * channels,
                width * height * channels, 8 if channels == 1 else 0, 0, 0, 0, 0, 0,
            )  # fmt: skip
            answer = bytearray(wish.ljust(FORMAT_BYTES, b"\0"))
            with contextlib.suppress(OSError):
                fcntl.ioctl(self._fd, VIDIOC_S_FMT, answer)
                if _FORMAT.unpack_from(answer)[1:4] == (width, height, code):
                    return channels
        self.close()
        msg = f"{self.device}: takes neither GREY nor BGR3 pictures of {width} x {height} px"
        raise DeviceNotFoundError(msg)

    def _map_buffers(self) -> None:
        request = bytearray(_REQUEST.pack(BUFFERS, TYPE_OUTPUT, MEMORY_MMAP))
        fcntl.ioctl(self._fd, VIDIOC_REQBUFS, request)
        (count, _, _) = _REQUEST.unpack(request)
        for index in range(count):
            buffer = _buffer(index)
            fcntl.ioctl(self._fd, VIDIOC_QUERYBUF, buffer)
            *_, offset, length = _BUFFER.unpack(buffer)
            self._maps.append(mmap.mmap(self._fd, length, offset=offset))
            self._free.append(index)
        fcntl.ioctl(self._fd, VIDIOC_STREAMON, struct.pack("=i", TYPE_OUTPUT))

    def _queue(self, data: bytes) -> bool:
        if not self._free:
            return False
        index = self._free[-1]
        self._maps[index][: len(data)] = data
        try:
            fcntl.ioctl(self._fd, VIDIOC_QBUF, _buffer(index, len(data)))
        except OSError:
            return False
        self._free.pop()
        return True

    def _take_back(self) -> None:
        """Collect the buffers that were shown."""
        with contextlib.suppress(OSError):  # none is ready, or the device is gone
            while len(self._free) < len(self._maps):
                buffer = _buffer(0)
                fcntl.ioctl(self._fd, VIDIOC_DQBUF, buffer)
                self._free.append(_BUFFER.unpack(buffer)[0])

    def _pixels(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if self._channels == 3 and image.ndim == 2:
            return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
        if self._channels == 1 and image.ndim == 3:
            return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        return image


def _buffer(index: int, used_bytes: int = 0) -> bytearray:
    return bytearray(_BUFFER.pack(index, TYPE_OUTPUT, used_bytes, 0, FIELD_NONE, MEMORY_MMAP, 0, 0))
