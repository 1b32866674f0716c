"""The unbroken sequence number does not follow the time of a machine that stood still."""

from drivers.can.pod.messages import Axes, Kind, Sample
from drivers.can.pod.station import PodStation
from drivers.events import EventList


def feed(station: PodStation, number: int, arrival_ns: int) -> int | None:
    local_us = number * 10_000 % (1 << 24)
    station.on_axes(Axes(Kind.GYRO, 1, number % 256, 1, 2, 3))
    sample = station.on_sample(Sample(1, number % 256, local_us), arrival_ns)
    return None if sample is None else sample.seq


def test_a_stall_of_the_machine_is_no_turn_of_the_sequence() -> None:
    station = PodStation("1", EventList())
    arrivals = [n * 10_000_000 + (6_000_000_000 if n >= 300 else 0) for n in range(600)]
    seqs = [feed(station, n, t_ns) for n, t_ns in enumerate(arrivals)]
    assert seqs == list(range(600))
    assert station.counters["samples_lost"] == 0


def test_a_silence_of_whole_turns_is_counted_by_time() -> None:
    station = PodStation("1", EventList())
    for n in [*range(100), *range(100 + 3 * 256, 1000)]:
        feed(station, n, n * 10_000_000)
    assert station.counters["samples_lost"] == 3 * 256
