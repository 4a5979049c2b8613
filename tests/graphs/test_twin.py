"""Jumps through the driver of the real robot: in a graph, behind serial ports, and replayed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import aloft
from aloft.hal.bear.configuration import Hardware
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.twin.server import TwinServer
from aloft.hal.twin.twin import standing_twin
from aloft.logs.recording.recorder import Recorder
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import replay
from aloft.robots.description import find_robot
from aloft.runtime.running.executor import Executor

from ..simulator_settings import grouped

GRAPHS = Path(aloft.__file__).parent / "graphs"
ROBOT = find_robot("bruce")
STANDARD = {
    "gyro_noise": 0.02, "gyro_bias": 0.01, "accelerometer_noise": 0.1, "accelerometer_bias": 0.1,
    "encoder_offset": 0.003, "joint_velocity_noise": 0.05, "switch_threshold": [0.5, 3.0],
    "switch_bounce": 0.002, "initial_attitude_error": 0.01, "jitter": 0.0005,
    "random_start_phase": True, "seed": 3,
}  # fmt: skip


@pytest.mark.long
def test_the_shipped_jump_lands_through_the_driver_and_is_replayed(tmp_path: Path) -> None:
    recording = tmp_path / "run.rrd"
    result = aloft.load(GRAPHS / "jump_twin.yaml").run(sinks=[Recorder(recording)], log=False)
    assert result.success, result.reason
    assert result.metrics["drives_at_end"] == "damped" and result.metrics["lost_answers"] == 0
    assert replay(OpenedRun.of(recording)).identical


@pytest.mark.long
def test_it_lands_although_answers_are_lost() -> None:
    graph = aloft.load(
        GRAPHS / "jump_twin.yaml", {"robot.faults": [{"kind": "lost", "share": 0.02}]}
    )
    result = Executor(graph.checked, log=False).run()
    assert result.success, result.reason
    assert result.metrics["lost_answers"] > 100  # type: ignore[operator]


def test_the_controllers_own_limits_act_before_the_drivers() -> None:
    """13.1 V are within the driver's limit of 13 V and below the safety monitor's of 13.2 V."""
    low = {"kind": "low_voltage", "start": 0.05, "value": 13.1, "target": "left_knee_motor"}
    graph = aloft.load(GRAPHS / "jump_twin.yaml", {"robot.faults": [low]})
    result = Executor(graph.checked, log=False).run()
    text = "drive left_knee_motor: 13.1 V is below lowest_voltage, 13.2 V without load"
    assert not result.success and result.reason == f"safety: {text}"
    assert result.metrics["safety_fault"] == "voltage" and result.metrics["safety_reason"] == text
    assert 0.05 < float(result.metrics["safety_fault_time_s"]) < 0.08  # type: ignore[arg-type]
    assert result.metrics["drives_at_end"] == "damped"


SWITCHES = [
    ("open_switch", "is stuck: it was open under a foot that stood", 0.3),
    pytest.param(
        "bouncing_switch", "bounces: it opened and closed too often", 0.7, marks=pytest.mark.long
    ),
    pytest.param("stuck_switch", "is stuck: it was closed in the air", 2.0, marks=pytest.mark.long),
]


@pytest.mark.parametrize(("kind", "text", "latest"), SWITCHES)
def test_a_bad_switch_ends_in_damping(kind: str, text: str, latest: float) -> None:
    """A switch that is stuck closed is ignored in the air: the robot lands first, then stops."""
    fault = {"kind": kind, "start": 0.02, "target": "left_heel"}
    result = Executor(
        aloft.load(GRAPHS / "jump_twin.yaml", {"robot.faults": [fault]}).checked, log=False
    ).run()
    assert not result.success and result.reason == f"safety: foot switch left_heel {text}"
    assert float(result.metrics["safety_fault_time_s"]) < latest  # type: ignore[arg-type]
    assert result.metrics["drives_at_end"] == "damped"
    if kind == "stuck_switch":
        assert float(result.metrics["apex_above_standing_m"]) > 0.1  # type: ignore[arg-type]
        assert float(result.metrics["peak_tilt_deg"]) < 15.0  # type: ignore[arg-type]


def run_behind_ports(folder: Path, *options: str) -> tuple[str, float]:
    """Run jump_robot.yaml in another process; gives its hash, and how high the twin's torso was."""
    hardware = Hardware.for_twin(ROBOT)
    twin = standing_twin(ROBOT, SimulatorParameters.model_validate(grouped(STANDARD)), hardware)
    highest, send = 0.0, twin._send_packet

    def watched() -> None:
        nonlocal highest
        highest = max(highest, float(twin.plant.data.qpos[2]))
        send()

    twin._send_packet = watched  # type: ignore[method-assign]
    with TwinServer(twin, virtual=True, period=0.001) as server:
        data = hardware.model_dump(mode="json")
        data["bus"] |= {"port": server.bus_path, "time": "virtual", "reply_time": 5.0}
        data["board"] |= {"port": server.board_path}
        (folder / "twin.yaml").write_text(yaml.safe_dump(data))
        done = subprocess.run(
            [
                sys.executable, "-m", "aloft", "run", str(GRAPHS / "jump_robot.yaml"), "--json",
                "--no-record", "--set", f"robot.hardware={folder / 'twin.yaml'}", "--set", "robot.time=virtual",
                "--set", "robot.armed=true", "--set", "robot.latency=2ms", *options,
            ],
            capture_output=True, text=True, timeout=600, check=False,
            env={**os.environ, "PYTHONPATH": str(Path(aloft.__file__).parents[1])},
        )  # fmt: skip
    found = json.loads(done.stdout[done.stdout.index("{") :])
    assert found["success"], found["reason"]
    assert {actuator.status["torque_enable"] for actuator in twin.actuators} == {3}
    return found["run_hash"], highest


@pytest.mark.long
def test_the_same_bytes_behind_serial_ports_in_every_run(tmp_path: Path) -> None:
    _, highest = run_behind_ports(tmp_path)
    assert highest > 0.45, "it has jumped: it stands at 0.38 m"
    squats = {run_behind_ports(tmp_path, "--duration", "0.5 s")[0] for _ in range(2)}
    assert len(squats) == 1
