"""``aloft params``: a running graph's parameters, from another process."""

import json
import re
import signal
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from aloft.extensions.studio.live.live_run import LiveRun

from .conftest import Call, CallJson, Start

GRAPH = """
rate: 200 Hz
clock: {kind: paced}
blocks:
  wave: {use: blocks.SineWave, with: {n: 2}}
  gain: {use: blocks.Gain, with: {n: 2}, in: {u: wave.y}}
"""


@pytest.fixture
def sockets(folder: Path, tmp_path_factory: pytest.TempPathFactory,
            monkeypatch: pytest.MonkeyPatch) -> Path:  # fmt: skip
    """Where this test's sockets are: a short path, as theirs must be."""
    path = tmp_path_factory.mktemp("run")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(path))
    (folder / "tune.yaml").write_text(GRAPH)
    return path


@pytest.fixture
def running(sockets: Path, start: Start) -> Iterator[subprocess.Popen[str]]:
    """A paced run called ``tune``."""
    process = start("run", "tune.yaml", "--no-record", "--json")
    path = sockets / "aloft" / "tune.sock"
    end = time.monotonic() + 240.0
    while not path.exists() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
    yield process
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=240)


def test_list_get_set_and_what_is_refused(
    running: subprocess.Popen[str], call: Call, call_json: CallJson
) -> None:
    listed = call_json("params", "list")
    assert listed["graph"] == "tune"
    assert [entry["path"] for entry in listed["parameters"]] == [
        "wave.amplitude", "wave.frequency", "wave.phase", "wave.offset", "gain.gain",
    ]  # fmt: skip
    table = call("params", "list", "--all").stdout
    assert "wave.n" in table and "oscillations per second" in table
    assert call("params", "get", "gain.gain").stdout == "1.0\n"
    done = call("params", "set", "gain.gain=2", "wave.frequency=0.0005 kHz", "--run", "tune").stdout
    first, second = done.splitlines()
    assert first.endswith("gain.gain 1.0 -> 2.0")
    assert second.endswith("wave.frequency 1.0 -> 0.5")
    assert first.partition(":")[0] == second.partition(":")[0]
    values = call_json("params", "get", "gain.gain", "wave.frequency")["values"]
    assert values == {"gain.gain": 2.0, "wave.frequency": 0.5}
    expect_refusals(call, call_json)
    running.send_signal(signal.SIGINT)
    output, _ = running.communicate(timeout=240)
    changes = json.loads(output)["parameter_changes"]
    assert [(c["path"], c["old"], c["new"]) for c in changes] == [
        ("gain.gain", 1.0, 2.0), ("wave.frequency", 1.0, 0.5),
    ]  # fmt: skip


def expect_refusals(call: Call, call_json: CallJson) -> None:
    """What the run cannot do is said, and changes nothing."""
    errors = call("params", "set", "gain.gain=high", "gain.n=3", "gian.gain=1", code=2).stderr
    assert "gain.gain cannot be high" in errors
    assert "gain.n cannot be changed while the graph runs" in errors
    assert "there is no block 'gian' in the running graph" in errors
    assert call("params", "get", "gain.gain").stdout == "2.0\n"
    reason = call_json("params", "get", "gain.gian", code=2)["reason"]
    assert reason == "there is no parameter 'gain.gian'; the nearest is gain.gain"
    reason = call_json("params", "list", "--run", "other", code=2)["reason"]
    assert reason == "no running graph is called 'other'; there is tune"
    assert call("run", "tune.yaml", "--params", "tune", code=2).stderr.startswith(
        "error: another run answers at"
    )


def test_nothing_runs(sockets: Path, call: Call, call_json: CallJson) -> None:
    reason = call_json("params", "list", code=2)["reason"]
    assert reason.startswith("no graph is running whose parameters can be changed")
    (sockets / "aloft" / "dead.sock").touch()  # left behind by a run that was killed
    assert call_json("params", "list", code=2)["reason"] == reason
    result = call_json("run", "count.yaml", "--no-record", "--params", "dead")
    assert result["success"] and not (sockets / "aloft" / "dead.sock").exists()
    assert "cannot name a run" in call("run", "count.yaml", "--params", "a/b", code=2).stderr


def test_a_run_that_begins_paused(sockets: Path, start: Start, call_json: CallJson) -> None:
    whole = call_json("run", "count.yaml", "--no-record")
    process = start("run", "count.yaml", "--paused", "--no-record", "--json")
    path = sockets / "aloft" / "count.sock"
    end = time.monotonic() + 240.0
    while not path.exists() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
    live = LiveRun(path)
    for do in ("go on", "go on"):  # from the start, and where it waits at its end
        while live.now()["state"] != "paused" and time.monotonic() < end:
            time.sleep(0.02)
        live.control(do)
        while live.now()["state"] == "running" and time.monotonic() < end:
            time.sleep(0.02)
    output, errors = process.communicate(timeout=240)
    live.close()
    assert (
        "the run begins paused; `aloft graph --live --run count` shows where it goes on" in errors
    )
    assert json.loads(output)["run_hash"] == whole["run_hash"]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--seeds", "0:2"), "--paused is for one run in one process"),
        (("--local",), "--paused is for one run in one process"),
        (("--machine", "ground"), "without --seeds, --machine and --local"),
        (("--params", "none"), "--paused needs the page; --params none lets nobody reach the run"),
    ],
)
def test_what_does_not_begin_paused(
    sockets: Path, call_json: CallJson, options: tuple[str, ...], reason: str
) -> None:
    assert reason in call_json("run", "count.yaml", "--paused", *options, code=2)["reason"]


PAGES = [
    (("params", "web", "--out", "fast.yaml"), '"opened": "parameters"'),
    (("graph", "--live"), '"opened": "diagram"'),
    (("graph", "tune.yaml", "--live"), "tune-tuned.yaml"),
]


@pytest.mark.long
def test_pages_of_it(running: subprocess.Popen[str], start: Start) -> None:
    pages = [start(*words) for words, _ in PAGES]
    try:
        for page, (words, shown) in zip(pages, PAGES, strict=True):
            assert page.stdout is not None
            address = page.stdout.readline().strip()
            assert re.fullmatch(r"http://127\.0\.0\.1:[0-9]+/\?token=[\w-]{32,}", address), words
            with urllib.request.urlopen(address, timeout=60) as answer:
                assert shown in answer.read().decode(), words
    finally:
        ended = []
        for page in pages:
            page.send_signal(signal.SIGINT)
            _, errors = page.communicate(timeout=60)
            ended.append((page.returncode, errors))
    assert ended == [(0, "")] * len(PAGES)


def test_pages_of_what_does_not_run(sockets: Path, call: Call) -> None:
    nothing = "no graph is running whose parameters can be changed"
    assert nothing in call("params", "web", code=2).stderr
    assert nothing in call("graph", "--live", code=2).stderr
    assert nothing in call("graph", "tune.yaml", "--live", code=2).stderr
    assert (
        "--live is for a graph that is running" in call("graph", "a.rrd", "--live", code=2).stderr
    )
    assert "--run NAME is for --live" in call("graph", "tune.yaml", "--run", "a", code=2).stderr
    assert (
        "give a graph file, or --live for one that runs"
        in call("graph", "--svg", "a.svg", code=2).stderr
    )
    assert "choose one of" in call("graph", "--live", "--json", code=2).stdout
