"""The socket at which a running graph is asked for its parameters."""

import json
import socket
import stat
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.sources import SineWave
from aloft.runtime.live import parameter_endpoint
from aloft.runtime.live.parameter_endpoint import (
    EndpointError,
    ParameterEndpoint,
    answers,
    ask,
    set_parameters,
)
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing import BlockUse, checked_graph


@pytest.fixture
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("s") / "run.sock"


@pytest.fixture
def running(path: Path) -> Iterator[BoundGraph]:
    """A graph that ticks as fast as it can until the test is over."""
    bound = BoundGraph(
        checked_graph({"wave": BlockUse(SineWave), "gain": BlockUse(Gain, wires={"u": "wave.y"})})
    )
    executor = Executor(bound, log=False, sinks=[ParameterEndpoint(path)])
    thread = threading.Thread(target=executor.run)
    thread.start()
    yield bound
    bound.clock.stop_reason = "the test is over"
    thread.join(60.0)
    assert not path.exists()


def send(path: Path, data: bytes) -> dict[str, str]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.connect(str(path))
        connection.sendall(data)
        connection.shutdown(socket.SHUT_WR)
        answer: dict[str, str] = json.loads(connection.makefile().readline())
    return answer


def test_list_and_set(running: BoundGraph, path: Path) -> None:
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    before = {e["path"]: e["value"] for e in ask(path, {"verb": "list"})["parameters"]}
    assert before["gain.gain"] == 1.0
    (change,) = set_parameters(path, ["gain.gain=0.1"])
    assert (change["path"], change["old"], change["new"]) == ("gain.gain", 1.0, 0.1)
    after = {e["path"]: e["value"] for e in ask(path, {"verb": "list"})["parameters"]}
    assert after == {**before, "gain.gain": 0.1}


def test_nonsense_is_answered_and_the_next_request_still_is(
    running: BoundGraph, path: Path
) -> None:
    assert send(path, b"hello\n")["error"].startswith("not a request")
    assert send(path, b"[1]\n")["error"].startswith("not a request")
    assert send(path, b'{"verb": "reboot"}\n')["error"] == "there is no verb 'reboot'"
    assert send(path, b"")["error"].startswith("not a request")
    assert send(path, b"[" * 60_000 + b"\n")["error"].startswith("not a request")
    with pytest.raises(EndpointError, match=r"gain\.gain cannot be high"):
        set_parameters(path, ["gain.gain=high"])
    assert set_parameters(path, ["gain.gain=3"])


def test_a_name_that_is_taken_or_too_long(running: BoundGraph, path: Path) -> None:
    with pytest.raises(EndpointError, match="another run answers at"):
        ParameterEndpoint(path)
    with pytest.raises(EndpointError, match="is too long"):
        ParameterEndpoint(path.with_name("x" * 100))


def test_nobody_answers(path: Path) -> None:
    with pytest.raises(EndpointError, match="no running graph answers at"):
        ask(path, {"verb": "list"})
    with pytest.raises(EndpointError, match="no socket at"):
        ParameterEndpoint(path.parent / "missing" / "run.sock")


def test_a_client_waits_behind_others(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Linux refuses it at once, with "Resource temporarily unavailable"."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as server, ExitStack() as waiting:
        server.bind(str(path))
        server.listen(0)
        for _ in range(2):
            other = waiting.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            other.setblocking(False)
            with suppress(BlockingIOError):
                other.connect(str(path))
        with ThreadPoolExecutor(1) as pool:
            monkeypatch.setattr(parameter_endpoint, "REQUEST_TIMEOUT", 0.1)
            assert answers(path), "a graph that is busy is there"
            with pytest.raises(EndpointError, match="too many wait for it"):
                ask(path, {"verb": "list"})
            monkeypatch.setattr(parameter_endpoint, "REQUEST_TIMEOUT", 30.0)
            answer = pool.submit(ask, path, {"verb": "list"})
            time.sleep(0.1)
            assert not answer.done()
            waiting.close()
            asked = b""
            while not asked:  # those that went away ask nothing
                connection, _ = server.accept()
                with connection:
                    asked = connection.recv(100)
                    if asked:
                        connection.sendall(b'{"parameters": []}\n')
            assert answer.result(30.0) == {"parameters": []}
