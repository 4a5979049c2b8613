"""A run that is paused from outside, goes back to a snapshot and goes on: the socket, the page, the browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from extensions.studio.tests.live.conftest import serving
from tests.logs.viewing.browser import PROGRAM, Browser
from tests.runtime.live.conftest import Running, start

from aloft.extensions.studio.live.live_run import LiveRun, paused_text
from aloft.extensions.studio.live.live_server import LiveServer
from aloft.runtime.language.block import Block
from aloft.runtime.live.parameter_endpoint import EndpointError, ask
from aloft.runtime.loading import checked_file
from aloft.runtime.running.executor import Executor

from .test_live_run import wait_for
from .test_live_server import LINE, STATE, Page, click, wait_until
from .test_live_server import ask as ask_page

GRAPH = """\
rate: 200 Hz
duration: 4 s
blocks:
  wave: {use: blocks.SineWave, with: {frequency: 2 Hz}}
  noise: {use: blocks.WhiteNoise, with: {seed: 3}}
  gain: {use: blocks.Gain, with: {gain: 2}, in: {u: noise.y}}
  sum: {use: blocks.Integrator, in: {u: gain.y}}
"""


@pytest.fixture
def graph_file(tmp_path: Path) -> Path:
    file = tmp_path / "sum.yaml"
    file.write_text(GRAPH)
    return file


@pytest.fixture
def running(graph_file: Path, socket_path: Path) -> Iterator[Running]:
    """A run in virtual time, which begins paused and waits at its end."""
    run = start(graph_file, socket_path, paused=True)
    yield run
    run.stop()


def test_a_run_in_virtual_time_from_another_process(running: Running, live: LiveRun) -> None:
    assert live.can_be_paused
    found = wait_for(live, "paused")
    assert found["said"] == (
        "paused before tick 0, 0.000 s; it can go back to 1 snapshots from 0.000 s on"
    )
    live.control("go on", 250)
    found = wait_for(live, "paused", 200)
    assert found["tick"] == 249 and found["control"]["kept"] == [0, 100, 200, 250]
    values = found["values"]
    assert live.control("back", 230)["tick"] == 200
    assert wait_for(live, "paused")["tick"] == 199, "the last tick that was run"
    live.control("go on", 50)
    assert wait_for(live, "paused", 249)["values"] == values, "the same once more"
    live.control("go on")
    found = wait_for(live, "paused", 799)
    assert found["said"].startswith(
        "paused before tick 800, 4.000 s at its end (the duration is over)"
    )
    live.control("go on")
    running.thread.join(60.0)  # the state is shown first, the reason a little later
    assert wait_for(live, "ended")["said"] == "the run has ended: ran to its end"
    with pytest.raises(EndpointError, match="no running graph answers"):
        live.control("look")


def test_what_the_socket_and_the_page_refuse(running: Running, server: LiveServer) -> None:
    live = server.run
    wait_for(live, "paused")  # type: ignore[arg-type]
    with pytest.raises(
        EndpointError, match="a run does not 'fly'; it can pause, go on, back, play and look"
    ):
        live.control("fly")
    with pytest.raises(EndpointError, match="not a request: 'tick'"):
        live.control("back")
    with pytest.raises(EndpointError, match="no snapshot of tick -5 or before is kept"):
        live.control("back", -5)
    with pytest.raises(EndpointError, match="goes on for at least 1 tick, not 0"):
        live.control("go on", 0)
    for body in ({"do": 1}, {}, {"do": "back", "number": "1"}, {"do": "back", "number": True}):
        status, answer = ask_page(server, "POST", "/control", body)
        assert (status, answer["error"]) == (400, 'expected {"do": "back", "number": 500}')
    status, answer = ask_page(server, "POST", "/control", {"do": "fly"})
    assert status == 409 and "does not 'fly'" in answer["error"]
    status, answer = ask_page(server, "POST", "/control", {"do": "look"})
    assert status == 200 and answer["paused"] and answer["kept"] == [0]


def test_what_is_said_of_a_run_without_snapshots() -> None:
    about = {"tick": 5, "kept": [], "over": "", "problem": "no room"}
    assert paused_text(about, 0.1) == (
        "paused before tick 5, 0.500 s; no more snapshots are kept: no room"
    )


class Motors(Block):
    """Meets the real world."""

    outside = "real"

    def step(self) -> None: ...


def test_a_real_robot_is_not_paused(socket_path: Path, tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        f"rate: 50 Hz\nclock: {{kind: paced}}\nblocks: {{motors: {{use: {__name__}:Motors}}}}\n"
    )
    run = start(file, socket_path)
    try:
        live = LiveRun(socket_path)
        assert not live.can_be_paused
        wait_for(live, "running", 2)
        with serving(live, tmp_path / "tuned.yaml") as server:
            _, page = ask_page(server, "GET", f"/?token={server.token}")
            assert 'id="pause"' not in page, "the page does not offer it"
            status, answer = ask_page(server, "POST", "/control", {"do": "pause"})
        assert status == 409 and answer["error"] == (
            f"this run cannot be paused: motors ({__name__}:Motors) meets the real world, which does "
            "not wait; only a simulation can be paused"
        )
        tick = live.now()["tick"]
        wait_for(live, "running", tick + 5)
        assert "refusal" in ask(socket_path, {"verb": "watch"}), "it says so to whoever looks"
        live.close()
    finally:
        run.stop()


needs_browser = pytest.mark.skipif(
    PROGRAM is None, reason="looks through a real browser; install Debian's chromium"
)
PAUSED_LINE = f"{LINE}.split(';')[0]"
BACK = "go back to"


def let_go(page: Page, place: int) -> None:
    """Move the slider of snapshots there, and let it go."""
    page.enter(BACK, str(place), "input")
    page.enter(BACK, str(place), "change")


@needs_browser
@pytest.mark.long
def test_pause_go_back_move_a_slider_go_on(
    running: Running, server: LiveServer, graph_file: Path, tmp_path: Path
) -> None:
    gain: Any = running.bound.blocks["gain"]
    press = "document.getElementById('pause').click()"
    label = "document.getElementById('pause').textContent"
    target = "document.getElementById('target').textContent"
    refused = "document.getElementById('refused').textContent"
    with Browser(tmp_path / "profile", (1200, 800)) as browser:
        page = Page(browser)
        browser.open(server.page)
        page.wait("document.readyState === 'complete' && !!document.getElementById('pause')")
        page.wait(STATE, "paused")
        page.wait(label, "go on")
        # on for a while, which must be a time
        page.enter("go on for", "500 ms", "change")
        page.ask(press)
        page.wait(refused, "expected seconds, as 0.5, not 500 ms")
        page.enter("go on for", "2.25 s", "change")
        page.ask(press)
        page.wait(PAUSED_LINE, "paused before tick 450, 2.250 s")
        page.wait(target, "2.250 s")
        assert page.ask("[back.min, back.max, back.value].join()") == "0,5,5"
        # while the slider moves it says where to; where it is let go the run stands
        page.enter(BACK, "3", "input")
        assert page.ask(target) == "1.500 s" and running.bound.clock.tick == 450
        let_go(page, 2)
        page.wait(PAUSED_LINE, "paused before tick 200, 1.000 s")
        page.wait("back.max", "2")
        # a slider of a parameter, while it is paused; then to the end
        page.wait("tunables.length > 3")
        page.ask(click("gain"))
        page.enter("gain.gain, slider", "3.5", "input")
        wait_until(lambda: gain.params.gain == 3.5)
        page.enter("go on for", "", "change")
        page.ask(press)
        page.wait(PAUSED_LINE, "paused before tick 800, 4.000 s at its end (the duration is over)")
        assert page.ask(label) == "end the run"
        # back before the change, where the parameter is as it was, and on
        let_go(page, 0)
        page.wait(PAUSED_LINE, "paused before tick 0, 0.000 s")
        page.wait("document.querySelector('[aria-label=\"gain.gain\"]').value", "2")
        page.ask(press)
        page.wait(label, "end the run")
        page.ask(press)
        page.wait(STATE, "has ended")
        assert page.ask("document.getElementById('pause').disabled")
    assert gain.params.gain == 2.0
    assert (
        running.results[0].run_hash == Executor(checked_file(graph_file), plain=True).run().run_hash
    )


@needs_browser
@pytest.mark.long
def test_a_run_in_real_time_is_paused_on_the_page(
    socket_path: Path, tmp_path: Path, graph_file: Path
) -> None:
    graph_file.write_text(GRAPH.replace("duration: 4 s", "clock: {kind: paced}"))
    run = start(graph_file, socket_path)
    live = LiveRun(socket_path)
    try:
        with (
            serving(live, tmp_path / "t.yaml") as server,
            Browser(tmp_path / "p", (1200, 800)) as browser,
        ):
            page = Page(browser)
            browser.open(server.page)
            page.wait("document.readyState === 'complete' && !!document.getElementById('pause')")
            page.wait(STATE, "running")
            assert page.ask("document.getElementById('paused').hidden")
            wait_until(lambda: run.bound.clock.tick > 150)
            page.ask("document.getElementById('pause').click()")
            page.wait(STATE, "paused")
            tick = run.bound.clock.tick
            let_go(page, 1)
            page.wait(PAUSED_LINE, "paused before tick 100, 0.500 s")
            page.ask("document.getElementById('pause').click()")
            page.wait(STATE, "running")
            wait_until(lambda: run.bound.clock.tick > tick)
            page.wait("document.getElementById('paused').hidden")
            page.ask(
                "(r => { r.value = 50; r.dispatchEvent(new Event('change')); })(document.getElementById('rate'))"
            )
            wait_until(lambda: live.control("look")["percent"] == 50)
    finally:
        run.stop()
        live.close()
