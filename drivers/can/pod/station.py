"""One pod as the receiver sees it: its frames put together, its time, its losses, its state."""

import math
from collections import Counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.bno055 import registers as reg
from drivers.can.pod.messages import (
    COUNTER_NAMES,
    LAYOUT_VERSION,
    REFUSAL_NAMES,
    RESET_CAUSE_NAMES,
    STATE_NAMES,
    Axes,
    Counters,
    Identity,
    Kind,
    Sample,
    Status,
)
from drivers.can.pod.time_sync import PodClock
from drivers.events import EventList, Level
from drivers.repeats import STALE_AFTER
from drivers.samples import ImuSample

# ``Sample.scale`` to rad/s per LSB.
GYRO_SCALES_RAD_S: Final = tuple(
    math.radians(dps) for dps in (*(r / 32768 for r in (2000, 1000, 500, 250, 125)), 1 / 16)
)
_UID_PARTS: Final = {1: 6, 2: 6, 3: 6, 4: 6, 5: 4}
_CHIP_PARTS: Final = (3, 4, 5)


class PodStation:
    """Puts the frames of one pod together.

    Parameters
    ----------
    pod : str
        Identifier that the samples carry.
    events : EventList
        Takes the events of the pod.

    Attributes
    ----------
    clock : PodClock
        The pod's clock against ours.
    counters : Counter of str
        ``samples``, ``samples_lost`` (by the sequence number), ``samples_incomplete`` (a frame of
        the sample was lost), ``repeated``, ``stale`` (the chip had nothing new for long),
        ``duplicates``, ``parts_lost``, ``restarts``, ``seq_jumps``, ``bad_scale``.
    reported : dict of str to int
        The pod's own counters, as it last sent them.
    state : str
        The pod's state by its last status frame.
    """

    def __init__(self, pod: str, events: EventList) -> None:
        self.pod = pod
        self.clock = PodClock()
        self.counters: Counter[str] = Counter()
        self.reported: dict[str, int] = {}
        self.state = "unheard"
        self.uids: dict[int, bytes] = {}
        self._events = events
        self._axes: dict[Kind, Axes] = {}
        self._seq: int | None = None
        self._number = 0
        self._last_ns = 0
        self._last_local_us = 0
        self._period_ns = 10_000_000.0
        self._uptime_s = -1
        self._repeats = 0

    @property
    def name(self) -> str:
        """What messages and counters call the pod."""
        return f"pod {self.pod}"

    @property
    def chip_id(self) -> bytes:
        """Unique id of the pod's chip, 16 bytes; empty while a part of it is missing."""
        parts = [self.uids.get(part, b"") for part in _CHIP_PARTS]
        return b"".join(parts) if all(parts) else b""

    def all_counters(self) -> dict[str, int]:
        """Return own, clock's and the pod's reported counters."""
        reported = {f"reported_{name}": count for name, count in self.reported.items()}
        return {
            **self.counters,
            **self.clock.counters,
            "drift_ppb": round(self.clock.drift * 1e9),
            **reported,
        }

    def on_axes(self, axes: Axes) -> None:
        """Keep one sensor's words until the sample is closed."""
        self._axes[axes.kind] = axes

    def on_sample(self, mark: Sample, arrival_ns: int) -> ImuSample | None:
        """Close a sample; returns it, or None if a frame of it was lost or came twice."""
        gyro = self._axes.pop(Kind.GYRO, None)
        accel, mag = self._axes.pop(Kind.ACCEL, None), self._axes.pop(Kind.MAG, None)
        t_ns = self.clock.sample_time_ns(mark.t_local_us, arrival_ns)
        seq = self._count(mark.seq, t_ns, mark.t_local_us)
        if seq is None:
            return None
        if gyro is None or gyro.seq != mark.seq:
            self.counters["samples_incomplete"] += 1
            return None
        if mark.scale >= len(GYRO_SCALES_RAD_S):
            self.counters["bad_scale"] += 1
            return None
        self._repeats = self._repeats + 1 if mark.repeated else 0
        self.counters["repeated"] += mark.repeated
        if self._repeats >= STALE_AFTER:
            self.counters["stale"] += 1
            return None
        self.counters["samples"] += 1
        scale = GYRO_SCALES_RAD_S[mark.scale]
        return ImuSample(
            t_ns,
            self.pod,
            seq,
            np.array((gyro.x, gyro.y, gyro.z), dtype=np.float64) * scale,
            self._part(accel, mark, reg.ACCEL_SCALE_M_S2) if mark.has_accel else None,
            self._part(mag, mark, reg.MAG_SCALE_T) if mark.has_mag else None,
        )

    def on_status(self, status: Status, t_ns: int) -> None:
        """Take the pod's state; reports changes and restarts."""
        name = STATE_NAMES[status.state] if status.state < len(STATE_NAMES) else "unknown"
        if name != self.state:
            level: Level = "info" if name in ("starting", "running") else "warning"
            self._events.add(t_ns, self.name, level, f"state {self.state} -> {name}")
            self.state = name
        if status.uptime_s < self._uptime_s:
            self._restarted(t_ns)
        self._uptime_s = status.uptime_s
        self.reported["temperature_degc"] = status.temperature_degc
        self.reported["calibration"] = status.calibration
        self.reported["chip_error"] = status.chip_error

    def on_counters(self, counters: Counters) -> None:
        """Take one page of the pod's own counters."""
        self.reported.update(zip(COUNTER_NAMES[counters.page], counters.values, strict=True))

    def on_identity(self, identity: Identity, t_ns: int) -> None:
        """Take one part of the identity; reports refusals, versions and duplicates."""
        if identity.part == 0:
            self._on_versions(identity.payload, t_ns)
            return
        part = identity.payload[: _UID_PARTS[identity.part]]
        if not any(part):
            return  # the pod has not read it yet
        known = self.uids.get(identity.part)
        if known is not None and known != part:
            self.counters["uid_changed"] += 1
            self._events.add(
                t_ns,
                self.name,
                "error",
                f"unique id {part.hex()}, before {known.hex()}: two pods share this number, or "
                "it was exchanged",
            )
        was_known = bool(self.chip_id)
        self.uids[identity.part] = part
        if self.chip_id and not was_known:
            self._events.add(t_ns, self.name, "info", f"chip {self.chip_id.hex()}")

    def _on_versions(self, payload: bytes, t_ns: int) -> None:
        layout, major, minor, patch, cause, refusal = payload
        first = 0 not in self.uids
        if not first and self.uids[0] == payload:
            return
        self.uids[0] = payload
        if layout != LAYOUT_VERSION:
            self._events.add(
                t_ns, self.name, "error", f"layout version {layout}, expected {LAYOUT_VERSION}"
            )
        elif refusal:
            why = REFUSAL_NAMES[refusal] if refusal < len(REFUSAL_NAMES) else str(refusal)
            self._events.add(t_ns, self.name, "error", f"refuses to run: {why}")
        else:
            because = RESET_CAUSE_NAMES[cause] if cause < len(RESET_CAUSE_NAMES) else str(cause)
            self._events.add(
                t_ns, self.name, "info", f"firmware {major}.{minor}.{patch}, reset by {because}"
            )

    def _restarted(self, t_ns: int) -> None:
        self.counters["restarts"] += 1
        self._events.add(t_ns, self.name, "warning", "restarted")

    def _count(self, seq8: int, t_ns: int, local_us: int) -> int | None:
        """Return the unbroken sequence number, None for a frame that came twice."""
        own_ns = (local_us - self._last_local_us) % (1 << 24) * 1000
        self._last_local_us = local_us
        if self._seq is None:
            self._seq, self._number, self._last_ns = seq8, seq8, t_ns
            return self._number
        step = (seq8 - self._seq) % 256
        elapsed = (t_ns - self._last_ns) / self._period_ns
        own = own_ns / self._period_ns
        # Less than a turn by the pod's own stamps, whatever a stalled machine makes of the time.
        if own < 250 and abs(step - own) <= 3 + 0.1 * own:
            elapsed = own
        if step == 0 and elapsed < 128:
            self.counters["duplicates"] += 1
            return None
        # Whole turns of the eight bits show in the time alone.
        step += 256 * max(0, round((elapsed - step) / 256))
        if step > 3 and abs(step - elapsed) > 3 + 0.1 * elapsed:
            # The pod restarted, or its rate changed: only the time shows what is missing.
            self.counters["seq_jumps"] += 1
            step = max(1, round(elapsed))
        elif step == 1 and 0 < elapsed < 20:
            self._period_ns += 0.02 * (t_ns - self._last_ns - self._period_ns)
        self.counters["samples_lost"] += step - 1
        self._number += step
        self._seq = seq8
        self._last_ns = t_ns
        return self._number

    def _part(self, axes: Axes | None, mark: Sample, scale: float) -> NDArray[np.float64] | None:
        if axes is None or axes.seq != mark.seq:
            self.counters["parts_lost"] += 1
            return None
        return np.array((axes.x, axes.y, axes.z), dtype=np.float64) * scale
