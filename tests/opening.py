"""The one bus of some pods, opened on this machine's devices as ``avionics run`` opens it."""

from collections.abc import Iterable

from avionics.config import Pod
from avionics.flight.assemble import imu_sources, mounts_of
from avionics.flight.hardware import HardwareBuses
from drivers.clock import Clock, SteadyClock
from drivers.interfaces import ImuSource


def open_imus(pods: Iterable[Pod], clock: Clock | None = None) -> ImuSource:
    """Return the source of the bus that all of the pods are on, opened."""
    clock = SteadyClock() if clock is None else clock
    buses = HardwareBuses(clock)
    (source,) = imu_sources(mounts_of(pods, buses), buses, clock)
    try:
        source.open()
    except BaseException:
        source.close()
        raise
    return source
