"""How far apart the pods of a bus sample after the sync that triggers them all."""

from drivers.can.pod.messages import Sample, SyncReply

# Between a sync's reception and the middle of the burst; the reply may come before or after.
LONGEST_US = 5_000
KEPT_SYNCS = 16
SAMPLE_BITS = 24


class TriggerSkew:
    """Pairs every pod's reply to a sync with the sample that the sync triggered.

    Attributes
    ----------
    worst_us : int
        Largest spread so far, over the pods, of the delay from a sync's reception to the sample,
        us. A pod that samples more than 5 ms late counts itself (``sample_late``), not here.
    """

    def __init__(self) -> None:
        self.worst_us = 0
        self._samples: dict[int, int] = {}
        self._replies: dict[int, tuple[int, int]] = {}
        self._ranges: dict[int, tuple[int, int]] = {}

    def on_sample(self, mark: Sample) -> None:
        """Take a sample; one of the pod's own timer does not count."""
        if mark.triggered:
            self._samples[mark.node] = mark.t_local_us
            self._pair(mark.node)

    def on_reply(self, reply: SyncReply) -> None:
        """Take a pod's reply to a sync."""
        self._replies[reply.node] = reply.seq, reply.t_local_us
        self._pair(reply.node)

    def _pair(self, node: int) -> None:
        if node not in self._samples or node not in self._replies:
            return
        seq, received_us = self._replies[node]
        delay_us = (self._samples[node] - received_us) % (1 << SAMPLE_BITS)
        if delay_us > LONGEST_US:
            return  # one of the two is of the sync before
        del self._samples[node], self._replies[node]
        low_us, high_us = self._ranges.pop(seq, (delay_us, delay_us))
        low_us, high_us = min(low_us, delay_us), max(high_us, delay_us)
        self._ranges[seq] = low_us, high_us
        self.worst_us = max(self.worst_us, high_us - low_us)
        while len(self._ranges) > KEPT_SYNCS:
            del self._ranges[next(iter(self._ranges))]
