"""Error frames are counted by class; an event tells the first of a class, and each bus-off."""

from collections import Counter

import pytest

from drivers.can.error_frames import ERROR_NAMES, ErrorFrames
from drivers.can.port import CanFrame


class Said(list):
    def take(self, level: str, text: str) -> None:
        self.append((level, text))


def frame(identifier: int) -> CanFrame:
    return CanFrame(0, identifier, b"\x01\x02")


@pytest.fixture
def errors() -> tuple[ErrorFrames, Counter, Said]:
    counters, said = Counter(), Said()
    return ErrorFrames(counters, said.take), counters, said


@pytest.mark.parametrize(("bit", "name"), ERROR_NAMES)
def test_every_class_has_its_counter(errors, bit: int, name: str) -> None:
    frames, counters, said = errors
    frames.take(frame(bit))
    assert counters == {f"error_{name}": 1}
    ((level, text),) = said
    assert level == ("error" if name == "bus_off" else "warning")
    assert text.startswith(f"{name.replace('_', ' ')}: error frame 0x{bit:X}#0102")


def test_frame_of_two_classes_counts_for_both_and_one_of_none_is_unnamed(errors) -> None:
    frames, counters, _ = errors
    frames.take(frame(0x004 | 0x080))
    frames.take(frame(0))
    assert counters == {"error_controller": 1, "error_bus_error": 1, "error_unnamed": 1}


def test_class_is_reported_once_and_bus_off_and_restart_each_time(errors) -> None:
    frames, counters, said = errors
    for _ in range(3):
        for bit in (0x020, 0x040, 0x100):
            frames.take(frame(bit))
    assert counters["error_no_acknowledge"] == 3
    words = [text.partition(":")[0] for _, text in said]
    assert words.count("no acknowledge") == 1
    assert words.count("bus off") == words.count("restarted") == 3
