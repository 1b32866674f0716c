"""Sets one pod over CAN, one key after another, and checks what it reads back."""

from collections import Counter
from collections.abc import Mapping

from drivers.can.pod.messages import ConfigKey, ConfigReply, ConfigRequest, ConfigResult
from drivers.events import EventList

RESEND_NS = 250_000_000
ATTEMPTS = 8


class PodConfigurator:
    """Asks one pod for a list of settings; starts again when the pod restarts.

    Parameters
    ----------
    node : int
        The pod's number on the bus.
    name : str
        What messages call it.
    wanted : mapping of ConfigKey to int
        Settings, sent in this order.
    events : EventList
        Takes the refusals as events.

    Attributes
    ----------
    refused : list of str
        What the pod did not take since it was asked for everything, and what it answered.
    """

    def __init__(
        self, node: int, name: str, wanted: Mapping[ConfigKey, int], events: EventList
    ) -> None:
        self.counters: Counter[str] = Counter()
        self._node = node
        self._name = name
        self._wanted = dict(wanted)
        self._events = events
        self._token = 0
        self.restart()

    def restart(self) -> None:
        """Ask for everything again."""
        self.refused: list[str] = []
        self._left = list(self._wanted.items())
        self._due_ns = 0
        self._attempts = 0

    @property
    def is_done(self) -> bool:
        """Whether the pod has answered every request, or none within all attempts."""
        return not self._left

    def due(self, now_ns: int) -> ConfigRequest | None:
        """Return the request to send now, if any."""
        if not self._left or now_ns < self._due_ns:
            return None
        key, value = self._left[0]
        if self._attempts >= ATTEMPTS:
            self.counters["config_unanswered"] += 1
            self._say(now_ns, f"no answer to the request {key.name} = {value}; it flies as it is")
            self._left = []
            return None
        if self._attempts == 0:
            self._token = (self._token + 1) % 256
        self._attempts += 1
        self._due_ns = now_ns + RESEND_NS
        self.counters["config_requests"] += 1
        return ConfigRequest(self._node, self._token, key, value)

    def on_reply(self, reply: ConfigReply, now_ns: int) -> None:
        """Take an answer; goes on to the next setting."""
        if not self._left or reply.token != self._token or reply.key != self._left[0][0]:
            self.counters["config_strays"] += 1
            return
        if reply.result == ConfigResult.BUSY:
            return
        key, value = self._left.pop(0)
        self._attempts = 0
        self._due_ns = now_ns
        if reply.result != ConfigResult.DONE or reply.value != value:
            self.counters["config_refused"] += 1
            known = {r.value: r.name for r in ConfigResult}
            result = known.get(reply.result, str(reply.result))
            self.refused.append(f"{key.name} = {value}: {result}, reads back {reply.value}")
            self._say(now_ns, self.refused[-1])

    def _say(self, t_ns: int, message: str) -> None:
        self._events.add(t_ns, self._name, "warning", message)
