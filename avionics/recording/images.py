"""A frame becomes what the log holds of it: PNG or JPEG bytes."""

from typing import Literal

from avionics.errors import RecordingError
from avionics.records import EncodedFrame
from drivers.samples import Frame

ImageFormat = Literal["png", "jpeg"]


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
