"""The log: MCAP with protobuf, safe from a kill, read back record by record."""

from avionics.recording.mcap.damage import Damage
from avionics.recording.mcap.logfile import appearing_whole
from avionics.recording.reader import LoggedRecord, LogReader
from avionics.recording.recorder import Recorder
from avionics.recording.recover import Recovery, recover
from avionics.recording.writer import LogWriter
from avionics.records import EncodedFrame

__all__ = [
    "Damage",
    "EncodedFrame",
    "LogReader",
    "LogWriter",
    "LoggedRecord",
    "Recorder",
    "Recovery",
    "appearing_whole",
    "recover",
]
