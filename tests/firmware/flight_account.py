"""The account of one pod in a log: what its sequence numbers say was sent, logged and lost."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from avionics.analysis.flight import read_flight
from avionics.topics import HEALTH


@dataclass(frozen=True)
class Account:
    """``sent`` spans the first to the last sample that came; the rest is counted apart."""

    sent: int
    logged: int
    counters: dict[str, int]
    words: list[tuple[int, ...]]

    @property
    def lost(self) -> int:
        names = ("samples_lost", "samples_incomplete")  # a counter appears with its first count
        return sum(self.counters.get(name, 0) for name in names)


def account_of(log: Path, pod: str, scale_rad_s: float) -> Account:
    """Read one pod's samples and counters back from a log."""
    flight = read_flight(log, [f"/imu/{pod}", HEALTH])
    samples, health = flight.imu[pod], flight.health
    seqs = samples.seq.tolist()
    words = [tuple(row) for row in np.rint(samples.rate_rad_s / scale_rad_s).astype(int).tolist()]
    # The driver and the pipeline both report.
    reports = zip(health.source, health.counter, health.count.tolist(), strict=True)
    counters = {name: count for source, name, count in reports if source == f"pod {pod}"}
    assert seqs == sorted(seqs), "sequence numbers go back"
    return Account(seqs[-1] - seqs[0] + 1, len(seqs), counters, words)


def places_of(words: list[tuple[int, ...]], reads: list[tuple[int, ...]]) -> list[int]:
    """Return where each logged triple stands among what the chip gave, in its order.

    Raises
    ------
    ValueError
        If a logged triple is none of the chip's, or out of order.
    """
    places, at_least = [], 0
    for triple in words:
        at_least = reads.index(triple, at_least)
        places.append(at_least)
        at_least += 1
    return places


def assert_account_closes(account: Account, reads: list[tuple[int, ...]]) -> list[int]:
    """Check that sent = logged + counted losses, for the log alone and against the chip.

    The pod numbers what it read: between the first and the last logged sample the chip was read as
    often as the numbers went on, but for answers that came too late (counted as timeouts) and one
    at either end where it gave the same triple twice.
    """
    assert account.sent == account.logged + account.lost
    places = places_of(account.words, reads)
    unsent = places[-1] - places[0] + 1 - account.sent
    assert -2 <= unsent <= 2 + 0.05 * account.sent, (unsent, account.counters)
    return places
