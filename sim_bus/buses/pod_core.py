"""The firmware's C core as a Python object: simulated pods run the code that flies."""

import ctypes
from collections.abc import Callable
from typing import Any, Protocol

from drivers.errors import BusTimeoutError, DriverError
from sim_bus.buses.pod_library import (
    Calls,
    CanSend,
    ImuRead,
    ImuRecover,
    ImuWrite,
    NowUs,
    Reset,
    StoreNode,
    load_library,
)
from sim_bus.chip.sim_chip import ChipSilentError

UID_BYTES = 12
NODE_NONE = 0xFF
_DONE, _REFUSED, _TIMED_OUT = 0, 1, 2


class PodBoard(Protocol):
    """What a pod's board does for the core: the firmware's ``pod_hal_t`` in Python."""

    def now_us(self) -> int:
        """Return the pod's own clock, microseconds."""
        ...

    def imu_read(self, register: int, length: int) -> bytes:
        """Return ``length`` bytes of the BNO055; a ``DriverError`` or a silent chip is a NAK."""
        ...

    def imu_write(self, register: int, value: int) -> None:
        """Write one register of the BNO055; raises as ``imu_read``."""
        ...

    def imu_recover(self) -> None:
        """Free a stuck sensor bus."""
        ...

    def can_send(self, mailbox: int, frame_id: int, data: bytes) -> bool:
        """Put a frame into a mailbox (0 data, 1 replies, 2 status); False if it is busy."""
        ...

    def store_node(self, node: int) -> bool:
        """Keep the node number over a reset; False if it cannot be kept."""
        ...

    def reset(self) -> None:
        """Take note that the pod asked for a reset; call ``PodCore.restart`` afterwards."""
        ...


class PodCore:
    """One pod running the firmware's core.

    Parameters
    ----------
    board : PodBoard
        Its sensor, its clock and its bus.
    node : int
        Number on the bus, 0 to 15; ``NODE_NONE`` for a pod without one.
    uid : bytes, length 12
        Unique id of the microcontroller.
    reset_cause : int
        Value of ``Identity.reset_cause`` in ``pod.dbc``; 1 = power on.

    Raises
    ------
    DriverError
        If there is no C compiler, or the firmware's sources do not compile.
    """

    def __init__(
        self, board: PodBoard, *, node: int, uid: bytes = bytes(UID_BYTES), reset_cause: int = 1
    ) -> None:
        if len(uid) != UID_BYTES:
            msg = f"pod {node}: unique id of {len(uid)} bytes, expected {UID_BYTES}"
            raise ValueError(msg)
        self._library = load_library()
        self._board = board
        self._failure: BaseException | None = None
        # The library keeps the function pointers, so the closures must outlive it.
        self._calls = self._make_calls()
        self._handle: int | None = self._library.pod_host_new(
            ctypes.byref(self._calls), node, uid, reset_cause, 0
        )

    def _make_calls(self) -> Calls:
        board, guard = self._board, self._guard

        def imu_read(register: int, data: Any, length: int) -> int:
            for index, value in enumerate(board.imu_read(register, length)):
                data[index] = value
            return _DONE

        def imu_write(register: int, value: int) -> int:
            board.imu_write(register, value)
            return _DONE

        def imu_recover() -> int:
            board.imu_recover()
            return _DONE

        def can_send(mailbox: int, frame_id: int, data: Any, length: int) -> int:
            return _DONE if board.can_send(mailbox, frame_id, bytes(data[:length])) else _REFUSED

        def store_node(node: int) -> int:
            return _DONE if board.store_node(node) else _REFUSED

        return Calls(
            NowUs(guard(board.now_us)),
            ImuRead(guard(imu_read)),
            ImuWrite(guard(imu_write)),
            ImuRecover(guard(imu_recover)),
            CanSend(guard(can_send)),
            StoreNode(guard(store_node)),
            Reset(guard(board.reset)),
        )

    def _guard(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return ``call`` with bus errors as answers; others are kept and raised by ``step``."""

        def guarded(*arguments: Any) -> Any:
            try:
                return call(*arguments)
            except (BusTimeoutError, TimeoutError):
                return _TIMED_OUT
            except (DriverError, ChipSilentError, OSError):
                return _REFUSED
            except BaseException as error:  # noqa: BLE001 - must not unwind through C; step raises it
                self._failure = error
                return _REFUSED

        return guarded

    def receive(
        self,
        frame_id: int,
        data: bytes,
        received_us: int,
        *,
        is_extended: bool = False,
        is_remote: bool = False,
    ) -> bool:
        """Hand over a frame from the bus; False if the pod had no room for it.

        Parameters
        ----------
        frame_id : int
            Identifier.
        data : bytes
            Payload, at most 8 bytes.
        received_us : int
            The pod's own clock when the frame ended, microseconds.
        is_extended, is_remote : bool
            Kind of the frame.
        """
        return bool(
            self._library.pod_host_receive(
                self._live(), frame_id, is_extended, is_remote, data, len(data), received_us
            )
        )

    def step(self) -> int:
        """Do what is due and return how long nothing else will be, microseconds."""
        rest_us = int(self._library.pod_host_step(self._live()))
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure
        return rest_us

    def restart(self, node: int, *, reset_cause: int = 4, watchdog_resets: int = 0) -> None:
        """Start the pod over, as after a reset; 4 = software, 3 = watchdog, 5 = brown-out."""
        self._library.pod_host_restart(self._live(), node, reset_cause, watchdog_resets)

    def set_bus_off(self, is_bus_off: bool) -> None:
        """Let the CAN controller leave the bus; the core rejoins after its own wait."""
        self._library.pod_host_set_bus_off(self._live(), is_bus_off)

    @property
    def is_bus_off(self) -> bool:
        """Whether the controller is off the bus."""
        return bool(self._library.pod_host_is_bus_off(self._live()))

    @property
    def state(self) -> int:
        """State as in the status frame: 1 = running, 4 = refused."""
        return int(self._library.pod_host_state(self._live()))

    @property
    def refusal(self) -> int:
        """Refusal as in the identity frame; 0 = none."""
        return int(self._library.pod_host_refusal(self._live()))

    @property
    def is_synced(self) -> bool:
        """Whether the pod knows the master's time."""
        return bool(self._library.pod_host_is_synced(self._live()))

    def master_us(self, local_us: int) -> int:
        """Return the master's time at ``local_us`` of the pod's clock, both microseconds."""
        return int(self._library.pod_host_master_us(self._live(), local_us))

    def digest(self) -> int:
        """Return a hash of the pod's state without its counters."""
        return int(self._library.pod_host_digest(self._live()))

    def _live(self) -> int:
        if self._handle is None:
            msg = "the pod's core is closed"
            raise ValueError(msg)
        return self._handle

    def close(self) -> None:
        """Free the pod; may be called twice."""
        if self._handle is not None:
            self._library.pod_host_free(self._handle)
            self._handle = None
