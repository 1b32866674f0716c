"""What leaves the pipeline: one record for several sinks."""

from avionics.flight.outputs import FanOut
from avionics.records import Health
from avionics.topics import Record


class NamedSink:
    """Appends to a list shared with its neighbours, under its own name."""

    def __init__(self, name: str, written: list[tuple[str, Record, int]]) -> None:
        self._name, self._written = name, written

    def write(self, record: Record, arrival_ns: int) -> None:
        self._written.append((self._name, record, arrival_ns))


def test_fan_out_hands_each_record_to_every_sink_in_order() -> None:
    written: list[tuple[str, Record, int]] = []
    first, second = Health(1, "a"), Health(2, "b")
    fan_out = FanOut([NamedSink("log", written), NamedSink("live", written)])
    fan_out.write(first, 10)
    fan_out.write(second, 20)
    assert written == [
        ("log", first, 10),
        ("live", first, 10),
        ("log", second, 20),
        ("live", second, 20),
    ]


def test_fan_out_without_sinks_takes_records() -> None:
    FanOut([]).write(Health(1, "a"), 10)
