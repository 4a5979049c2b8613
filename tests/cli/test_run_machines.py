"""``aloft run --local``: parts as processes over Zenoh give one result, whatever becomes of them."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from aloft import __version__
from aloft.cli.shared import run_machines
from aloft.logs.file.reader import read
from aloft.processes.child_process import ChildProcess

from ..waiting import free_port, is_gone
from .conftest import run_for_json, run_here, run_parts_for_json

BLOCKS = """
import time
from aloft import Block, BlockError, Field, Input, Output, Parameters, Signal, State, parameter


class Number(Signal):
    value = Field(text="a number")


class Robot(Block):
    class Params(Parameters):
        pace: float = parameter(0.0, text="seconds a tick takes")

    params: Params
    u = Input(Number)
    y = Output(Number)
    count = State(Number)

    def start(self):
        open("enabled.txt", "w").close()

    def emit(self):
        self.y.value[()] = self.count.value

    def update(self):
        time.sleep(self.params.pace)
        self.count.value += 1.0 + 0.5 * self.u.value

    def stop_cycle(self):
        with open("damping.txt", "a") as file:
            file.write(f"{time.monotonic()}\\n")


class Controller(Block):
    class Params(Parameters):
        fail_at: int = parameter(-1, text="the tick at which it raises")
        stop_at: int = parameter(-1, text="the tick at which it ends the run")
        good: bool = parameter(True, text="what it says of the run")

    params: Params
    u = Input(Number)
    y = Output(Number)

    def step(self):
        if self.tick == self.params.fail_at:
            raise BlockError("the spring broke")
        if self.tick == self.params.stop_at:
            self.request_stop("balanced")
        self.y.value[()] = -0.3 * self.u.value

    def metrics(self):
        verdict = {"success": self.params.good, "reason": "" if self.params.good else "it fell"}
        return {"last": float(self.y.value), **verdict}
"""
GRAPH = """
rate: 200 Hz
duration: 300 ms
machines: {onboard: tcp/127.0.0.1:7450, ground: tcp/127.0.0.1:7451}
blocks:
  robot: {use: "pieces:Robot", in: {u: controller.y}}
  controller: {use: "pieces:Controller", in: {u: robot.y}, on: ground}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "pieces.py").write_text(BLOCKS)
    (tmp_path / "graph.yaml").write_text(GRAPH)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def alone(*settings: str) -> dict[str, Any]:
    return run_for_json("run", "graph.yaml", "--no-record", *settings, code=0)


@pytest.mark.long
def test_one_result_and_one_recording_with_the_bytes_of_one_process(here: Path) -> None:
    together = run_parts_for_json("run", "graph.yaml", "--local")
    expected = run_for_json("run", "graph.yaml", "--record", "alone.rrd")
    for key in ("success", "reason", "run_hash", "ticks", "metrics", "exit_code"):
        assert together[key] == expected[key], key
    assert list(together["blocks"]) == list(expected["blocks"])
    assert together["recording"] == "recordings/graph.rrd"
    one, other = read("alone.rrd"), read("recordings/graph.rrd")
    assert (one.rows == other.rows).all() and one.ticks.tolist() == other.ticks.tolist()
    assert other.header.bus == one.header.bus and other.header.state == one.header.state
    assert other.whole
    links = [link for part in together["machines"].values() for link in part["links"]]
    assert [(link["name"], link["received"], link["damaged"]) for link in links] == [
        ("controller@ground -> onboard", 60, 0), ("robot@onboard -> ground", 60, 0),
    ]  # fmt: skip
    assert "identical" in run_here("replay", "--check", "recordings/graph.rrd").stdout


@pytest.mark.long
def test_the_verdict_of_any_part_is_the_verdict(here: Path) -> None:
    result = run_parts_for_json(
        "run", "graph.yaml", "--local", "--no-record", "--set", "controller.good=false",
        "--set", "controller.stop_at=20", code=1,
    )  # fmt: skip
    assert result["reason"].startswith("it fell") and result["ticks"] == 21
    assert result["recording"] is None


@pytest.mark.long
def test_the_fault_of_a_part_is_the_reason(here: Path) -> None:
    settings = ("--set", "controller.fail_at=20")
    result = run_parts_for_json("run", "graph.yaml", "--local", *settings, code=3)
    assert result["reason"] == "block 'controller' failed at tick 20 (0.100 s): the spring broke"
    assert result["error"]["block"] == "controller" and result["error"]["tick"] == 20
    assert read("recordings/graph.rrd").ticks.tolist() == list(range(20))


def test_what_cannot_be_asked_for(here: Path) -> None:
    (here / "plain.yaml").write_text(
        GRAPH.replace("machines:", "_machines:").replace(", on: ground", "")
    )
    for arguments, reason in [
        (("graph.yaml", "--local", "--machine", "ground"), "choose one of --machine, --local"),
        (("graph.yaml", "--machine", "air"), "has no machine 'air'; it has onboard, ground"),
        (("plain.yaml", "--local"), "the graph plain names no machines"),
    ]:
        assert reason in run_for_json("run", *arguments, code=2)["reason"]


@pytest.mark.long
def test_parts_that_are_started_one_by_one_and_their_recordings_merged(here: Path) -> None:
    ports = [f"--set=machines.{name}=tcp/127.0.0.1:{free_port()}" for name in ("onboard", "ground")]
    command = [sys.executable, "-m", "aloft", "run", "graph.yaml", *ports, "--json", "--machine"]
    parts = [
        subprocess.Popen(
            [*command, name], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for name in ("ground", "onboard")
    ]
    for part, name in zip(parts, ("ground", "onboard"), strict=True):
        output, errors = part.communicate(timeout=120)
        assert part.returncode == 0, errors
        told = json.loads(output.splitlines()[-1])
        assert told["machine"] == name and told["recording"] == f"recordings/graph-{name}.rrd"
    files = [f"recordings/graph-{name}.rrd" for name in ("ground", "onboard")]
    merged = run_for_json("log", "merge", *files, "-o", "whole.rrd")
    assert merged["run_hash"] == alone()["run_hash"] and merged["ticks"] == 60
    assert "identical" in run_here("replay", "--check", "whole.rrd").stdout
    again = run_for_json("log", "merge", files[0], files[0], "-o", "x.rrd", code=2)
    assert "the recordings of onboard are missing" in again["reason"]
    shutil.copy(files[0], "copy.rrd")
    again = run_for_json("log", "merge", files[0], "copy.rrd", "-o", "x.rrd", code=2)
    assert "copy.rrd are both of machine 'ground'" in again["reason"]


OTHER_VERSION = (
    "import sys; from aloft.runtime.links import identity; identity.__version__ = '9.9'; "
    "from aloft.cli import main; main()"
)


@pytest.mark.long
@pytest.mark.parametrize(
    ("other", "what", "named"),
    [
        ("code", "code", ("'code of robot, pieces:Robot: ",)),
        ("graph", "graph", ("'duration: 300 ms' on onboard", "'duration: 301 ms' on ground")),
        ("version", "graph", (f"'aloft {__version__}' on onboard", "'aloft 9.9' on ground")),
    ],
)
def test_parts_with_other_files_or_versions_refuse_each_other_by_name(
    other: str, what: str, named: tuple[str, ...], here: Path
) -> None:
    ground = here / "other"
    ground.mkdir()
    (ground / "graph.yaml").write_text(GRAPH.replace("300", "301") if other == "graph" else GRAPH)
    changed = BLOCKS.replace("-0.3", "-0.4") if other == "code" else BLOCKS
    (ground / "pieces.py").write_text(changed)
    ports = [f"--set=machines.{name}=tcp/127.0.0.1:{free_port()}" for name in ("onboard", "ground")]
    words = ["run", "graph.yaml", *ports, "--json", "--no-record", "--machine"]
    start = ["-c", OTHER_VERSION] if other == "version" else ["-m", "aloft"]
    parts = [
        subprocess.Popen(
            [sys.executable, *begin, *words, name], cwd=folder, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
        )
        for name, folder, begin in (("ground", ground, start), ("onboard", here, ["-m", "aloft"]))
    ]  # fmt: skip
    for part in parts:
        found = result_of(part)
        assert found["exit_code"] == 3 and found["ticks"] == 0
        assert f"do not fit together: the {what} is" in found["reason"]
        for each in named:
            assert each in found["reason"]
    assert not (here / "enabled.txt").exists() and not (here / "damping.txt").exists()


# -- processes that are killed, frozen or interrupted ----------------------------------------------


@pytest.fixture
def started(here: Path) -> Iterator[subprocess.Popen[str]]:
    """A spread run that goes on for a minute, with its actuators enabled."""
    command = [
        sys.executable, "-m", "aloft", "run", "graph.yaml", "--local", "--json", "--no-record",
        "--set", "duration=60 s", "--set", "robot.pace=0.004",
    ]  # fmt: skip
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        end = time.monotonic() + 120.0
        while len(parts_of(process)) < 2 or not (here / "enabled.txt").exists():
            assert time.monotonic() < end and process.poll() is None
            time.sleep(0.05)
        time.sleep(1.0)
        yield process
    finally:
        for pid in [*parts_of(process).values(), process.pid]:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        process.communicate()


def parts_of(process: subprocess.Popen[str]) -> dict[str, int]:
    """The process of each machine."""
    found = {}
    for task in Path(f"/proc/{process.pid}/task").glob("*/children"):
        for pid in task.read_text().split():
            words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
            if b"--machine" in words:
                found[words[words.index(b"--machine") + 1].decode()] = int(pid)
    return found


def result_of(process: subprocess.Popen[str]) -> dict[str, Any]:
    output, errors = process.communicate(timeout=120)
    assert output, errors
    return dict(json.loads(output.splitlines()[-1]))


def wait_for_damping(folder: Path, since: float, limit: float) -> float:
    """The seconds until the first stop cycle after ``since``."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if (folder / "damping.txt").exists():
            times = [float(t) for t in (folder / "damping.txt").read_text().split()]
            if times:
                return times[0] - since
        time.sleep(0.005)
    raise AssertionError(f"no damping within {limit} s")


@pytest.mark.long
def test_a_part_that_is_killed(started: subprocess.Popen[str], here: Path) -> None:
    since = time.monotonic()
    os.kill(parts_of(started)["ground"], signal.SIGKILL)
    assert wait_for_damping(here, since, 60.0) < 30.0
    output, _ = started.communicate(timeout=120)
    told = json.loads(output.splitlines()[-1])
    assert not told["success"]
    assert "the part on 'ground' ended with code -9" in told["reason"]
    assert started.returncode != 0


@pytest.mark.long
def test_a_part_that_freezes(started: subprocess.Popen[str], here: Path) -> None:
    since = time.monotonic()
    ground = parts_of(started)["ground"]
    os.kill(ground, signal.SIGSTOP)
    assert wait_for_damping(here, since, 60.0) < 30.0
    os.kill(ground, signal.SIGCONT)  # it finds that the others have gone on without it
    result = result_of(started)
    assert result["exit_code"] == 3
    assert "is gone: its process froze, or the network to it is cut or too slow" in result["reason"]
    assert (
        "links.lease is 3 s; before, " in result["reason"] and "kB/s at 200 Hz" in result["reason"]
    )


@pytest.mark.long
def test_a_part_that_stands_still_for_less_than_the_lease_is_waited_for(
    started: subprocess.Popen[str], here: Path
) -> None:
    ground = parts_of(started)["ground"]
    os.kill(ground, signal.SIGSTOP)
    time.sleep(1.2)  # as a machine with ten busy processes for two processors does
    os.kill(ground, signal.SIGCONT)
    time.sleep(4.0)  # more than the lease
    assert started.poll() is None and not (here / "damping.txt").exists()
    started.send_signal(signal.SIGINT)
    assert result_of(started)["reason"] == "stopped by SIGINT"


@pytest.mark.long
def test_an_interrupt_ends_all_parts_after_one_tick(
    started: subprocess.Popen[str], here: Path
) -> None:
    started.send_signal(signal.SIGINT)
    result = result_of(started)
    assert started.returncode == result["exit_code"] == 130
    assert result["reason"] == "stopped by SIGINT"
    ticks = dict.fromkeys(part["ticks"] for part in result["machines"].values())
    assert list(ticks) == [result["ticks"]]
    assert len((here / "damping.txt").read_text().split()) == 5


@pytest.mark.long
def test_parts_stop_when_the_command_is_killed(started: subprocess.Popen[str], here: Path) -> None:
    parts = parts_of(started)
    since = time.monotonic()
    started.kill()
    assert wait_for_damping(here, since, 60.0) < 30.0
    assert all(is_gone(pid) for pid in parts.values())
    assert len((here / "damping.txt").read_text().split()) == 5


PARTS = """
import signal, time
from aloft.processes.child import report_ready

def print_much():
    print("x" * 1_000_000)

def hang():
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    print("I hang", flush=True)
    report_ready()
    time.sleep(600)
"""


def test_a_part_that_prints_much_and_one_that_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "parts_for_test.py").write_text(PARTS)
    monkeypatch.syspath_prepend(tmp_path)
    with ExitStack() as stack:
        running = {
            name: stack.enter_context(ChildProcess(name, f"parts_for_test:{name}", stdout=True))
            for name in ("print_much", "hang")
        }
        running["hang"].wait_until_ready(60.0)
        monkeypatch.setattr(run_machines, "GRACE", 0.2)
        outputs, received = run_machines._wait_for_all(running)
        assert len(outputs["print_much"]) == 1_000_001 and outputs["hang"] == b"I hang\n"
        assert running["hang"].wait(60.0) == -signal.SIGKILL and not received


VIEWED = """
rate: 200 Hz
duration: 300 ms
clock: {kind: paced}
links: {mode: free, max_age: 60 s, late: hold}
machines: {onboard: tcp/127.0.0.1:7450, ground: tcp/127.0.0.1:7451}
blocks:
  robot: {use: "pieces:Robot", with: {pace: 0.02}, in: {u: {value: 0.0}}}
  viewer: {use: "pieces:Controller", in: {u: robot.y}, on: ground}
"""


@pytest.mark.long
def test_a_free_part_from_which_nobody_reads_does_not_cut_the_others_short(here: Path) -> None:
    """Beside two busy loops; a tick of the robot takes four periods, so the viewer, which only reads,
    is at its end long before it."""
    (here / "viewed.yaml").write_text(VIEWED)
    with ExitStack() as stack:
        for _ in range(2):
            loop = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(loop.wait)
            stack.callback(loop.kill)
        found = run_parts_for_json("run", "viewed.yaml", "--local", "--no-record")
    assert found["success"], found["reason"]
    assert [part["ticks"] for part in found["machines"].values()] == [60, 60]
    assert len((here / "damping.txt").read_text().splitlines()) == 5
