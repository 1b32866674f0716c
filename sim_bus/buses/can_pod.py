"""Simulated pods: the firmware's own C core between a simulated chip and a python-can bus."""

from typing import Any, Protocol

import can
import numpy as np
from can.interfaces.virtual import VirtualBus

from drivers.clock import Clock, SteadyStamps, read_both_ns
from sim_bus.buses.faults import FaultPlan, flip_bit_7
from sim_bus.buses.pod_core import PodCore
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.sim_chip import ChipSilentError

LONGEST_SLEEP_NS = 1_000_000_000


class PodBus(Protocol):
    """The part of ``can.BusABC`` that a pod uses."""

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next message, None if none came in time."""
        ...

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a message."""
        ...

    def shutdown(self) -> None:
        """Leave the bus."""
        ...


class SimCanBus(VirtualBus):
    """python-can's virtual bus with the stamps of the rig's clock.

    Parameters
    ----------
    channel : str
        Name of the bus within this process.
    clock : Clock
        The rig's clock: what is sent is stamped with it, s.
    **options
        Of python-can's virtual bus.

    Notes
    -----
    A bus of python-can's own ``virtual`` interface may join the same channel.
    """

    def __init__(self, channel: str, clock: Clock, **options: Any) -> None:
        super().__init__(channel=channel, preserve_timestamps=True, **options)
        self._clock = clock

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame, stamped now."""
        msg.timestamp = self._clock.now_ns() * 1e-9
        super().send(msg, timeout)


class SimPod:
    """One wing pod: chip, microcontroller with its own clock, CAN.

    Parameters
    ----------
    node : int
        Number on the bus, 0 to 15.
    chip : SimBno055
        Its sensor.
    bus : PodBus
        Any python-can bus; the pod shuts it down.
    clock : Clock
        The rig's clock.
    target : str
        Name under which faults find the pod.
    faults : FaultPlan
        What goes wrong.
    clock_ppm : float
        Error of the pod's own clock, 1e-6.
    local_start_us : int
        Reading of the pod's own clock when it is made.
    uid : bytes
        Twelve bytes of the microcontroller's unique id.
    """

    def __init__(
        self,
        node: int,
        chip: SimBno055,
        bus: PodBus,
        clock: Clock,
        *,
        target: str = "*",
        faults: FaultPlan | None = None,
        clock_ppm: float = 0.0,
        local_start_us: int = 0,
        uid: bytes = bytes(12),
    ) -> None:
        self.node, self.clock_ppm = node, clock_ppm
        self.sent = self.dropped = 0
        self._chip, self._bus, self._target = chip, bus, target
        self._faults = FaultPlan() if faults is None else faults
        self._start_ns = self._now_ns = self._due_ns = clock.now_ns()
        self._local_start_us = local_start_us
        self._uid, self._wants_reset = uid, False
        self._was_cut = self._heard = False
        self._clock, self._stamps = clock, SteadyStamps()
        self._core = PodCore(self, node=node, uid=uid)

    # The board that the C core runs on (``PodBoard``).

    def now_us(self) -> int:
        """Return the pod's own clock, microseconds."""
        return self._local_us(self._now_ns)

    def imu_read(self, register: int, length: int) -> bytes:
        """Return bytes of the chip, as its I2C bus delivers them."""
        self._sensor_bus()
        data = self._chip.read(register, length, self._now_ns)
        if self._faults.strikes("spike", self._target, self._now_ns):
            data = flip_bit_7(data, self._faults.rng)
        return data

    def imu_write(self, register: int, value: int) -> None:
        """Write one register of the chip."""
        self._sensor_bus()
        self._chip.write(register, bytes([value]), self._now_ns)

    def imu_recover(self) -> None:
        """Nine clock pulses; a stuck bus of the fault plan ends by its own time."""

    def can_send(self, mailbox: int, frame_id: int, data: bytes) -> bool:
        """Put a frame on the bus; a frame that a fault drops left the pod all the same."""
        self.sent += 1
        if self._faults.strikes("frame_drop", self._target, self._now_ns):
            self.dropped += 1
            return True
        message = can.Message(arbitration_id=frame_id, data=data, is_extended_id=False)
        self._bus.send(message)
        if self._faults.strikes("frame_duplicate", self._target, self._now_ns):
            self._bus.send(message)
        return True

    def store_node(self, node: int) -> bool:
        """Keep a new node number over a reset."""
        self.node = node
        return True

    def reset(self) -> None:
        """Take note that the pod asked for a reset."""
        self._wants_reset = True

    # What the rig calls.

    @property
    def due_ns(self) -> int:
        """When the pod next wants to be stepped, ns of the rig's clock."""
        return self._due_ns

    def step(self, t_ns: int) -> None:
        """Live until ``t_ns``: hear the bus, sample and send at every instant in between."""
        self._hear()
        while self._due_ns <= t_ns:
            self._now_ns = self._due_ns
            self._step_once()
        self._now_ns = t_ns
        # What was received may want an answer before the next sample.
        if self._heard:
            self._step_once()

    def close(self) -> None:
        """Switch the pod off; may be called twice."""
        self._core.close()
        self._bus.shutdown()

    def _step_once(self) -> None:
        self._heard = False
        if self._is_cut():
            self._due_ns = self._now_ns + 10_000_000
            return
        self._faults.apply_to_chip(self._chip, self._target, self._now_ns)
        is_off = self._faults.active("bus_off", self._target, self._now_ns) is not None
        if is_off and not self._core.is_bus_off:
            self._core.set_bus_off(True)
        rest_us = self._core.step()
        if self._wants_reset:
            self._wants_reset = False
            self._core.restart(self.node)
            rest_us = 0
        rest_ns = round(max(rest_us, 1) * 1000 / (1 + self.clock_ppm * 1e-6))
        self._due_ns = self._now_ns + min(rest_ns, LONGEST_SLEEP_NS)

    def _is_cut(self) -> bool:
        """Whether the pod is without power; it boots again afterwards."""
        is_cut = self._faults.active("pod_silent", self._target, self._now_ns) is not None
        if self._was_cut and not is_cut:
            self._core.restart(self.node, reset_cause=5)
        self._was_cut = is_cut
        return is_cut

    def _sensor_bus(self) -> None:
        for kind, error in (("nak", ChipSilentError), ("io_error", OSError)):
            if self._faults.strikes(kind, self._target, self._now_ns):
                raise error
        if self._faults.strikes("stuck_bus", self._target, self._now_ns):
            raise TimeoutError

    def _local_us(self, t_ns: int) -> int:
        elapsed_us = (t_ns - self._start_ns) * 1e-3 * (1 + self.clock_ppm * 1e-6)
        return self._local_start_us + int(np.floor(elapsed_us))

    def _hear(self) -> None:
        while True:
            message = self._bus.recv(0)
            if message is None:
                return
            if message.is_error_frame or self._is_cut():
                continue
            stamp_ns = round(message.timestamp * 1e9)
            if not self._start_ns <= stamp_ns <= self._now_ns + LONGEST_SLEEP_NS:
                # A real bus stamps on CLOCK_REALTIME; a pod's controller would on its own clock.
                stamp_ns = self._stamps.convert(stamp_ns, *read_both_ns(self._clock))
            self._heard = True
            self._core.receive(
                message.arbitration_id,
                bytes(message.data[:8]),
                self._local_us(stamp_ns),
                is_extended=message.is_extended_id,
                is_remote=message.is_remote_frame,
            )
