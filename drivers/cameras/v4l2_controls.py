"""The V4L2 controls that OpenCV has no property for, set on the device itself."""

import contextlib
import fcntl
import os
import struct
from typing import Final

# linux/videodev2.h, linux/v4l2-controls.h
VIDIOC_S_CTRL: Final = 0xC008561C
V4L2_CID_AUTOGAIN: Final = 0x00980912
_CONTROL: Final = struct.Struct("=Ii")


def turn_off_automatic_gain(device: str) -> bool:
    """Let a device keep the gain that is set; returns whether it had such a control.

    Parameters
    ----------
    device : str
        Node, e.g. ``/dev/video0``; another file descriptor may be streaming from it.
    """
    with contextlib.suppress(OSError):
        fd = os.open(device, os.O_RDWR | os.O_NONBLOCK)
        try:
            fcntl.ioctl(fd, VIDIOC_S_CTRL, _CONTROL.pack(V4L2_CID_AUTOGAIN, 0))
        finally:
            os.close(fd)
        return True
    return False
