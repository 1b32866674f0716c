"""Errors of the drivers.

DriverError
|-- DeviceNotFoundError   nothing, or the wrong thing, answers
|-- BusError              the bus failed
|   `-- BusTimeoutError   (also TimeoutError) no answer in time
`-- FrameFormatError      an answer or frame that does not decode
"""


class DriverError(Exception):
    """Base of everything a driver raises on purpose."""


class DeviceNotFoundError(DriverError):
    """Nothing answers where the device should be, or something else does."""


class BusError(DriverError):
    """The bus or its adapter failed."""


class BusTimeoutError(BusError, TimeoutError):
    """No answer in time."""


class FrameFormatError(DriverError):
    """An answer or a frame does not have the expected form."""
