"""A frame as the log holds it: PNG or JPEG bytes, decoded only when someone looks at it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from avionics.errors import RecordingError
from drivers.samples import Frame

ImageFormat = Literal["png", "jpeg"]


@dataclass(frozen=True, slots=True, eq=False)
class EncodedFrame:
    """One compressed image; what a log copies without decoding.

    Attributes
    ----------
    t_ns : int
        Middle of the exposure, ns of the steady clock.
    camera : str
        Name of the camera.
    index : int
        Frame number of the source.
    format : str
        "png" or "jpeg".
    data : bytes
        The compressed picture.
    """

    t_ns: int
    camera: str
    index: int
    format: str
    data: bytes

    def decode(self) -> Frame:
        """Return the frame with its pixels.

        Raises
        ------
        RecordingError
            If the bytes are no image.
        """
        import cv2  # noqa: PLC0415 (most readers of a log look at no picture)

        packed = np.frombuffer(self.data, dtype=np.uint8)
        image = cv2.imdecode(packed, cv2.IMREAD_UNCHANGED) if packed.size else None
        if image is None:
            msg = f"camera {self.camera}: frame {self.index} holds no readable {self.format} image"
            raise RecordingError(msg)
        return Frame(self.t_ns, self.camera, self.index, np.asarray(image, dtype=np.uint8))


def encode_frame(frame: Frame, image_format: ImageFormat, *, jpeg_quality: int) -> EncodedFrame:
    """Return the frame with its picture compressed.

    Parameters
    ----------
    frame : Frame
        Gray or BGR.
    image_format : str
        "png" keeps every pixel; "jpeg" is several times smaller.
    jpeg_quality : int
        1 to 100.

    Raises
    ------
    RecordingError
        If OpenCV cannot encode the picture.
    """
    import cv2  # noqa: PLC0415 (many a log holds no picture)

    if image_format == "png":
        suffix, options = ".png", [cv2.IMWRITE_PNG_COMPRESSION, 1]
    else:
        suffix, options = ".jpg", [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality]
    try:
        done, packed = cv2.imencode(suffix, frame.image, options)
    except cv2.error as error:
        done, reason = False, f": {error.err}"
    else:
        reason = ""
    if not done:
        shape = frame.image.shape
        msg = (
            f"camera {frame.camera}: frame {frame.index}, shape {shape}, cannot be encoded{reason}"
        )
        raise RecordingError(msg)
    return EncodedFrame(frame.t_ns, frame.camera, frame.index, image_format, packed.tobytes())
