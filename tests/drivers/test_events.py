"""What drivers report: each event names its source once."""

from drivers.events import EventList, named_once


def test_a_source_that_its_error_names_stands_once_in_the_event() -> None:
    events = EventList()
    error = "pod 1: chip id 0x00, expected 0xA0"
    events.add(1, "pod 1", "error", f"{error}; trying again every 500 ms")
    events.add(2, "pod 1", "error", f"no answer in 5 ticks: {error}")
    first, second = events.take()
    assert first.message == "chip id 0x00, expected 0xA0; trying again every 500 ms"
    assert second.message == "no answer in 5 ticks: chip id 0x00, expected 0xA0"


def test_other_names_stay() -> None:
    assert named_once("can can0", "pod 1: silent") == "pod 1: silent"
    assert named_once("pod 1", "pod 12: silent") == "pod 12: silent"
