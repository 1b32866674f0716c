"""Stand-in for the Jetson's CSI camera source: a live picture labelled as NVMM memory."""

import sys
from pathlib import Path

import gi

gi.require_version("Gst", "1.0")
from gi.repository import GObject, Gst  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent))
from nvmm import NVMM, NvmmLabel  # noqa: E402

Gst.init(None)


def _text(default=""):
    return GObject.Property(type=str, default=default)


class NvArgusCameraSrc(Gst.Bin):
    __gstmetadata__ = ("nvarguscamerasrc", "Source/Video", "A stand-in without a camera", "tests")
    __gsttemplates__ = (
        Gst.PadTemplate.new(
            "src", Gst.PadDirection.SRC, Gst.PadPresence.ALWAYS, Gst.Caps.from_string(NVMM)
        ),
    )
    sensor_id = GObject.Property(type=int, default=0, nick="sensor-id")
    sensor_mode = GObject.Property(type=int, default=-1)
    num_buffers = GObject.Property(type=int, default=-1)
    wbmode = GObject.Property(type=int, default=1)
    aelock = GObject.Property(type=bool, default=False)
    awblock = GObject.Property(type=bool, default=False)
    exposuretimerange = _text()
    gainrange = _text()
    ispdigitalgainrange = _text()

    def __init__(self):
        super().__init__()
        source = Gst.ElementFactory.make("videotestsrc", None)
        source.set_property("is-live", True)
        source.set_property("pattern", "ball")
        label = NvmmLabel()
        self.add(source)
        self.add(label)
        source.link(label)
        pad = Gst.GhostPad.new("src", label.get_static_pad("src"))
        pad.set_active(True)
        self.add_pad(pad)


GObject.type_register(NvArgusCameraSrc)
__gstelementfactory__ = ("nvarguscamerasrc", Gst.Rank.NONE, NvArgusCameraSrc)
