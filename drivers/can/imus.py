"""``CanImus``: the pods of one CAN bus as a source of samples, and the master of their time."""

from collections import Counter, deque
from collections.abc import Mapping
from typing import Any

import can

from drivers.can.pod.codec import decode, encode, is_ours
from drivers.can.pod.configurator import PodConfigurator
from drivers.can.pod.messages import (
    FOLLOW_UP_ID,
    SYNC_ID,
    Axes,
    ConfigKey,
    ConfigReply,
    Counters,
    FollowUp,
    Identity,
    PodMessage,
    Sample,
    Status,
    Sync,
    SyncReply,
)
from drivers.can.pod.station import PodStation
from drivers.can.pod.time_sync import SyncMaster
from drivers.can.pod.trigger_skew import TriggerSkew
from drivers.can.port import CanFrame, CanPort
from drivers.can.python_can import PythonCanPort
from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError, FrameFormatError
from drivers.events import Event, EventList
from drivers.samples import ImuSample

SILENT_NS = 1_000_000_000
# Frames taken between two readings of the clock, which is slow on some machines.
AT_ONCE = 64
# A bus full of other traffic does not hold the caller longer than this.
FLOODED_NS = 50_000_000
# Pairs for a pod's clock; more of them would cost time and shorten the fit's window.
PAIR_PERIOD_S = 0.25
Settings = Mapping[ConfigKey, int]


class CanImus:
    """Decodes pods and keeps their time; a ``Source[ImuSample]``.

    Parameters
    ----------
    bus : CanPort or can.BusABC
        The bus; it is closed with the source.
    pods : mapping of int to str
        Node number to pod identifier.
    clock : Clock
        The steady clock.
    settings : mapping of int to mapping of ConfigKey to int, optional
        What each node is set to, now and after its restarts; nodes that are absent stay as set.
    sync_period_s : float
        Time between syncs; 0 = another master keeps the bus's time.
    trigger_hz : float
        How often a sync is sent that makes all pods sample at once, in place of
        ``sync_period_s``; 0 = by their own timers.

    Notes
    -----
    A lost bus, a silent pod or a hostile frame is counted and reported once, never raised.
    """

    def __init__(
        self,
        bus: CanPort | can.BusABC,
        pods: Mapping[int, str],
        clock: Clock,
        *,
        settings: Mapping[int, Settings] | None = None,
        sync_period_s: float = PAIR_PERIOD_S,
        trigger_hz: float = 0.0,
    ) -> None:
        self._port: Any = PythonCanPort(bus, clock) if isinstance(bus, can.BusABC) else bus
        self.name = str(self._port.name)
        self._clock = clock
        self._events = EventList()
        self._counters: Counter[str] = Counter()
        self._stations = {n: PodStation(pod, self._events) for n, pod in pods.items()}
        wanted = {n: dict(asked) for n, asked in (settings or {}).items() if n in pods}
        self._skew, self._trigger = TriggerSkew(), trigger_hz > 0
        if self._trigger:
            sync_period_s = 1.0 / trigger_hz
            wanted = {n: {**wanted.get(n, {}), ConfigKey.SAMPLING: 1} for n in pods}
        self._configurators = {
            n: PodConfigurator(n, self._stations[n].name, asked, self._events)
            for n, asked in wanted.items()
        }
        self._sync_period_ns = round(sync_period_s * 1e9)
        self._syncs_per_pair = max(1, round(PAIR_PERIOD_S * trigger_hz))
        self._sync = SyncMaster()
        self._sync_due_ns: int | None = None
        self._heard_ns: dict[int, int] = {}
        self._silent: set[int] = set()
        self._ready: deque[ImuSample] = deque()
        self._is_open = True

    def open(self, timeout_s: float = 2.0) -> None:
        """Wait until every pod has sent a sample and confirmed its settings.

        A pod that samples but answers no request flies as it is set, which is an event.

        Raises
        ------
        DeviceNotFoundError
            If one sent none within ``timeout_s``, or refuses a setting; the message names it and
            what to check.
        """
        give_up_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        waiting: deque[ImuSample] = deque()
        while self._clock.now_ns() < give_up_ns:
            sample = self.read(0.0)
            if sample is not None:
                waiting.append(sample)
                continue
            if all(s.counters["samples"] for s in self._stations.values()):
                self._check_refusals()
                if all(c.is_done for c in self._configurators.values()):
                    break
            self._clock.sleep_until_ns(self._clock.now_ns() + 1_000_000)
        if all(s.counters["samples"] for s in self._stations.values()):
            self._ready.extendleft(reversed(waiting))
            return
        silent = {n: s for n, s in self._stations.items() if not s.counters["samples"]}
        reasons = "; ".join(f"{s.name}: {self._complaint(n, s)}" for n, s in silent.items())
        msg = (
            f"{reasons} within {timeout_s} s on {self._port.name}; check the pod's supply and "
            "number, the bit rate and the termination"
        )
        raise DeviceNotFoundError(msg)

    def _check_refusals(self) -> None:
        for node, configurator in self._configurators.items():
            if configurator.refused:
                msg = (
                    f"{self._stations[node].name}: {configurator.refused[0]}; what the pod does "
                    "not take must not be configured: correct its chip table or update its firmware"
                )
                raise DeviceNotFoundError(msg)

    def read(self, timeout_s: float) -> ImuSample | None:
        """Return the next sample, None if none came within ``timeout_s``."""
        if self._ready or not self._is_open:
            return self._ready.popleft() if self._ready else None
        now_ns = self._clock.now_ns()
        deadline_ns = now_ns + round(timeout_s * 1e9)
        while True:
            self._send_what_is_due(now_ns)
            due_ns = self.next_ns
            wait_ns = max(0, min(deadline_ns, due_ns) - now_ns) if timeout_s > 0 else 0
            frame = self._port.recv(wait_ns * 1e-9)
            if frame is None:
                before_ns, now_ns = now_ns, self._clock.now_ns()
                if before_ns < due_ns <= now_ns < deadline_ns:
                    continue
                self._watch(now_ns)
                return None
            for _ in range(AT_ONCE):
                self._on_frame(frame)
                if self._ready:
                    return self._ready.popleft()
                frame = self._port.recv(0.0)
                if frame is None:
                    break
            now_ns = self._clock.now_ns()
            if now_ns > deadline_ns + FLOODED_NS:
                return None

    @property
    def next_ns(self) -> int:
        """When something has to be sent next, ns of the steady clock."""
        now_ns = self._clock.now_ns()
        return now_ns + 50_000_000 if self._sync_due_ns is None else self._sync_due_ns

    @property
    def counters(self) -> dict[str, int]:
        """All counters, named ``<pod>.<what>`` and ``<bus>.<what>``."""
        return {
            f"{source.removeprefix('pod ')}.{name}": count
            for source, group in self.health().items()
            for name, count in group.items()
        }

    def health(self) -> dict[str, dict[str, int]]:
        """Return the counters by source: the bus, ``pod 1`` and so on."""
        groups = {self._port.name: {**self._counters, **self._port.counters}}
        if self._trigger:
            groups[self._port.name]["trigger_skew_us"] = self._skew.worst_us
        for node, station in self._stations.items():
            own = self._configurators[node].counters if node in self._configurators else {}
            groups[station.name] = {**station.all_counters(), **own}
        return groups

    def chip_ids(self) -> dict[str, bytes]:
        """Return the unique ids of the pods' chips as far as they have been sent, by ``pod 1``."""
        return {station.name: station.chip_id for station in self._stations.values()}

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        both = [*self._port.take_events(), *self._events.take()]
        return sorted(both, key=lambda event: event.t_ns)

    def close(self) -> None:
        """Release the bus; may be called twice."""
        if self._is_open:
            self._is_open = False
            self._port.close()

    def _send_what_is_due(self, now_ns: int) -> None:
        if self._sync_period_ns and (self._sync_due_ns is None or now_ns >= self._sync_due_ns):
            late = self._sync_due_ns is None or now_ns - self._sync_due_ns > self._sync_period_ns
            base_ns = now_ns if late or self._sync_due_ns is None else self._sync_due_ns
            self._sync_due_ns = base_ns + self._sync_period_ns
            seq = self._sync.next_seq()
            t_ns = self._port.send(*encode(Sync(seq, trigger=self._trigger)))
            if t_ns is not None:
                self._counters["syncs_sent"] += 1
                if not self._port.echoes:
                    self._follow_up(seq, t_ns)
        for configurator in self._configurators.values():
            request = configurator.due(now_ns)
            if request is not None:
                self._port.send(*encode(request))

    def _follow_up(self, seq: int, t_ns: int) -> None:
        self._sync.left(seq, t_ns)
        self._port.send(*encode(FollowUp(seq, t_ns // 1000)))

    def _on_frame(self, frame: CanFrame) -> None:
        if frame.is_error:
            self._counters["error_frames"] += 1
            return
        if frame.is_extended or frame.is_remote or not is_ours(frame.arbitration_id):
            self._counters["foreign_frames"] += 1
            return
        if frame.is_own:
            self._on_echo(frame)
            return
        try:
            message = decode(frame.arbitration_id, frame.data)
        except FrameFormatError:
            self._counters["bad_frames"] += 1
            return
        self._counters["pod_frames"] += 1
        if frame.arbitration_id in (SYNC_ID, FOLLOW_UP_ID):
            self._on_other_master(message, frame.t_ns)
            return
        self._on_message(message, frame.t_ns)

    def _on_echo(self, frame: CanFrame) -> None:
        if frame.arbitration_id == SYNC_ID:
            self._follow_up(frame.data[0], frame.t_ns)

    def _on_other_master(self, message: PodMessage, t_ns: int) -> None:
        if self._sync_period_ns and not self._counters["other_masters"]:
            self._events.add(t_ns, self._port.name, "error", "another master sends time syncs")
        self._counters["other_masters"] += 1
        if not self._sync_period_ns and isinstance(message, Sync):
            self._sync.left(message.seq, t_ns)

    def _on_message(self, message: PodMessage, t_ns: int) -> None:
        assert not isinstance(message, Sync | FollowUp)
        station = self._stations.get(message.node)
        if station is None:
            self._counters["unconfigured_pods"] += 1
            return
        match message:
            case Axes():
                station.on_axes(message)
            case Sample():
                self._heard(message.node, t_ns)
                self._skew.on_sample(message)
                sample = station.on_sample(message, t_ns)
                if sample is not None:
                    self._ready.append(sample)
            case SyncReply():
                self._skew.on_reply(message)
                sent_ns = self._sync.sent_ns(message.seq)
                if sent_ns is not None and message.seq % self._syncs_per_pair == 0:
                    station.clock.add_pair(message.t_local_us, sent_ns)
            case Status():
                restarts = station.counters["restarts"]
                station.on_status(message, t_ns)
                if station.counters["restarts"] > restarts and message.node in self._configurators:
                    self._configurators[message.node].restart()
            case Counters():
                station.on_counters(message)
            case Identity():
                station.on_identity(message, t_ns)
            case ConfigReply():
                if message.node in self._configurators:
                    self._configurators[message.node].on_reply(message, t_ns)

    def _heard(self, node: int, t_ns: int) -> None:
        self._heard_ns[node] = t_ns
        if node in self._silent:
            self._silent.discard(node)
            self._events.add(t_ns, self._stations[node].name, "info", "samples again")

    def _watch(self, now_ns: int) -> None:
        """Report once that a pod fell silent."""
        for node, heard_ns in self._heard_ns.items():
            if now_ns - heard_ns > SILENT_NS and node not in self._silent:
                self._silent.add(node)
                station = self._stations[node]
                station.counters["silences"] += 1
                self._events.add(now_ns, station.name, "warning", "no samples for 1 s")

    def _complaint(self, node: int, station: PodStation) -> str:
        if station.state == "unheard" and not station.uids:
            return f"no frame from node {node}"
        return f"state '{station.state}', no sample from node {node}"
