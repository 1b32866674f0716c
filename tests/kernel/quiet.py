"""How much of a CPU this process truly gets: on an oversubscribed machine no second means much."""

import time

# A guest that gets less has stalls that its share does not show.
QUIET = 0.9


def cpu_share(seconds: float = 1.5) -> float:
    """Return the part of a CPU that a spinning process gets here, 0 to 1.

    Equal slices of work far shorter than a scheduler's time slice: the quickest tell how long
    one takes undisturbed, all of them how long it took.
    """
    slices: list[float] = []
    start = last = time.perf_counter()
    while last - start < seconds:
        for _ in range(5000):
            pass
        now = time.perf_counter()
        slices.append(now - last)
        last = now
    undisturbed = sorted(slices)[len(slices) // 10]
    return min(1.0, undisturbed * len(slices) / (last - start))
