"""A controller on another machine falls silent: the drives are damped from outside the graph's process.

The robot's part and the controller's part are processes that talk over Zenoh, and the twin behind
pseudo-terminals is in this one. All policies are to hold, so only the watchdog ends the driving.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import aloft

from .test_bear_robot import Bench, make_bench, result

GRAPH = """
rate: 25 Hz
duration: 1000 s
clock: {{kind: robot}}
robot: bruce
machines: {{onboard: tcp/127.0.0.1:{0}, ground: tcp/127.0.0.1:{1}}}
links: {{mode: free, max_age: 100 s, late: hold, watchdog: 900 ms}}
blocks:
  robot:
    use: hal.BearRobot
    with: {{hardware: bench.yaml, armed: true, command_age: 1 s, graph_timeout: 2 s}}
    in: {{command: hold.command}}
  hold: {{use: "holding:Hold", in: {{joints: robot.joints}}, on: ground}}
"""


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with make_bench(tmp_path) as server:
        yield Bench(server, tmp_path)


@pytest.fixture
def parts(bench: Bench) -> Iterator[dict[str, subprocess.Popen[str]]]:
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(2)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        ports = [each.getsockname()[1] for each in sockets]
    (bench.folder / "graph.yaml").write_text(GRAPH.format(*ports))
    command = [sys.executable, "-m", "aloft", "run", "graph.yaml", "--json", "--no-record"]
    running = {
        machine: subprocess.Popen(
            [*command, "--machine", machine], cwd=bench.folder, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": str(Path(aloft.__file__).parents[1])},
        )
        for machine in ("onboard", "ground")
    }  # fmt: skip
    yield running
    for process in running.values():
        process.kill()
        process.communicate()


@pytest.mark.long
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_controller_that_is_killed_or_stands_still(
    bench: Bench, parts: dict[str, subprocess.Popen[str]], how: signal.Signals
) -> None:
    bench.wait_until_it_drives(parts["onboard"])
    parts["ground"].send_signal(how)
    bench.wait_for(3)
    found = result(parts["onboard"])
    # On a loaded machine the drives' own watchdog may be seen before the part gives up waiting.
    late = re.search(r"\b9\d\d ms", found["reason"])
    assert late or "watchdog ran out" in found["reason"], found
    assert found["metrics"]["drives_at_end"] == "damped"


@pytest.mark.long
def test_a_controller_and_a_robots_part_that_both_stand_still(
    bench: Bench, parts: dict[str, subprocess.Popen[str]]
) -> None:
    bench.wait_until_it_drives(parts["onboard"])
    for process in parts.values():
        process.send_signal(signal.SIGSTOP)
    bench.wait_for(3)
