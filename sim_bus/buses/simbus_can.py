"""python-can interface ``simbus``: a simulated CAN bus that several processes share.

``can.Bus(interface="simbus", channel="wing")`` joins it; ``can_logger -i simbus -c wing`` and
``can_viewer`` do too. The first to join serves the others from a thread; when it leaves, the next
takes over. ``python -m sim_bus.buses.simbus_can wing`` serves and does nothing else.
"""

import errno
import select
import socket
import struct
import sys
import time
from collections import deque
from typing import Any, Final

import can
from can.typechecking import AutoDetectedConfig

from sim_bus.buses.simbus_hub import LARGEST_PACKET, WELCOME, Hub, socket_path

JOIN_TIMEOUT_S: Final = 2.0
_HEAD: Final = struct.Struct("<dIBB")
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
_FD, _BRS, _ESI = 1, 2, 4


def pack(message: can.Message) -> bytes:
    """Return a message as one packet of the bus."""
    identifier = message.arbitration_id
    identifier |= _EXTENDED * message.is_extended_id
    identifier |= _REMOTE * message.is_remote_frame | _ERROR * message.is_error_frame
    flags = _FD * message.is_fd | _BRS * message.bitrate_switch
    flags |= _ESI * message.error_state_indicator
    head = _HEAD.pack(message.timestamp, identifier, message.dlc, flags)
    return head + bytes(message.data)


def unpack(packet: bytes, channel: str) -> can.Message:
    """Return the message in a packet."""
    timestamp, identifier, dlc, flags = _HEAD.unpack_from(packet)
    return can.Message(
        timestamp=timestamp,
        arbitration_id=identifier & 0x1FFF_FFFF,
        is_extended_id=bool(identifier & _EXTENDED),
        is_remote_frame=bool(identifier & _REMOTE),
        is_error_frame=bool(identifier & _ERROR),
        dlc=dlc,
        data=packet[_HEAD.size :],
        is_fd=bool(flags & _FD),
        bitrate_switch=bool(flags & _BRS),
        error_state_indicator=bool(flags & _ESI),
        channel=channel,
    )


class SimbusBus(can.BusABC):
    """One member of a simulated bus.

    Parameters
    ----------
    channel : str
        Name of the bus, or the path of its socket.
    receive_own_messages : bool
        Whether what is sent comes back, too.
    **kwargs
        Filters and what else ``can.BusABC`` knows; a bit rate is accepted and ignored.

    Raises
    ------
    can.CanInitializationError
        If the bus can be neither joined nor served.
    """

    def __init__(
        self, channel: str = "wing", receive_own_messages: bool = False, **kwargs: Any
    ) -> None:
        self.channel_info = f"simbus {channel}"
        self._channel = channel
        self._path = socket_path(channel)
        self._echoes: deque[can.Message] | None = deque() if receive_own_messages else None
        self._hub: Hub | None = None
        self._socket = self._join()
        super().__init__(channel=channel, **kwargs)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a message to all other members.

        Raises
        ------
        can.CanOperationError
            If no hub takes it.
        """
        if not msg.timestamp:
            msg.timestamp = time.time()
        packet = pack(msg)
        try:
            self._socket.send(packet)
        except OSError:
            self._rejoin()
            self._socket.send(packet)
        if self._echoes is not None:
            echo = unpack(packet, self._channel)
            echo.is_rx = False
            self._echoes.append(echo)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self._echoes:
            return self._echoes.popleft(), False
        readable, _, _ = select.select([self._socket], [], [], timeout)
        if not readable:
            return None, False
        try:
            packet = self._socket.recv(LARGEST_PACKET)
        except OSError:
            packet = b""
        if not packet:
            self._rejoin()
            return None, False
        return unpack(packet, self._channel), False

    def fileno(self) -> int:
        """Return the descriptor to wait on."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Leave the bus; may be called twice."""
        super().shutdown()
        self._socket.close()
        if self._hub is not None:
            self._hub.close()
            self._hub = None

    def _join(self) -> socket.socket:
        give_up = time.monotonic() + JOIN_TIMEOUT_S
        while True:
            endpoint = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            endpoint.settimeout(JOIN_TIMEOUT_S)
            try:
                endpoint.connect(str(self._path))
                if endpoint.recv(LARGEST_PACKET) != WELCOME:
                    raise ConnectionRefusedError(errno.ECONNREFUSED, "no hub of this version")
            except OSError as error:
                endpoint.close()
                if time.monotonic() > give_up:
                    msg = f"simbus {self._channel}: {self._path}: {error}"
                    raise can.CanInitializationError(msg) from error
                self._serve()
            else:
                endpoint.settimeout(None)
                return endpoint

    def _serve(self) -> None:
        """Become the hub, unless another one is about to."""
        try:
            self._hub = Hub(self._path)
        except BlockingIOError:
            time.sleep(0.01)
        except OSError as error:
            msg = f"simbus {self._channel}: {self._path}: {error}"
            raise can.CanInitializationError(msg) from error

    def _rejoin(self) -> None:
        """Find or make another hub after the last one left."""
        self._socket.close()
        try:
            self._socket = self._join()
        except can.CanInitializationError as error:
            raise can.CanOperationError(str(error)) from error

    @staticmethod
    def _detect_available_configs() -> list[AutoDetectedConfig]:
        return [
            {"interface": "simbus", "channel": path.stem}
            for path in sorted(socket_path("x").parent.glob("*.sock"))
        ]


def main(arguments: list[str]) -> int:
    """Serve the channels named on the command line until interrupted."""
    hubs = [Hub(socket_path(channel)) for channel in arguments or ["wing"]]
    try:
        for hub in hubs:
            hub.wait()
    except KeyboardInterrupt:
        pass
    finally:
        for hub in hubs:
            hub.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
