"""The HTTP door: what it answers, and everything that it refuses."""

import http.client
import json
from collections.abc import Iterator
from typing import Any

import pytest

from aloft.runtime.live.live_run import LiveRun
from aloft.runtime.live.live_server import LONGEST_BODY, LiveServer
from aloft.runtime.loading import load

from .conftest import Running, serving, start, write_graph

JSON = "application/json"


def ask(
    server: LiveServer, method: str, path: str, body: Any = None, **headers: str | None
) -> tuple[int, Any]:
    """Status and answer. The headers are right unless they are given; ``None`` leaves one out."""
    port = server.server_address[1]
    given: dict[str, str | None] = {
        "X-Aloft-Token": server.token, "Host": f"127.0.0.1:{port}", "Content-Type": JSON,
        **{name.replace("_", "-"): value for name, value in headers.items()},
    }  # fmt: skip
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    sent = body if isinstance(body, bytes) else json.dumps(body or {}).encode()
    connection.putrequest(method, path, skip_host=True)
    for name, value in given.items():
        if value is not None:
            connection.putheader(name, value)
    if method == "POST":
        connection.putheader("Content-Length", str(len(sent)))
        connection.endheaders(sent)
    else:
        connection.endheaders()
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    kind = answer.headers.get_content_type()
    return answer.status, json.loads(text) if kind == JSON else text


def test_it_listens_on_the_loopback_address_only(server: LiveServer) -> None:
    assert server.server_address[0] == "127.0.0.1"
    assert server.page == f"http://127.0.0.1:{server.server_address[1]}/?token={server.token}"
    assert len(server.token) >= 32


def test_what_it_answers(server: LiveServer) -> None:
    status, page = ask(server, "GET", f"/?token={server.token}", X_Aloft_Token=None)
    assert status == 200 and 'id="tune"' in page
    status, now = ask(server, "GET", "/now")
    assert status == 200 and now["state"] in ("running", "starting")
    status, found = ask(server, "GET", "/parameters")
    assert status == 200
    (row,) = (row for row in found["parameters"] if row["path"] == "wave.frequency")
    assert row["value"] == 2.0
    status, done = ask(server, "POST", "/set", {"settings": ["wave.frequency=0.005 kHz"]})
    assert status == 200 and done["changes"][0]["new"] == 5.0
    status, done = ask(server, "POST", "/save")
    assert (status, done["count"]) == (200, 1)
    assert load(server.save).block("wave").params.frequency == 5.0  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def refusing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    """A server for all requests that are refused: each leaves everything as it was."""
    running = start(
        write_graph(tmp_path_factory.mktemp("refusing")),
        tmp_path_factory.mktemp("s") / "waves.sock",
    )
    live = LiveRun(running.path)
    with serving(live, running.file.with_name("waves-tuned.yaml")) as server:
        yield server
    live.close()
    running.stop()


@pytest.mark.parametrize(
    ("method", "path", "body", "headers", "status", "said"),
    [
        ("GET", "/", None, {}, 403, "the token is missing or wrong"),
        ("GET", "/?token=guess", None, {}, 403, "the token is missing or wrong"),
        ("GET", "/now", None, {"X_Aloft_Token": None}, 403, "the token is missing or wrong"),
        ("GET", "/parameters", None, {"X_Aloft_Token": "é"}, 403, "the token is missing or wrong"),
        ("GET", "/set", None, {}, 404, "there is no /set"),
        ("GET", "/now", None, {"Host": "evil.example:80"}, 403, "for this machine only"),
        ("GET", "/now", None, {"Host": "127.0.0.1:1"}, 403, "for this machine only"),
        ("GET", "/now", None, {"Host": None}, 403, "for this machine only"),
        ("POST", "/set", {}, {"Host": "evil.example"}, 403, "for this machine only"),
        ("POST", "/set", {}, {"X_Aloft_Token": "guess"}, 403, "the token is missing or wrong"),
        ("POST", "/set", {}, {"Origin": "http://evil.example"}, 403, "only the page itself may"),
        ("POST", "/set", {}, {"Origin": "null"}, 403, "only the page itself may change something"),
        ("POST", "/set", {}, {"Content_Type": "text/plain"}, 415, "is asked for in JSON"),
        ("POST", "/set", b"{", {}, 400, "the request is no JSON object"),
        ("POST", "/set", b"[" * 5000, {}, 400, "the request is no JSON object"),
        ("POST", "/set", b"[1]", {}, 400, "the request is no JSON object"),
        ("POST", "/set", {"settings": "a=1"}, {}, 400, "expected {"),
        ("POST", "/set", {"settings": [1]}, {}, 400, "expected {"),
        ("POST", "/set", b" " * (LONGEST_BODY + 1), {}, 413, "at most 65536 bytes"),
        ("POST", "/now", {}, {}, 404, "there is no /now"),
        ("PUT", "/set", {}, {}, 501, "Unsupported method"),
        ("POST", "/set", {"settings": ["wave.frequency=-1"]}, {}, 409, "wave.frequency cannot be -1"),
        ("POST", "/set", {"settings": ["wave.n=3"]}, {}, 409, "cannot be changed while the graph"),
        ("POST", "/set", {"settings": ["wav.n=3"]}, {}, 409, "there is no block 'wav'"),
        ("POST", "/save", {}, {}, 409, "no parameter has another value than when the run began"),
    ],
)  # fmt: skip
def test_what_it_refuses(
    refusing: LiveServer, method: str, path: str, body: Any, headers: dict[str, str | None],
    status: int, said: str,
) -> None:  # fmt: skip
    found, answer = ask(refusing, method, path, body, **headers)
    assert found == status
    assert said in (answer["error"] if isinstance(answer, dict) else answer)
    _, now = ask(refusing, "GET", "/parameters")
    assert all(row["value"] == row["start"] for row in now["parameters"]), "nothing was changed"


def test_the_page_itself_may_change_something(server: LiveServer) -> None:
    origin = f"http://127.0.0.1:{server.server_address[1]}"
    status, _ = ask(server, "POST", "/set", {"settings": ["wave.phase=1"]}, Origin=origin)
    assert status == 200


def test_a_graph_that_has_ended(server: LiveServer, running: Running) -> None:
    running.stop("it is late")
    status, now = ask(server, "GET", "/now")
    assert (status, now["state"], now["said"]) == (200, "ended", "the run has ended: it is late")
    status, answer = ask(server, "POST", "/set", {"settings": ["wave.phase=1"]})
    assert status == 409 and "no running graph answers at" in answer["error"]
    assert ask(server, "GET", "/parameters")[0] == 409
    assert ask(server, "GET", f"/?token={server.token}")[0] == 200, "the last values stay there"
