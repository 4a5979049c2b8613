"""The endpoint at which a running graph is watched, lists its parameters and accepts changes of them.

It is a Unix-domain socket that only its owner can read; nothing listens on a network. A request is
one line of JSON, and so is its answer::

    {"verb": "list"}                                  {"graph": ..., "parameters": [...]}
    {"verb": "set", "settings": ["landing.w_c=0.1"]}  {"changes": [{"tick": 812, "path": ...}]}
    {"verb": "watch"}                                 {"graph": ..., "text": ..., "shape": {...}}
    {"verb": "control", "do": "back", "tick": 500}    {"paused": true, "tick": 500, "kept": [...]}

Where something is wrong the answer is ``{"error": text}``, with the report of a ``LoadError`` under
``report``. ``control`` pauses the run and goes back: ``do`` is ``pause``, ``go on`` (for ``ticks``, if
they are given), ``back`` (to the last snapshot up to ``tick``), ``play`` (at ``percent`` of real time)
or ``look``, and the answer is ``RunControl.about``. With the answer to ``watch`` comes the descriptor
of a window; see ``live.window``. A thread of its own answers; the control thread only looks into the
slot of ``LiveParameters`` once a tick.
"""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...files.problems import LoadError
from ..language.errors import AloftError
from ..loading.checking.parameters import adjust, entries
from ..running.live_parameters import LiveParameters
from ..running.memory import BoundGraph
from ..running.run_control import RunControl, refusal_of
from ..running.run_result import RunResult
from ..running.sink import Sink
from ..running.ticker import Ticker
from .window import Window, digest

LONGEST_REQUEST = 1 << 16
"""Bytes of one request."""
REQUEST_TIMEOUT = 5.0
"""The time that either side waits for the other [s]."""
START_TIME = 60.0
"""The time that somebody who watches waits for a run to start [s]."""
_LONGEST_PATH = 100  # bytes; the address of a Unix-domain socket has room for little more


class EndpointError(AloftError):
    """A running graph cannot be reached, or its endpoint cannot be opened."""


class ParameterEndpoint(Sink):
    """Answers requests about a graph while it runs; give it to a run as a sink.

    Args:
        path: of the socket; one that nobody answers any more is replaced.
        paused: whether the run begins paused, and waits at its end.

    Raises:
        EndpointError: another run answers there, or the socket cannot be made.
    """

    def __init__(self, path: Path, *, paused: bool = False) -> None:
        self.path = path
        self.control = RunControl(paused=paused)
        if len(str(path).encode()) > _LONGEST_PATH:
            raise EndpointError(f"the name of the socket {path} is too long")
        if path.exists():
            if answers(path):
                raise EndpointError(f"another run answers at {path}; give this one another name")
            path.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.bind(str(path))
            path.chmod(0o600)
            self._socket.listen(4)
        except OSError as error:
            self._socket.close()
            raise EndpointError(f"no socket at {path}: {error.strerror or error}") from error
        self._thread: threading.Thread | None = None
        self._closing = False
        self._window = Window()

    def open(self, bound: BoundGraph) -> None:
        """Begin to answer."""
        self._window.open(bound)
        self.control.open(bound)
        self._about = _about(bound) | {"refusal": refusal_of(bound)}
        self._thread = threading.Thread(
            target=self._serve, args=(bound.parameters, bound.graph.name), daemon=True
        )
        self._thread.start()

    def watch_ticker(self, ticker: Ticker) -> None:
        """Let the run be watched, and paused."""
        self._window.watch_ticker(ticker)
        control, window = self.control, self._window
        control.watch_ticker(ticker)
        control.on_change = lambda: window.turn(paused=control.paused)

    def record(self, tick: int) -> None:
        """Renew the window and keep a snapshot, if it is time; changes of parameters are recorded
        elsewhere."""
        self._window.record(tick)
        self.control.record(tick)

    def close(self) -> None:
        """Answer no more."""
        self._closing = True
        self.control.close()
        self._window.close()
        self.path.unlink(missing_ok=True)
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)  # wakes the thread
        self._socket.close()
        if self._thread is not None:
            self._thread.join(REQUEST_TIMEOUT)

    def finish(self, result: RunResult) -> list[str]:
        """Tell those who watch why the run has ended."""
        return self._window.finish(result)

    def _serve(self, parameters: LiveParameters, graph: str) -> None:
        while not self._closing:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            with connection, suppress(OSError):  # the client may have closed the connection
                connection.settimeout(REQUEST_TIMEOUT)
                request = _read_line(connection)
                answer = _answer(request, parameters, graph, self._watch, self.control)
                if "shape" in answer:
                    socket.send_fds(connection, [b" "], [self._window.descriptor])
                connection.sendall(json.dumps(answer).encode() + b"\n")

    def _watch(self) -> dict[str, Any]:
        if self._window.shape is None:
            return {"starting": True}
        return {**self._about, "shape": asdict(self._window.shape)}


def _about(bound: BoundGraph) -> dict[str, Any]:
    """Return the description from which a viewer loads the same graph."""
    graph = bound.graph
    return {
        "graph": graph.name,
        "file": str(Path(graph.file).absolute()) if graph.file else "",
        "text": graph.text,
        "overrides": dict(graph.overrides),
        "clock": bound.clock.kind,
        "process": os.getpid(),
        "digest": digest(bound.memory.bus.layout, graph),
    }


def _answer(
    request: bytes,
    parameters: LiveParameters,
    graph: str,
    watch: Callable[[], dict[str, Any]],
    control: RunControl,
) -> dict[str, Any]:
    """Answer one request; the answer to an invalid request is an error."""
    try:
        message = json.loads(request)
        verb = message["verb"]
        if verb == "list":
            listed = []
            for path, block in parameters.blocks.items():
                listed += [asdict(entry) for entry in entries({path: block})]
                time.sleep(0)  # gives the processor to the control thread if it wants to run
            return {"graph": graph, "parameters": listed}
        if verb == "set":
            adjustment = adjust(parameters.blocks, [str(text) for text in message["settings"]])
            parameters.submit(adjustment)
            return {"changes": [asdict(change) for change in adjustment.changes()]}
        if verb == "watch":
            return watch()
        if verb == "control":
            return _control(message, control)
        return {"error": f"there is no verb {verb!r}"}
    except LoadError as error:
        return {"error": str(error), "report": error.report.as_json()}
    except AloftError as error:
        return {"error": str(error)}
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        return {"error": f"not a request: {error}"}


def _control(message: Mapping[str, Any], control: RunControl) -> dict[str, Any]:
    """Control the run as requested, and return its state. Raises ``AloftError``."""
    do, ticks = message["do"], message.get("ticks")
    if do == "pause":
        control.pause()
    elif do == "go on":
        control.go_on(None if ticks is None else int(ticks))
    elif do == "back":
        control.go_back(int(message["tick"]))
    elif do == "play":
        control.play(int(message["percent"]))
    elif do != "look":
        raise AloftError(f"a run does not {do!r}; it can pause, go on, back, play and look")
    return control.about()


def _read_line(connection: socket.socket) -> bytes:
    """Read until the end of a line or of the connection. Raises ``OSError``."""
    parts: list[bytes] = []
    size = 0
    while size < LONGEST_REQUEST and not (parts and parts[-1].endswith(b"\n")):
        part = connection.recv(4096)
        if not part:
            break
        parts.append(part)
        size += len(part)
    return b"".join(parts)


def ask(path: Path, request: Mapping[str, Any]) -> dict[str, Any]:
    """Send a request to the graph that listens at ``path``, and return its answer.

    Raises:
        EndpointError: nobody answers there, or the request was refused; the text has the reason.
    """
    answer, descriptors = _exchange(path, request)
    for descriptor in descriptors:
        os.close(descriptor)
    return answer


def ask_to_watch(path: Path) -> tuple[dict[str, Any], int]:
    """Return the description of the graph that listens at ``path``, and the descriptor of its
    window.

    Waits for a graph that is only starting.

    Raises:
        EndpointError: nobody answers there, or it cannot be watched; the text has the reason.
    """
    end = time.monotonic() + START_TIME
    while True:
        try:
            answer, descriptors = _exchange(path, {"verb": "watch"})
        except EndpointError as error:  # one that compiles its kernels may be slow to answer
            if not isinstance(error.__cause__, TimeoutError) or time.monotonic() > end:
                raise
            continue
        if len(descriptors) == 1:
            return answer, descriptors[0]
        if time.monotonic() > end:
            raise EndpointError(f"the run at {path} does not start, or cannot share its memory")
        time.sleep(0.1)


def _connected(path: Path) -> socket.socket:
    """Connect to the graph that listens at ``path``.

    Linux refuses at once (EAGAIN) a connection that would have to wait behind others, where the socket has a
    timeout, so the wait is made here.

    Raises:
        TimeoutError: it has not taken the connection within ``REQUEST_TIMEOUT``.
        OSError: nobody listens there.
    """
    end = time.monotonic() + REQUEST_TIMEOUT
    while True:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.settimeout(REQUEST_TIMEOUT)
            connection.connect(str(path))
            return connection
        except BlockingIOError:
            connection.close()
            if time.monotonic() > end:
                raise TimeoutError("too many wait for it") from None
            time.sleep(0.02)
        except BaseException:
            connection.close()
            raise


def _exchange(path: Path, request: Mapping[str, Any]) -> tuple[dict[str, Any], list[int]]:
    descriptors: list[int] = []
    try:
        with _connected(path) as connection:
            connection.sendall(json.dumps(request).encode() + b"\n")
            begun, descriptors, _, _ = socket.recv_fds(connection, 4096, 1)
            with connection.makefile("rb") as file:
                line = begun if begun.endswith(b"\n") else begun + file.readline()
                answer: dict[str, Any] = json.loads(line)
    except (OSError, ValueError) as error:
        for descriptor in descriptors:
            os.close(descriptor)
        raise EndpointError(f"no running graph answers at {path} ({error})") from error
    if "error" in answer:
        raise EndpointError(str(answer["error"]))
    return answer, descriptors


def answers(path: Path) -> bool:
    """Return whether some run listens at ``path``."""
    try:
        _connected(path).close()
    except TimeoutError:
        return True  # it is busy
    except OSError:
        return False
    return True


def set_parameters(path: Path, settings: Sequence[str]) -> list[dict[str, Any]]:
    """Change parameters of the graph that listens at ``path``, such as ``["landing.w_c=0.1"]``.

    Returns:
        The changes that were made, as the attributes of each ``ParameterChange``.

    Raises:
        EndpointError: nobody answers there, or a setting was refused; the text has the reason.
    """
    changes: list[dict[str, Any]] = ask(path, {"verb": "set", "settings": list(settings)})[
        "changes"
    ]
    return changes
