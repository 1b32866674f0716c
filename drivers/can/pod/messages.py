"""The messages of ``pod.dbc`` as Python values."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

LAYOUT_VERSION: Final = 1
NODES: Final = 16
# What the firmware takes as RATE_HZ, whole; pod_config.c.
RATE_MAX_HZ: Final = 200
SYNC_ID: Final = 0x080
FOLLOW_UP_ID: Final = 0x081
NOT_SYNCHRONISED: Final = -32768


class Kind(IntEnum):
    """Identifier of a message of pod 0; pod n adds n."""

    GYRO = 0x100
    ACCEL = 0x110
    MAG = 0x120
    SAMPLE = 0x130
    SYNC_REPLY = 0x180
    CONFIG_REQUEST = 0x200
    CONFIG_REPLY = 0x210
    STATUS = 0x280
    COUNTERS = 0x290
    IDENTITY = 0x300


class ConfigKey(IntEnum):
    """What a configuration request is about."""

    RATE_HZ = 1
    GYRO_RANGE_DPS = 2
    GYRO_BANDWIDTH_HZ = 3
    STREAMS = 4
    MODE = 5
    SAMPLING = 6
    NODE = 7
    RESET = 8
    IDENTIFY = 9
    EXTERNAL_CRYSTAL = 10


class ConfigResult(IntEnum):
    """How a configuration request ended."""

    DONE = 0
    UNKNOWN_KEY = 1
    OUT_OF_RANGE = 2
    CHIP_DIFFERS = 3
    BUSY = 4
    NOT_NOW = 5


STATE_NAMES: Final = ("starting", "running", "chip missing", "recovering", "refused")
REFUSAL_NAMES: Final = ("none", "duplicate node", "wrong layout version", "no node number")
RESET_CAUSE_NAMES: Final = ("unknown", "power on", "pin", "watchdog", "software", "brown-out")
COUNTER_NAMES: Final = (
    ("nak", "bus_timeout", "bus_recovery"),
    ("spike", "frozen", "reinit"),
    ("can_tx_dropped", "can_bus_off", "can_rx_bad"),
    ("watchdog_reset", "sample_late", "sample_missed"),
    ("samples_sent", "config_refused"),
)


@dataclass(frozen=True, slots=True)
class Sync:
    """First step of the time sync."""

    seq: int
    layout: int = LAYOUT_VERSION
    trigger: bool = False


@dataclass(frozen=True, slots=True)
class FollowUp:
    """Second step: when the sync left, microseconds of the master's clock."""

    seq: int
    t_sync_us: int


@dataclass(frozen=True, slots=True)
class Axes:
    """Three words of one sensor as its registers hold them; ``kind`` is GYRO, ACCEL or MAG."""

    kind: Kind
    node: int
    seq: int
    x: int
    y: int
    z: int


@dataclass(frozen=True, slots=True)
class Sample:
    """What closes a sample: its time on the pod's clock, modulo 2^24 us, and its parts."""

    node: int
    seq: int
    t_local_us: int
    scale: int = 0
    has_accel: bool = False
    has_mag: bool = False
    synced: bool = False
    triggered: bool = False
    repeated: bool = False


@dataclass(frozen=True, slots=True)
class SyncReply:
    """When a sync reached the pod, on its clock modulo 2^32 us."""

    node: int
    seq: int
    t_local_us: int
    error_us: int = NOT_SYNCHRONISED


@dataclass(frozen=True, slots=True)
class ConfigRequest:
    """One setting to change or one thing to do."""

    node: int
    token: int
    key: int
    value: int


@dataclass(frozen=True, slots=True)
class ConfigReply:
    """The answer, with the value as it reads back."""

    node: int
    token: int
    key: int
    value: int
    result: int


@dataclass(frozen=True, slots=True)
class Status:
    """The pod's state; ``calibration`` is CALIB_STAT as the chip has it."""

    node: int
    uptime_s: int
    mode: int
    state: int
    calibration: int
    temperature_degc: int
    chip_error: int


@dataclass(frozen=True, slots=True)
class Counters:
    """One page of counters, named by ``COUNTER_NAMES[page]``."""

    node: int
    page: int
    values: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Identity:
    """One part of a pod's identity: versions and causes (part 0) or six bytes of a unique id."""

    node: int
    part: int
    payload: bytes


PodMessage = (
    Sync
    | FollowUp
    | Axes
    | Sample
    | SyncReply
    | ConfigRequest
    | ConfigReply
    | Status
    | Counters
    | Identity
)
