"""Stand-in for the Jetson's converter: takes the NVMM label off, scales and converts."""

import sys
from pathlib import Path

import gi

gi.require_version("Gst", "1.0")
from gi.repository import GObject, Gst  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent))
from nvmm import NVMM, PLAIN, NvmmUnlabel  # noqa: E402

Gst.init(None)


class NvVidConv(Gst.Bin):
    __gstmetadata__ = ("nvvidconv", "Filter/Converter/Video", "A stand-in", "tests")
    __gsttemplates__ = (
        Gst.PadTemplate.new(
            "sink", Gst.PadDirection.SINK, Gst.PadPresence.ALWAYS, Gst.Caps.from_string(NVMM)
        ),
        Gst.PadTemplate.new(
            "src", Gst.PadDirection.SRC, Gst.PadPresence.ALWAYS, Gst.Caps.from_string(PLAIN)
        ),
    )
    flip_method = GObject.Property(type=int, default=0, nick="flip-method")

    def __init__(self):
        super().__init__()
        unlabel = NvmmUnlabel()
        scale = Gst.ElementFactory.make("videoscale", None)
        convert = Gst.ElementFactory.make("videoconvert", None)
        for element in (unlabel, scale, convert):
            self.add(element)
        unlabel.link(scale)
        scale.link(convert)
        for name, element in (("sink", unlabel), ("src", convert)):
            pad = Gst.GhostPad.new(name, element.get_static_pad(name))
            pad.set_active(True)
            self.add_pad(pad)


GObject.type_register(NvVidConv)
__gstelementfactory__ = ("nvvidconv", Gst.Rank.NONE, NvVidConv)
