"""``open_spi``: one chip select of an SPI bus through spidev, with advice if it fails."""

import errno
from typing import Any

from drivers.errors import DeviceNotFoundError
from drivers.reopening import ReopeningSpi


def open_spi(bus: int, device: int, *, speed_hz: int, mode: int) -> ReopeningSpi:
    """Open ``/dev/spidev<bus>.<device>``.

    Parameters
    ----------
    bus, device : int
        Number of the bus and of the chip select on it.
    speed_hz : int
        Clock, Hz; the controller takes the next lower one that it has.
    mode : int
        Polarity and phase of the clock, 0 to 3.

    Raises
    ------
    DeviceNotFoundError
        If the package ``spidev`` is missing, or the node is or may not be opened; the message
        names the remedy.
    """
    node = f"/dev/spidev{bus}.{device}"
    try:
        import spidev  # noqa: PLC0415 (an optional package, for Linux alone)
    except ImportError as error:
        msg = f"{node}: the package spidev is not installed; `pip install 'wing-avionics[spi]'`"
        raise DeviceNotFoundError(msg) from error

    def opened() -> Any:
        line = spidev.SpiDev()
        line.open(bus, device)
        try:
            line.mode = mode
            line.max_speed_hz = speed_hz
        except BaseException:
            line.close()
            raise
        return line

    try:
        return ReopeningSpi(opened)
    except OSError as error:
        raise DeviceNotFoundError(_advice(node, error)) from error


def _advice(node: str, error: OSError) -> str:
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return (
            f"{node} does not exist; enable SPI on this board (raspi-config, jetson-io or an "
            "overlay), `modprobe spidev`, and see `ls /dev/spidev*` for bus and device"
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"no permission for {node}; add the user to the group spi"
    return f"{node} does not open: {error.strerror} (errno {error.errno})"
