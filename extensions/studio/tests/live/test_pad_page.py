"""The pad on the page of a running graph, in a real browser."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.logs.viewing.browser import PROGRAM, Browser
from tests.runtime.live.conftest import Running

from aloft.extensions.studio.live.live_server import LiveServer

from .test_live_server import STATE, Page

pytestmark = pytest.mark.skipif(
    PROGRAM is None, reason="looks through a real browser; install Debian's chromium"
)
GRAPH = """\
rate: 200 Hz
clock: {kind: paced}
blocks:
  stick: {use: hopping.Pad}
"""


@pytest.fixture
def graph_file(tmp_path: Path) -> Path:
    file = tmp_path / "pad.yaml"
    file.write_text(GRAPH)
    return file


@pytest.mark.long
def test_the_pad_is_dragged_and_springs_back(
    server: LiveServer, running: Running, tmp_path: Path
) -> None:
    stick: Any = running.bound.blocks["stick"]
    twist = stick.twist
    with Browser(tmp_path / "profile", (1200, 800)) as browser:
        page = Page(browser)

        def mouse(kind: str, buttons: int) -> None:
            browser.ask(
                "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=buttons,
                clickCount=1,
            )  # fmt: skip

        browser.open(server.page)
        page.wait("document.readyState === 'complete' && !!document.querySelector('.pad')")
        page.wait(STATE, "running")
        x, y = page.ask(
            "(() => { const r = document.querySelector('.pad .field').getBoundingClientRect();"
            " return [r.left + r.width / 2, r.top + r.height / 4]; })()"
        )
        mouse("mousePressed", 1)
        until(lambda: float(twist.linear[0]) == pytest.approx(0.08, abs=0.01))
        time.sleep(1.5)  # longer than a beat holds
        until(lambda: float(twist.linear[0]) > 0.0)  # the page goes on to beat
        mouse("mouseReleased", 0)
        until(lambda: float(twist.linear[0]) == 0.0)


def until(holds: Callable[[], bool]) -> None:
    """Wait until it holds."""
    end = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)
