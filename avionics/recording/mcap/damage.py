"""What could not be read of a log."""

from dataclasses import dataclass


@dataclass(slots=True)
class Damage:
    """What a scan had to leave out.

    Attributes
    ----------
    truncated : bool
        The file was cut or never closed.
    damaged_chunks : int
        Chunks whose bytes do not match their checksum.
    skipped_bytes : int
        Bytes between the last good record and the next one that could be found.
    undecodable : int
        Messages that their schema cannot decode.
    missing_messages : int
        Messages that a finished log's own statistics count beyond those found.
    damaged_attachments : int
        Attachments whose bytes do not match their checksum.
    """

    truncated: bool = False
    damaged_chunks: int = 0
    skipped_bytes: int = 0
    undecodable: int = 0
    missing_messages: int = 0
    damaged_attachments: int = 0

    @property
    def is_any(self) -> bool:
        """Whether anything had to be left out."""
        return self != Damage()

    def text(self) -> str:
        """Return it as one plain line."""
        if not self.is_any:
            return "the log is complete and undamaged"
        counts = {
            "damaged chunks": self.damaged_chunks,
            "unreadable bytes": self.skipped_bytes,
            "messages that do not decode": self.undecodable,
            "messages missing from the middle": self.missing_messages,
            "damaged attachments": self.damaged_attachments,
        }
        found = ["cut, or never closed"] if self.truncated else []
        found += [f"{what}: {count}" for what, count in counts.items() if count]
        return "damage: " + "; ".join(found)
