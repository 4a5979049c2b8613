"""One page of a graph whose parts run in two processes: its values, its times, and a part that is gone."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from tests.logs.viewing.browser import PROGRAM, Browser
from tests.waiting import free_port

from aloft.extensions.studio.live.live_server import LiveServer
from aloft.extensions.studio.live.spread_run import SpreadRun
from aloft.runtime.live.parameter_endpoint import EndpointError
from aloft.runtime.live.part_feed import packed
from aloft.runtime.live.window import WindowLayout
from aloft.runtime.loading import checked_file
from aloft.runtime.placement.placed import PlacedGraph, split_over_machines

from .test_live_server import LINE, STATE, Page

GRAPH = """\
rate: 100 Hz
clock: {{kind: paced}}
links: {{mode: free, max_age: 60 s, late: hold}}
machines: {{near: tcp/127.0.0.1:{near}, far: tcp/127.0.0.1:{far}}}
blocks:
  wave: {{use: blocks.SineWave}}
  twice: {{use: blocks.Gain, with: {{gain: 2}}, in: {{u: wave.y}}, on: far}}
  last: {{use: blocks.Gain, in: {{u: twice.y}}}}
"""


@pytest.fixture
def graph(tmp_path: Path) -> Path:
    path = tmp_path / "waves.yaml"
    path.write_text(GRAPH.format(near=free_port(), far=free_port()))
    return path


@pytest.fixture
def parts(graph: Path) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Both parts, each a process of its own."""
    command = [sys.executable, "-m", "aloft", "run", str(graph), "--no-record", "--plain"]
    started = {
        name: subprocess.Popen(
            [*command, "--params", "none", "--machine", name],
            cwd=graph.parent, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        for name in ("near", "far")
    }  # fmt: skip
    yield started
    for process in started.values():
        process.kill()
        process.wait()


@pytest.fixture
def run(graph: Path) -> Iterator[SpreadRun]:
    made = SpreadRun(split_over_machines(checked_file(graph)))
    yield made
    made.close()


def wait_for(run: SpreadRun, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """What is said of the run once that holds."""
    end = time.monotonic() + 120.0
    while time.monotonic() < end:
        found = run.now()
        if holds(found):
            return found
        time.sleep(0.05)
    raise AssertionError(found)


def states(found: dict[str, Any]) -> dict[str, str]:
    return {name: state for name, (state, _) in found["parts"].items()}


def test_before_anybody_is_heard(run: SpreadRun) -> None:
    found = run.now()
    assert found["state"] == "unheard" and found["values"] == found["times"] == {}
    assert found["said"] == "near has not been heard; far has not been heard"
    assert not run.is_heard(0.0) and not run.has_parameters
    with pytest.raises(EndpointError, match="no part that runs on this machine takes changes"):
        run.set(["twice.gain=3"])


@pytest.mark.long
def test_the_whole_graph_with_values_and_times_of_both_parts(
    run: SpreadRun, parts: dict[str, subprocess.Popen[bytes]]
) -> None:
    found = wait_for(run, lambda f: f["state"] == "running" and min(ticks(f)) > 20)
    assert run.is_heard(0.0) and states(found) == {"near": "running", "far": "running"}
    assert list(found["values"]) == ["wave.y.value", "last.y.value", "twice.y.value"]
    assert sorted(found["times"]) == ["last", "twice", "wave"], "each from where it runs"
    assert found["line"].startswith("near: tick ") and "; far: tick " in found["line"]
    assert found["said"] == "" and json.dumps(found)
    for name in ("wave.y.value", "twice.y.value"):
        before = found["values"][name]
        wait_for(run, lambda f, n=name, b=before: f["values"][n] != b)  # type: ignore[misc]
    # one is killed: that is shown, its last values stay, and the other goes on
    parts["far"].kill()
    gone = wait_for(run, lambda f: states(f) == {"near": "running", "far": "gone"})
    assert gone["state"] == "partly" and gone["said"].startswith("far has not been heard for ")
    assert gone["said"].endswith(": the part was killed, or is out of reach")
    later = wait_for(run, lambda f: ticks(f)[0] > ticks(gone)[0] + 20)
    assert later["values"]["twice.y.value"] == gone["values"]["twice.y.value"]
    # the other is told to end, and says why
    parts["near"].send_signal(signal.SIGINT)
    ended = wait_for(run, lambda f: states(f)["near"] == "ended")
    assert ended["said"].startswith("near has ended: stopped by SIGINT; far has not been heard")


def ticks(found: dict[str, Any]) -> list[int]:
    """The ticks of the parts that were heard, in their order."""
    lines = (part.partition("tick ")[2] for part in found["line"].split("; "))
    heard = [int(line.partition(",")[0]) for line in lines if line]
    return heard if len(heard) == len(found["parts"]) else [-1]


def test_a_run_that_is_started_anew_at_other_endpoints_is_followed(graph: Path) -> None:
    first = split_over_machines(checked_file(graph))
    moved = [f"machines.{name}=tcp/127.0.0.1:{free_port()}" for name in ("near", "far")]
    second = split_over_machines(checked_file(graph, moved))
    there: list[PlacedGraph | None] = [None]
    run = SpreadRun(first, find=lambda: there[0])
    try:
        for now, expected in ((None, first), (first, first), (second, second), (None, second)):
            there[0] = now
            run.refresh()
            assert run.graph is expected.graph
    finally:
        run.close()


def test_a_part_of_another_graph_or_version_is_not_guessed_at(run: SpreadRun) -> None:
    shape = WindowLayout((), (), (), 8)
    about = {"digest": "another", "ended": None, "shape": asdict(shape)}
    run._parts["near"].take(packed(about, bytes(shape.size)))
    run._parts["far"].take(b"noise")
    found = run.now()
    assert found["said"] == (
        "near runs another graph; far says what cannot be read: is it of this version?"
    )
    assert found["state"] == "unheard" and found["values"] == {}


@pytest.mark.long
@pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")
def test_the_page_marks_the_part_that_is_gone(
    run: SpreadRun, parts: dict[str, subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    server = LiveServer(run, tmp_path / "tuned.yaml")
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    took = "document.querySelector('.node[data-path=\"{}\"] .took').textContent"
    try:
        wait_for(run, lambda f: f["state"] == "running")
        with Browser(tmp_path / "profile", (1000, 700)) as browser:
            page = Page(browser)
            browser.open(server.page)
            page.wait("document.readyState === 'complete' && !!document.getElementById('state')")
            page.wait(STATE, "running")
            for block in ("wave", "twice"):
                page.wait(f"/^[0-9.]+ .s/.test({took.format(block)})")
            assert "on far" in page.ask("document.querySelector('svg').textContent")
            assert page.ask(LINE).startswith("near: tick ")
            absent = "[...document.querySelectorAll('.absent')].map(n => n.dataset.path).join()"
            assert page.ask(absent) == ""
            os.kill(parts["far"].pid, signal.SIGKILL)
            page.wait(absent, "twice")
            page.wait(STATE, "in part")
            page.wait(
                "[...document.querySelectorAll('#parts .part')].map(p => p.textContent).join()",
                "near running,far is gone",
            )
            page.ask("show('twice')")
            page.wait(
                "/far has not been heard for/.test(document.querySelector('aside').textContent)"
            )
    finally:
        server.shutdown()
        server.server_close()
