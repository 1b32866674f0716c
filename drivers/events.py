"""What a driver wants remembered: things that happened once, as opposed to counters."""

import logging
from collections import deque
from dataclasses import dataclass
from typing import Literal

log = logging.getLogger(__name__)

Level = Literal["info", "warning", "error"]
_LEVELS = {"info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened once.

    Attributes
    ----------
    t_ns : int
        When, ns of the steady clock.
    source : str
        "pod 1", "can vcan0", "camera root", ...
    level : str
        "info", "warning" or "error".
    message : str
        What happened, one line.
    """

    t_ns: int
    source: str
    level: Level
    message: str


def named_once(source: str, message: str) -> str:
    """Return a message without the name of its source, which stands beside it in an event.

    Errors name the thing that failed; what reports them names it again.
    """
    return message.replace(f"{source}: ", "")


class EventList:
    """The last events of one driver, until somebody takes them."""

    def __init__(self, keep: int = 256) -> None:
        self._events: deque[Event] = deque(maxlen=keep)

    def add(self, t_ns: int, source: str, level: Level, message: str) -> None:
        """Remember one event and log it."""
        message = named_once(source, message)
        log.log(_LEVELS[level], "%s: %s", source, message)
        self._events.append(Event(t_ns, source, level, message))

    def take(self) -> list[Event]:
        """Return the events since the last call, oldest first, and forget them."""
        taken = []
        while self._events:
            taken.append(self._events.popleft())
        return taken
