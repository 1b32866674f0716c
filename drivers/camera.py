"""The sources of ``Frame``: a recorded video, a V4L2 device, a GStreamer child process."""

from drivers.frame_process import FrameProcess, jetson_csi_line
from drivers.v4l2_camera import V4l2Camera
from drivers.video_file import VideoFile

__all__ = ["FrameProcess", "V4l2Camera", "VideoFile", "jetson_csi_line"]
