"""Commands to a running bench through a Unix socket: one JSON object a line, one answer each."""

import contextlib
import json
import socket
import threading
from collections.abc import Callable
from pathlib import Path

from sim_bus.bench.bench import Bench
from sim_bus.bench.client import LARGEST_BYTES, TIMEOUT_S, Answer
from sim_bus.bench.fault_switch import EVERYWHERE, FaultSwitch, effective_faults
from sim_bus.bench.unix_socket import listen_at


class BenchControl:
    """What a running bench can be asked.

    Parameters
    ----------
    bench : Bench
        The bench.
    stop : threading.Event
        Set by the command ``stop``.
    say : callable
        Called with a description of every change, for the truth log.
    """

    def __init__(self, bench: Bench, stop: threading.Event, say: Callable[[str], None]) -> None:
        self._bench, self._stop, self._say = bench, stop, say
        self._faults = FaultSwitch(bench)

    def __call__(self, request: Answer) -> Answer:
        """Do one command; what it cannot do comes back as ``{"error": ...}``."""
        do = request.get("do")
        commands: dict[object, Callable[[Answer], Answer]] = {
            "fault": self._fault,
            "faults": lambda _: {"faults": effective_faults(self._bench)},
            "start": self._start,
            "status": lambda _: self._status(),
            "stop": self._end,
        }
        command = commands.get(do)
        if command is None:
            return {
                "error": f"command {do!r} is unknown; wanted one of {', '.join(map(str, commands))}"
            }
        try:
            return command(request)
        except KeyError as error:
            return {"error": f"command {do!r}: lacks {error}"}
        except (TypeError, ValueError) as error:
            return {"error": str(error)}

    def _fault(self, request: Answer) -> Answer:
        kind, target = str(request["kind"]), str(request.get("target", EVERYWHERE))
        if not request["on"]:
            self._faults.switch_off(kind, target)
            self._say(f"fault {kind} off: {target}")
            return {"off": kind, "target": target}
        self._faults.switch_on(kind, target, request)
        self._say(f"fault {kind} on: {target}")
        return {"on": kind, "target": target}

    def _start(self, request: Answer) -> Answer:
        was_started = self._bench.elapsed_s is not None
        epoch_ns = self._bench.start(float(request.get("lead_s", 2.0)))
        if not was_started:
            self._say(f"scenario {self._bench.scenario.name} begins")
        return {
            "epoch_ns": epoch_ns, "elapsed_s": self._bench.elapsed_s, "was_started": was_started
        }  # fmt: skip

    def _status(self) -> Answer:
        active = [{"kind": f.kind, "target": f.target} for f in self._faults.active()]
        return {
            "elapsed_s": self._bench.elapsed_s,
            "faults": active,
            "counters": self._bench.counters(),
        }

    def _end(self, _: Answer) -> Answer:
        self._stop.set()
        return {"stopping": True}


def _not_yet(_: Answer) -> Answer:
    return {"error": "the bench is still opening its interfaces; ask again in a moment"}


class ControlServer:
    """Answers commands from its own thread; claims its place before the bench is opened.

    Parameters
    ----------
    path : Path
        The socket to make.
    answer : callable, optional
        From a request to its answer; until ``answer_with`` gives one, every request is refused.

    Raises
    ------
    DeviceNotFoundError
        If the socket cannot be made.
    RefusedError
        If another bench answers on it.
    """

    def __init__(self, path: Path, answer: Callable[[Answer], Answer] | None = None) -> None:
        self.path, self._answer = path, answer or _not_yet
        self._stop = threading.Event()
        self._listener = listen_at(path, "control socket")
        self._thread = threading.Thread(target=self._serve, name="control", daemon=True)
        self._thread.start()

    def answer_with(self, answer: Callable[[Answer], Answer]) -> None:
        """From now on, answer with this."""
        self._answer = answer

    def close(self) -> None:
        """End; may be called twice."""
        self._stop.set()
        self._thread.join(2.0)
        self._listener.close()
        self.path.unlink(missing_ok=True)

    def __enter__(self) -> "ControlServer":
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _serve(self) -> None:
        while not self._stop.is_set():
            with contextlib.suppress(TimeoutError, OSError):
                client, _ = self._listener.accept()
                with client:
                    client.settimeout(TIMEOUT_S)
                    self._talk(client)

    def _talk(self, client: socket.socket) -> None:
        with client.makefile("rb") as lines:
            line = lines.readline(LARGEST_BYTES)
            if not line:
                return
            try:
                request = json.loads(line)
                answer = self._answer(request) if isinstance(request, dict) else None
            except ValueError:
                answer = None
            reply = {"error": "wanted one JSON object in a line"} if answer is None else answer
            client.sendall(json.dumps(reply).encode() + b"\n")
