"""Errors of the application.

AvionicsError
|-- ConfigError      (also ValueError) a configuration that cannot fly
|-- DataSetError     a recorded data set that cannot be read
|-- RecordingError   a log that cannot be written or read
|   |-- OutputExistsError   an output file that is already there
|   `-- StorageError        a disk that is full or fails
|-- JoinError        a flight and a truth that do not belong together
`-- EstimatorError   an estimate that cannot be made
"""


class AvionicsError(Exception):
    """Base of everything the application raises on purpose."""


class ConfigError(AvionicsError, ValueError):
    """The configuration is wrong; the message names file, key and remedy."""


class DataSetError(AvionicsError):
    """A recorded data set is missing, empty or malformed; the message names file and field."""


class RecordingError(AvionicsError):
    """A log cannot be written or read."""


class OutputExistsError(RecordingError):
    """The output file is already there and overwriting was not asked for."""


class StorageError(RecordingError):
    """The disk is full or fails; what waits is written when it works again."""


class JoinError(AvionicsError):
    """A flight's log and the log of a truth cannot be put together."""


class EstimatorError(AvionicsError):
    """The estimator cannot work with what it was given."""
