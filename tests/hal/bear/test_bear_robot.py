"""The real robot's block against a twin behind pseudo-terminals: however a run ends, it is damped.

The graph runs in a process of its own and the twin in this one. Periods and time limits are long,
so that a busy machine changes no verdict.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

import aloft
from aloft.blocks.signals import DrivePhase
from aloft.hal.bear.bear_robot import BearRobot
from aloft.hal.bear.bus import open_port
from aloft.hal.bear.configuration import Hardware, HardwareError
from aloft.hal.bear.driven_robot import read_hardware
from aloft.hal.bear.protocol import Instruction, frame_bytes
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.twin.injected_faults import InjectedFault
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


def make_bench(folder: Path, *faults: InjectedFault) -> TwinServer:
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


def undisturbed(attempt: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The result of a run in which this machine did not stand still, in three attempts.

    When it stands still for a second the drives are damped, and rightly so."""
    for _ in range(3):
        found = attempt()
        if not re.search("no new command|the graph hung", found["reason"]):
            break
    return found


@pytest.mark.long
def test_a_run_comes_to_its_end_and_ends_in_damping(bench: Bench) -> None:
    found = undisturbed(lambda: result(bench.start(duration="1 s")))
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
    found = undisturbed(lambda: result(bench.start(fail_at=10)))
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
    def pull() -> dict[str, Any]:
        with make_bench(tmp_path, InjectedFault(kind="pulled_cable", start=0.5)) as server:
            bench = Bench(server, tmp_path)
            found = result(bench.start())
            if "a port failed" in found["reason"]:
                bench.wait_for(2)  # by the drives' own watchdog: an error, and no torque
            return found

    assert "a port failed" in (found := undisturbed(pull))["reason"], found


@pytest.mark.long
def test_the_boards_cable_is_pulled_and_the_drives_are_damped_at_once(tmp_path: Path) -> None:
    def pull() -> dict[str, Any]:
        with make_bench(tmp_path, InjectedFault(kind="pulled_board", start=0.5)) as server:
            found = result(Bench(server, tmp_path).start())
            assert Bench(server, tmp_path).states() == {3}, "not by their own watchdog, after 5 s"
            return found

    found = undisturbed(pull)
    assert "the port of the sensor board failed" in found["reason"], found


@pytest.mark.long
def test_a_second_writer_on_the_bus_is_refused(tmp_path: Path) -> None:
    def disturb() -> dict[str, Any]:
        with make_bench(tmp_path) as server:
            bench = Bench(server, tmp_path)
            server.twin.faults = type(server.twin.faults)([InjectedFault(kind="second_writer")], 0)
            process = bench.start()
            bench.wait_until_it_drives(process)
            found = result(process)
            assert bench.states() == {3}
            return found

    found = undisturbed(disturb)
    assert "another program or adapter sends instructions" in found["reason"], found


@pytest.mark.long
def test_somebody_calls_the_emergency_stop_while_a_graph_holds_the_port(bench: Bench) -> None:
    def stop() -> dict[str, Any]:
        process = bench.start()
        bench.wait_until_it_drives(process)
        done = subprocess.run(
            [sys.executable, "-m", "aloft", "robot", "estop", "bench.yaml", "--json"],
            cwd=bench.folder, capture_output=True, text=True, check=False, timeout=LONG,
            env={**os.environ, "PYTHONPATH": str(Path(aloft.__file__).parents[1])},
        )  # fmt: skip
        found = result(process)
        assert bench.states() == {3}
        return {**found, "estop": json.loads(done.stdout)}

    found = undisturbed(stop)
    assert found["reason"].endswith("`aloft robot estop` has damped the drives")
    assert found["estop"]["success"]


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


def test_an_armed_robot_in_real_time_is_not_run_as_fast_as_it_goes(tmp_path: Path) -> None:
    file = tmp_path / "bench.yaml"
    file.write_text(Hardware.for_twin(ROBOT).at_ports("nowhere", "nowhere", virtual=False))
    graphs = Path(aloft.__file__).parent / "graphs"
    armed = {"robot.hardware": str(file), "robot.armed": True}
    for clock, reason in (
        ("free", "--set clock.kind=robot"),
        ("robot", "nowhere cannot be opened"),
    ):
        graph = aloft.load(graphs / "jump_robot.yaml", {**armed, "clock.kind": clock})
        result = graph.run(0.1)
        assert not result.success and reason in result.reason


def test_the_kernel_of_the_goals_is_compiled_with_the_graph() -> None:
    """The driver opens later; goals by plain Python would take longer than all else in a cycle."""
    graph = aloft.load(Path(aloft.__file__).parent / "graphs" / "jump_robot.yaml")
    calls = BoundGraph(graph.checked).kernel_calls
    assert "aloft.hal.drive_control.make_goals" in [call.name for call in calls]


def block(**values: Any) -> SimpleNamespace:
    """What the methods of the block read: periods of 1 ms and ticks of 4 ms, nothing else."""
    params = SimpleNamespace(time="real", graph_timeout=0.04, command_age=0.02)
    bus = SimpleNamespace(period=0.001)
    found = SimpleNamespace(
        params=params, period=0.004, _hardware=SimpleNamespace(bus=bus), _next_tick=0, _thread=None,
        _queue=None, _watchdog=None, _switch=SimpleNamespace(held=lambda: True), driver=None,
        context=SimpleNamespace(clock=SimpleNamespace(command_limit=0.0)),
    )  # fmt: skip
    for name, value in values.items():
        setattr(found, name, value)
    return found


def test_ticks_begin_with_every_fourth_cycle_and_those_that_are_over_are_missed() -> None:
    waited: list[tuple[int, float]] = []

    def wait_for(cycle: int, seconds: float) -> bool:
        waited.append((cycle, seconds))
        return True

    robot = block(_thread=SimpleNamespace(done=0, wait_for=wait_for))
    missed = []
    for done in (0, 4, 9, 21, 23, 24):
        robot._thread.done = done
        missed.append(BearRobot.wait(robot))  # type: ignore[arg-type]
    assert missed == [0, 0, 0, 1, 0, 0]
    assert [cycle for cycle, _ in waited] == [4, 8, 12, 20, 24, 28]
    assert all(seconds > 0.0 for _, seconds in waited)
    assert BearRobot.wait(block()) == 0  # type: ignore[arg-type]


def test_a_motor_thread_that_makes_no_cycle_is_a_fault() -> None:
    faults: list[str] = []
    loop = SimpleNamespace(fail=faults.append)
    stopped: list[bool] = []
    robot = block(
        _thread=SimpleNamespace(done=0, wait_for=lambda cycle, seconds: False),
        _driver=SimpleNamespace(loop=loop), stop_after_fault=lambda: stopped.append(True),
    )  # fmt: skip
    assert BearRobot.wait(robot) == 0  # type: ignore[arg-type]
    assert faults == ["the motor thread made no cycle for 1 s"] and stopped == [True]


def test_why_the_motor_thread_must_not_go_on() -> None:
    def reason(robot: SimpleNamespace) -> str:
        return BearRobot._stop_reason(robot)  # type: ignore[arg-type]

    assert reason(block()) == ""
    let_go = SimpleNamespace(held=lambda: False)
    assert reason(block(_switch=let_go)) == "the dead man's switch was let go"
    for tripped in (True, False):
        robot = block(_watchdog=SimpleNamespace(tripped=tripped, asked=False))
        assert reason(robot).endswith("the graph hung for 40 ms") == tripped
    robot = block(_watchdog=SimpleNamespace(tripped=True, asked=False))
    robot._watchdog.asked = True
    assert reason(robot) == "`aloft robot estop` has damped the drives"
    robot._watchdog.asked = False
    robot.context.clock.command_limit = 0.015
    assert reason(robot).endswith("or no commands came over the links for 15 ms")


@pytest.mark.parametrize(("limit", "age"), [(0.0, 0.02), (0.015, 0.015), (0.05, 0.02)])
def test_a_command_may_be_as_old_as_the_stricter_limit(limit: float, age: float) -> None:
    robot = block()
    robot.context.clock.command_limit = limit
    assert BearRobot.oldest_command.fget(robot) == age  # type: ignore[attr-defined]


def test_closing_ends_whatever_has_been_opened_and_the_drives_last() -> None:
    ended: list[str] = []
    parts = {
        "_thread": SimpleNamespace(stop=lambda: ended.append("thread")),
        "_watchdog": SimpleNamespace(close=lambda: ended.append("watchdog")),
        "_switch": SimpleNamespace(close=lambda: ended.append("switch")),
        "driver": SimpleNamespace(close=lambda: ended.append("driver")),
    }
    BearRobot.close(block(**parts))  # type: ignore[arg-type]
    assert ended == ["thread", "watchdog", "switch", "driver"]
    BearRobot.close(block(_switch=parts["_switch"]))  # type: ignore[arg-type]
    assert ended[4:] == ["switch"]


@pytest.mark.parametrize("phase", [DrivePhase.OFF, DrivePhase.DRIVING])
def test_damping_waits_for_two_cycles_and_leaves_drives_that_are_off(phase: DrivePhase) -> None:
    waited: list[int] = []
    thread = SimpleNamespace(done=7, wait_for=lambda cycle, seconds: waited.append(cycle))
    damped: list[int] = []
    loop = SimpleNamespace(link_lost=False, phase=phase)
    driver = SimpleNamespace(loop=loop, damp=damped.append)
    BearRobot.damp(block(driver=driver, _thread=thread))  # type: ignore[arg-type]
    assert waited == [9] and damped == []
    assert loop.phase is (DrivePhase.OFF if phase is DrivePhase.OFF else DrivePhase.DAMPED)
    BearRobot.damp(block(driver=driver))  # type: ignore[arg-type]
    BearRobot.damp(block(driver=driver, _queue=SimpleNamespace(cycles=4)))  # type: ignore[arg-type]
    assert damped == [1, 4]
    loop.link_lost = True
    BearRobot.damp(block(driver=driver, _thread=thread))  # type: ignore[arg-type]
    BearRobot.damp(block())  # type: ignore[arg-type]
    assert waited == [9] and damped == [1, 4]


def test_the_time_of_a_twin_is_that_of_its_exchanges() -> None:
    robot = block(_driver=SimpleNamespace(loop=SimpleNamespace(cycles=250)))
    robot.params.time = "virtual"
    assert BearRobot.now(robot) == pytest.approx(0.25)  # type: ignore[arg-type]
    opened = time.monotonic() - 3.0
    robot.params.time, robot._opened_at = "real", opened
    now = BearRobot.now(robot)  # type: ignore[arg-type]
    assert 3.0 <= now <= time.monotonic() - opened


def test_periods_of_the_soft_start_follow_one_another() -> None:
    robot = block(_cycle=time.monotonic())
    start = robot._cycle
    for k in range(1, 6):
        assert BearRobot._next_cycle(robot)  # type: ignore[arg-type]
        assert time.monotonic() >= start + 0.001 * k
    robot._cycle = time.monotonic() - 10.0  # far too late: it goes on from now
    before = time.monotonic()
    BearRobot._next_cycle(robot)  # type: ignore[arg-type]
    assert before - 1e-6 <= robot._cycle <= time.monotonic()
    robot._switch = SimpleNamespace(held=lambda: False)
    assert not BearRobot._next_cycle(robot)  # type: ignore[arg-type]
    robot.params.time = "virtual"
    assert BearRobot._next_cycle(robot)  # type: ignore[arg-type]


def test_commands_go_to_the_thread_or_to_the_next_exchanges() -> None:
    followed: list[object] = []
    thread = SimpleNamespace(follow=lambda *given: followed.append(given))
    watchdog = SimpleNamespace(beat=lambda last: followed.append(last))
    queue = SimpleNamespace(
        give=lambda given: followed.append(given), advance=lambda: followed.append("on")
    )
    common = {"command": "c", "stop_after_fault": lambda: None}
    robot = block(_thread=thread, _watchdog=watchdog, **common)
    robot.context.clock.commands_heard = lambda: 17
    BearRobot.write(robot)  # type: ignore[arg-type]
    BearRobot.advance(robot)  # type: ignore[arg-type]
    assert followed == [17, ("c", 17)]
    followed.clear()
    robot = block(_queue=queue, **common)
    robot.context.clock.commands_heard = lambda: 0
    BearRobot.write(robot)  # type: ignore[arg-type]
    BearRobot.advance(robot)  # type: ignore[arg-type]
    assert followed == ["c", "on"]


@pytest.mark.parametrize(
    ("period", "fits"),
    [(0.001, True), (0.004, True), (0.0025, False), (0.0005, False), (0.04, True)],
)
def test_the_control_period_is_a_whole_number_of_the_buss(period: float, fits: bool) -> None:
    params = BearRobot.Params(**BearRobot.example_parameters())
    context = SimpleNamespace(robot=ROBOT, period=period, folder=Path("/"), graph_folder=Path("/"))
    found = list(BearRobot.requires(params, context))  # type: ignore[arg-type]
    assert (found == []) == fits
    assert fits or "does not divide the control period" in str(found[0])


@pytest.mark.parametrize(
    ("armed", "port", "marked", "refused"),
    [
        (True, "/dev/ttyUSB0", False, True),
        (True, "/dev/ttyUSB0", True, True),  # the file of a twin, with a real port written over
        (True, "/dev/pts/7", False, True),
        (True, "/dev/pts/7", True, False),
        (False, "/dev/ttyUSB0", False, False),
    ],
)
def test_only_a_twin_may_be_armed_in_virtual_time(
    tmp_path: Path, armed: bool, port: str, marked: bool, refused: bool
) -> None:
    data = Hardware.for_twin(ROBOT).model_dump(mode="json")
    data["bus"] |= {"port": port, "time": "virtual" if marked else "real"}
    (tmp_path / "bench.yaml").write_text(yaml.safe_dump(data))
    params = BearRobot.Params(hardware="bench.yaml", time="virtual", armed=armed)
    context = SimpleNamespace(robot=ROBOT, period=0.002, folder=tmp_path, graph_folder=tmp_path)
    found = list(BearRobot.requires(params, context))  # type: ignore[arg-type]
    assert [each.parameter for each in found] == (["time"] if refused else [])
    if refused:
        assert f"in virtual time nothing guards the drives at {port}" in found[0].message


@pytest.mark.parametrize("fault", ["", "drive left_knee_motor has not answered"])
def test_a_fault_of_the_drives_is_no_success(fault: str) -> None:
    loop = SimpleNamespace(phase=DrivePhase.DAMPED, lost_answers=3, cycles=17, fault=fault)
    stopped: list[str] = []
    robot = block(
        driver=SimpleNamespace(loop=loop), _driver=SimpleNamespace(loop=loop), robot=ROBOT,
        params=BearRobot.Params(**BearRobot.example_parameters()), request_stop=stopped.append,
        context=SimpleNamespace(path="robot"),
    )  # fmt: skip
    found = dict(BearRobot.metrics(robot))  # type: ignore[arg-type]
    assert (found["drives_at_end"], found["lost_answers"], found["bus_cycles"]) == ("damped", 3, 17)
    assert found.get("success", True) == (not fault)
    assert found.get("reason") == (f"robot: {fault}" if fault else None)
    BearRobot.stop_after_fault(robot)  # type: ignore[arg-type]
    assert stopped == ([fault] if fault else [])
    assert BearRobot.metrics(block()) == {}  # type: ignore[arg-type]


def test_the_file_of_the_hardware_is_looked_for_beside_the_graph(tmp_path: Path) -> None:
    shipped = Path(BearRobot.example_parameters()["hardware"])
    (tmp_path / "inner").mkdir()
    context = SimpleNamespace(folder=tmp_path / "inner", graph_folder=tmp_path)
    with pytest.raises(HardwareError, match="there is no file bench") as caught:
        read_hardware("bench.yaml", context, ROBOT)  # type: ignore[arg-type]
    assert str(tmp_path / "inner" / "bench.yaml") in str(caught.value)
    shutil.copy(shipped, tmp_path / "bench.yaml")
    assert read_hardware("bench.yaml", context, ROBOT).motors  # type: ignore[arg-type]
