"""The HTTP door: what it answers, and everything that it refuses."""

import http.client
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from extensions.studio.tests.live.conftest import serving
from tests.logs.viewing.browser import PROGRAM, Browser
from tests.runtime.live.conftest import Running, start, write_graph

from aloft.extensions.studio.live.live_run import LiveRun
from aloft.extensions.studio.live.live_server import LONGEST_BODY, LiveServer
from aloft.runtime.loading import checked_file

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
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
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
    status, now = ask(server, "GET", "/now?chart=wave.y.value&chart=no.such.field")
    assert status == 200 and [len(v) for v in now["charted"].values()] == [2]
    status, about = ask(server, "GET", "/lines?field=wave.y.value")
    assert (status, about["names"]) == (200, ["0", "1"])
    status, done = ask(server, "POST", "/set", {"settings": ["wave.frequency=0.005 kHz"]})
    assert status == 200 and done["changes"][0]["new"] == 5.0
    status, done = ask(server, "POST", "/save")
    assert (status, done["count"]) == (200, 1)
    assert checked_file(server.save).block("wave").params.frequency == 5.0  # type: ignore[attr-defined]


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
        ("GET", "/now?" + "&".join(["chart=wave.y.value"] * 9), None, {}, 400, "at most 8 fields"),
        ("GET", "/lines?field=wave.y.no", None, {}, 409, "no output field 'wave.y.no'"),
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


pytestmark = pytest.mark.skipif(
    PROGRAM is None, reason="looks through a real browser; install Debian's chromium"
)
REQUEST_TIMEOUT = 60.0


class Page:
    """A page that is asked in JavaScript."""

    def __init__(self, browser: Browser) -> None:
        self.browser = browser

    def ask(self, script: str) -> Any:
        """The value of an expression."""
        found = self.browser.ask("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in found, (script, found)
        return found["result"].get("value")

    def wait(self, script: str, expected: Any = True) -> None:
        """Wait until an expression has that value."""
        end = time.monotonic() + REQUEST_TIMEOUT
        while (found := self.ask(script)) != expected:
            assert time.monotonic() < end, f"{script} is {found!r}, not {expected!r}"
            time.sleep(0.05)

    def enter(self, name: str, value: str, event: str) -> None:
        """Give an input of that label a value, as a user does."""
        self.ask(
            f"(() => {{ const i = document.querySelector('[aria-label=\"{name}\"]');"
            f" i.value = '{value}'; i.dispatchEvent(new Event('{event}')); }})()"
        )


def click(path: str) -> str:
    return (
        f"document.querySelector('.node[data-path=\"{path}\"]')"
        ".dispatchEvent(new MouseEvent('click', {bubbles: true}))"
    )


ERROR = "document.querySelector('[data-path=\"wave.frequency\"] .error').textContent"
LINE = "document.getElementById('line').textContent"
STATE = "document.getElementById('state').textContent"


@pytest.mark.long
def test_a_run_is_watched_and_tuned(server: LiveServer, running: Running, tmp_path: Path) -> None:
    wave: Any = running.bound.blocks["wave"]
    with Browser(tmp_path / "profile", (1200, 800)) as browser:
        page = Page(browser)
        browser.open(server.page)
        page.wait("document.readyState === 'complete' && !!document.getElementById('state')")
        page.wait(STATE, "running")
        # numbers on the wires and times in the blocks, and they go on
        number = "document.querySelector('.port[data-port=\"wave.y\"]').parentNode.querySelector('.now').textContent"
        before = page.ask(number)
        page.wait(f"{number} !== '{before}'")
        page.wait("/^[0-9.]+ .s/.test(document.querySelector('.took').textContent)")
        assert page.ask(LINE).startswith("tick ")
        # a click on a wire shows the block that writes
        page.ask(
            "document.querySelector('.hit[data-source=\"inner/twice.y\"]')"
            ".dispatchEvent(new MouseEvent('click', {bubbles: true}))"
        )
        page.wait("document.querySelector('aside h1').textContent", "inner/twice")
        page.wait("/y.value/.test(document.querySelector('.moment').textContent)")
        # tuning: a number, a number with a unit, a slider, one that is refused, one of a list
        page.wait("tunables.length > 5")
        page.ask(click("wave"))
        page.enter("wave.frequency", "5", "change")
        wait_until(lambda: wave.params.frequency == 5.0)
        page.enter("wave.frequency, slider", "3.5", "input")
        wait_until(lambda: wave.params.frequency == 3.5)
        page.enter("wave.frequency", "0.001 kHz", "change")
        wait_until(lambda: wave.params.frequency == 1.0)
        page.enter("wave.frequency", "-1", "change")
        page.wait(f"{ERROR}.includes('wave.frequency cannot be -1')")
        assert wave.params.frequency == 1.0
        # all parameters; one is changed from elsewhere, and one is taken back
        page.ask("document.getElementById('tune').click()")
        page.wait("document.querySelector('aside h1').textContent", "Parameters")
        server.run.set(["pid.kp=[3, 4]"])
        page.wait(
            "[...document.querySelectorAll('[aria-label=\"pid.kp\"]')].map(i => i.value).join()",
            "3,4",
        )
        assert page.ask("document.querySelector('[data-path=\"pid.kp\"]').className") == (
            "tunable whole changed"
        )
        page.ask("document.querySelector('[data-path=\"pid.kp\"] button').click()")
        wait_until(lambda: running.bound.blocks["pid"].params.kp == [1, 2])  # type: ignore[attr-defined]
        page.ask("document.getElementById('save').click()")
        page.wait("document.getElementById('saved').textContent", f"1 values are in {server.save}")
        assert checked_file(server.save).block("wave").params.frequency == 1.0  # type: ignore[attr-defined]
        # folded by block, and names beside the numbers of a list
        assert (
            page.ask(
                "[...document.querySelectorAll('.fold summary')].map(s => s.textContent.split(' ')[0]).join()"
            )
            == "wave,inner/twice,pid"
        )
        assert (
            page.ask(
                "[...document.querySelectorAll('[data-path=\"pid.kp\"] .element')].map(e => e.textContent).join()"
            )
            == "0,1"
        )
        # a strip chart of both elements grows, says its numbers, and goes away
        page.ask(click("wave"))
        page.ask(
            "[...document.querySelectorAll('.charted button')].find(b => b.textContent === 'y.value').click()"
        )
        page.wait("document.querySelectorAll('.chart path').length", 2)
        page.wait(
            "[...document.querySelectorAll('.chart path')].every(p => p.getAttribute('d').split('L').length > 5)"
        )
        assert (
            page.ask("document.querySelector('.chart figcaption b').textContent") == "wave.y.value"
        )
        assert page.ask(
            "[...document.querySelectorAll('.legend output')].every(o => o.textContent !== '')"
        )
        page.ask("document.querySelector('.chart figcaption button').click()")
        page.wait("document.getElementById('charts').hidden")
        # closing a sub-graph keeps the token
        page.ask("toggle('inner')")
        page.wait("location.search.includes('closed=inner')")
        page.wait("document.getElementById('state') && " + STATE, "running")
        running.stop("it is late")
        page.wait(STATE, "has ended")
        page.wait(f"{LINE}.startsWith('the run has ended: it is late; tick ')")


def test_light_and_dark(server: LiveServer, running: Running, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile", (900, 600)) as browser:
        page = Page(browser)
        browser.open(server.page)
        page.wait("document.readyState === 'complete' && !!document.querySelector('.now')")
        page.wait(STATE, "running")
        for mode in ("light", "dark"):
            features = [{"name": "prefers-color-scheme", "value": mode}]
            browser.ask("Emulation.setEmulatedMedia", features=features)
            text = brightness(page, "getComputedStyle(document.querySelector('.now')).fill")
            behind = brightness(page, "getComputedStyle(document.querySelector('.page')).fill")
            around = brightness(page, "getComputedStyle(document.body).color")
            assert (text > behind) == (around > 128) == (mode == "dark")
            assert abs(text - behind) > 120


def brightness(page: Page, script: str) -> float:
    """Of a colour ``rgb(r, g, b)``, 0 to 255."""
    numbers = page.ask(script).partition("(")[2].rstrip(")").split(",")[:3]
    return sum(float(number) for number in numbers) / 3.0


def wait_until(holds: Any) -> None:
    end = time.monotonic() + REQUEST_TIMEOUT
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)
