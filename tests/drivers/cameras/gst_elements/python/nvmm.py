"""Stand-ins for the Jetson's camera elements, so that its pipeline line runs unmodified.

``nvarguscamerasrc`` is a live test source whose caps say memory:NVMM; ``nvvidconv`` takes that
label off again and converts. The label is all there is: the memory is ordinary.
"""

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstBase", "1.0")
from gi.repository import GObject, Gst, GstBase  # noqa: E402

Gst.init(None)
NVMM = "video/x-raw(memory:NVMM)"
PLAIN = "video/x-raw"


def _relabelled(caps, features):
    result = Gst.Caps.new_empty()
    for i in range(caps.get_size()):
        structure = caps.get_structure(i).copy()
        result.append_structure_full(
            structure, Gst.CapsFeatures.new_single(features) if features else None
        )
    return result


class _Relabel(GstBase.BaseTransform):
    """Passes buffers on and changes the memory feature of their caps."""

    into = None  # feature of the source pad
    out_of = None  # feature of the sink pad

    def do_transform_caps(self, direction, caps, filter_caps):
        feature = self.into if direction == Gst.PadDirection.SINK else self.out_of
        caps = _relabelled(caps, feature)
        return caps if filter_caps is None else filter_caps.intersect(caps)

    def do_transform_size(self, direction, caps, size, other_caps):
        return True, size

    def do_get_unit_size(self, caps):
        return True, 1


def _pads(sink, source):
    return (
        Gst.PadTemplate.new("sink", Gst.PadDirection.SINK, Gst.PadPresence.ALWAYS, sink),
        Gst.PadTemplate.new("src", Gst.PadDirection.SRC, Gst.PadPresence.ALWAYS, source),
    )


class NvmmLabel(_Relabel):
    __gstmetadata__ = ("label", "Filter", "Labels ordinary memory as NVMM", "tests")
    __gsttemplates__ = _pads(Gst.Caps.from_string(PLAIN), Gst.Caps.from_string(NVMM))
    into = "memory:NVMM"


class NvmmUnlabel(_Relabel):
    __gstmetadata__ = ("unlabel", "Filter", "Labels NVMM memory as ordinary", "tests")
    __gsttemplates__ = _pads(Gst.Caps.from_string(NVMM), Gst.Caps.from_string(PLAIN))
    out_of = "memory:NVMM"


GObject.type_register(NvmmLabel)
GObject.type_register(NvmmUnlabel)
__gstelementfactory__ = ("nvmmlabel", Gst.Rank.NONE, NvmmLabel)
