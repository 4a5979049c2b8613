"""The real robot's block against a twin behind pseudo-terminals: however a run ends, it is damped.

The graph runs in a process of its own and the twin in this one. Periods and time limits are long,
so that a busy machine changes no verdict.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

import aloft
from aloft.hal.bear.bus import open_port
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.protocol import Instruction, frame_bytes
from aloft.hal.simulated.simulated_robot import SimulatorParameters
from aloft.hal.twin.faults import Fault
from aloft.hal.twin.server import TwinServer
from aloft.hal.twin.twin import standing_twin
from aloft.robots.description import find_robot
from aloft.runtime.running.memory import BoundGraph

ROBOT = find_robot("bruce")
LONG = 60.0
"""No wait of a test lasts longer [s]."""
GRAPH = """
rate: 25 Hz
duration: {duration}
clock: {{kind: robot}}
robot: bruce
blocks:
  robot:
    use: hal.BearRobot
    with: {{hardware: bench.yaml, armed: {armed}, command_age: 1 s, graph_timeout: 2 s}}
    in: {{command: hold.command}}
  hold: {{use: "holding:Hold", with: {{hang_at: {hang_at}, fail_at: {fail_at}}}, in: {{joints: robot.joints}}}}
"""


@dataclass
class Bench:
    """A twin's server and a folder with a graph for it."""

    server: TwinServer
    folder: Path

    def start(self, **graph: Any) -> subprocess.Popen[str]:
        settings = {"duration": "1000 s", "armed": True, "hang_at": -1, "fail_at": -1, **graph}
        settings["armed"] = str(settings["armed"]).lower()
        (self.folder / "graph.yaml").write_text(GRAPH.format(**settings))
        return subprocess.Popen(
            [sys.executable, "-m", "aloft", "run", "graph.yaml", "--json", "--no-record"],
            cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": str(Path(aloft.__file__).parents[1])},
        )  # fmt: skip

    def states(self) -> set[int]:
        return {int(actuator.status["torque_enable"]) for actuator in self.server.twin.actuators}

    def wait_for(self, *states: int) -> None:
        end = time.monotonic() + LONG
        while not self.states() <= set(states):
            assert time.monotonic() < end, self.states()
            time.sleep(0.01)

    def wait_until_it_drives(self, process: subprocess.Popen[str]) -> None:
        end = time.monotonic() + LONG
        while not self.server.twin.released:
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < end
            time.sleep(0.01)
        assert self.states() <= {1, 3}  # on a busy machine damping may have come by now


def make_bench(folder: Path, *faults: Fault) -> TwinServer:
    hardware = Hardware.for_twin(ROBOT)
    bus = {"period": 0.02, "reply_time": 2.0, "lost_cycles": 3, "port": "x"}
    hardware = Hardware.model_validate(
        {
            **hardware.model_dump(),
            "bus": bus,
            "drives": {**hardware.drives.model_dump(), "watchdog": 5.0},
        }
    )
    params = SimulatorParameters(timestep=0.002)
    twin = standing_twin(ROBOT, params, hardware, tick=0.04, faults=faults)
    server = TwinServer(twin, virtual=False, period=0.02)
    data = hardware.model_dump(mode="json")
    data["bus"]["port"], data["board"]["port"] = server.bus_path, server.board_path
    (folder / "bench.yaml").write_text(yaml.safe_dump(data))
    shutil.copy(Path(__file__).with_name("holding.py"), folder)
    return server


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with make_bench(tmp_path) as server:
        yield Bench(server, tmp_path)


def result(process: subprocess.Popen[str]) -> dict[str, Any]:
    out, error = process.communicate(timeout=LONG)
    found: dict[str, Any] = json.loads(out[out.index("{") :]) if "{" in out else {}
    assert found, error
    return {**found, "code": process.returncode}


@pytest.mark.long
def test_a_run_comes_to_its_end_and_ends_in_damping(bench: Bench) -> None:
    for _ in range(3):  # a machine that stands still for a second is damped, and rightly so
        found = result(bench.start(duration="1 s"))
        if found["success"] or "no new command" not in found["reason"]:
            break
    assert found["success"], found
    assert bench.states() == {3}
    assert found["metrics"]["drives_at_end"] == "damped"
    assert found["metrics"]["bus_cycles"] > 25


@pytest.mark.long
def test_unarmed_nothing_is_written_to_the_drives(bench: Bench) -> None:
    found = result(bench.start(duration="1 s", armed=False))
    assert found["success"] and found["metrics"]["drives_at_end"] == "off"
    assert bench.states() == {0}
    assert {actuator.config["mode"] for actuator in bench.server.twin.actuators} == {0.0}


@pytest.mark.long
def test_a_block_that_raises(bench: Bench) -> None:
    found = result(bench.start(fail_at=10))
    assert "as the test wanted" in found["reason"] and found["code"] == 3
    assert bench.states() == {3}


@pytest.mark.long
def test_a_block_that_never_returns(bench: Bench) -> None:
    process = bench.start(hang_at=10)
    try:
        bench.wait_until_it_drives(process)
        bench.wait_for(3)
    finally:
        process.kill()
        process.communicate()


@pytest.mark.long
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_graph_that_is_killed_or_stands_still(bench: Bench, how: signal.Signals) -> None:
    # nothing of the graph's process runs any more: only the watchdog's process can damp
    process = bench.start()
    try:
        bench.wait_until_it_drives(process)
        process.send_signal(how)
        bench.wait_for(3)
    finally:
        process.kill()
        process.communicate()


@pytest.mark.long
def test_the_cable_is_pulled(tmp_path: Path) -> None:
    fault = Fault(kind="pulled_cable", start=0.5)
    with make_bench(tmp_path, fault) as server:
        bench = Bench(server, tmp_path)
        found = result(bench.start())
        assert "a port failed" in found["reason"], found
        bench.wait_for(2)  # by the drives' own watchdog: an error, and no torque


@pytest.mark.long
def test_a_second_writer_on_the_bus_is_refused(tmp_path: Path) -> None:
    with make_bench(tmp_path) as server:
        bench = Bench(server, tmp_path)
        server.twin.faults = type(server.twin.faults)([Fault(kind="second_writer")], 0)
        process = bench.start()
        bench.wait_until_it_drives(process)
        found = result(process)
        assert "another program or adapter sends instructions" in found["reason"], found
        assert bench.states() == {3}


@pytest.mark.long
def test_another_process_cannot_open_the_same_port(bench: Bench) -> None:
    port = open_port(bench.server.bus_path)
    try:
        found = result(bench.start())
        assert "cannot be opened" in found["reason"] and found["code"] == 3
        assert bench.states() == {0}
    finally:
        port.close()


@pytest.mark.long
def test_a_drive_that_is_not_there(bench: Bench) -> None:
    del bench.server.twin.bus.actuators[4]
    found = result(bench.start())
    assert "1 of 10 drives do not answer: right_knee_motor (address 4)" in found["reason"]
    assert bench.states() == {0}


def test_an_instruction_is_told_from_an_answer() -> None:
    # what the detection of a second writer rests on: the highest bit of the fifth byte
    instruction = frame_bytes(3, Instruction.READ_STATUS, b"\x09")
    answer = frame_bytes(3, 0x80, bytes(4))
    assert instruction[4] < 0x80 <= answer[4]


def test_the_kernel_of_the_goals_is_compiled_with_the_graph() -> None:
    """The driver opens later; goals by plain Python would take longer than all else in a cycle."""
    graph = aloft.load(Path(aloft.__file__).parent / "graphs" / "jump_robot.yaml")
    calls = BoundGraph(graph.checked).kernel_calls
    assert "aloft.hal.drive_control.make_goals" in [call.name for call in calls]
