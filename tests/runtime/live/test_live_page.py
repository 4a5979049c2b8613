"""The page in a real browser: it shows a graph that runs, tunes it, and says when it has ended."""

import time
from pathlib import Path
from typing import Any

import pytest

from aloft.runtime.live.live_server import LiveServer
from aloft.runtime.loading import load

from ...logs.viewing.browser import PROGRAM, Browser
from .conftest import Running

pytestmark = pytest.mark.skipif(
    PROGRAM is None, reason="looks through a real browser; install Debian's chromium"
)
PATIENCE = 60.0


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
        end = time.monotonic() + PATIENCE
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
        assert load(server.save).block("wave").params.frequency == 1.0  # type: ignore[attr-defined]
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
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)
