"""The sources of ``Frame``: a recorded video, a V4L2 device, a GStreamer child process."""

from drivers.cameras.file import VideoFile
from drivers.cameras.gstreamer import FrameProcess, jetson_csi_line
from drivers.cameras.v4l2 import V4l2Camera

__all__ = ["FrameProcess", "V4l2Camera", "VideoFile", "jetson_csi_line"]
