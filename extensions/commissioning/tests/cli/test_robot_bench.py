"""The verbs for a robot on a bench, against a twin behind serial ports."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from tests.cli.conftest import run_here

from aloft.hal.bear.configuration import Hardware
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.twin.server import TwinServer
from aloft.hal.twin.twin import standing_twin
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, TwinServer]]:
    hardware = Hardware.for_twin(ROBOT)
    twin = standing_twin(ROBOT, SimulatorParameters(timestep=0.001), hardware)
    with TwinServer(twin, virtual=True, period=0.001) as server:
        data = hardware.model_dump(mode="json")
        data["bus"] |= {"port": server.bus_path, "reply_time": 0.3}
        data["board"] |= {"port": server.board_path}
        path = tmp_path_factory.mktemp("bench") / "bench.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False))
        yield str(path), server


def test_status_and_watch(file: tuple[str, TwinServer]) -> None:
    found = json.loads(run_here("robot", "status", file[0], "--json").stdout)
    assert [row["id"] for row in found["drives"]] == list(range(1, 11))
    assert "right_knee_motor" in run_here("robot", "status", file[0]).stdout
    found = json.loads(run_here("robot", "watch", file[0], "--seconds", "0", "--json").stdout)
    assert found["answered"] == 10
    assert found["joints"]["left_knee"] == pytest.approx(-0.8, abs=0.03)


def test_calibrate_prints_what_the_file_needs(file: tuple[str, TwinServer]) -> None:
    text = run_here("robot", "zero", file[0], "--standing").stdout
    motors = yaml.safe_load(text)["motors"]
    assert list(motors) == list(ROBOT.transmission.motors)
    assert all(abs(motor["offset"]) < 0.05 for motor in motors.values())


def test_jog_refuses_without_arm(file: tuple[str, TwinServer]) -> None:
    done = run_here("robot", "jog", file[0], "right_yaw_motor", "0.1", code=2)
    assert "right_yaw_motor was not moved: jog switches a drive on only with --arm" in (
        done.stdout + done.stderr
    )
    assert {a.status["torque_enable"] for a in file[1].twin.actuators} == {0.0}


def test_jog_and_estop(file: tuple[str, TwinServer]) -> None:
    found = json.loads(
        run_here(
            "robot", "jog", file[0], "right_yaw_motor", "0.1", "--seconds", "0.5", "--arm", "--json"
        ).stdout
    )
    # the gantry holds the joint much more stiffly than jog pushes it
    assert 0.001 < abs(found["reached_rad"]) < 0.1
    assert next(a.status["torque_enable"] for a in file[1].twin.actuators) == 3
    assert "all 10 drives are in damping" in run_here("robot", "estop", file[0]).stdout
    assert {a.status["torque_enable"] for a in file[1].twin.actuators} == {3}


@pytest.mark.long
def test_scan(file: tuple[str, TwinServer]) -> None:
    found = json.loads(run_here("robot", "scan", file[0], "--last", "11", "--json").stdout)
    assert [drive["device"] for drive in found["drives"]] == list(range(1, 11))
    assert found["missing"] == []


def test_wrong_files(tmp_path: Path) -> None:
    done = run_here("robot", "status", str(tmp_path / "no.yaml"), code=2)
    text = done.stdout + done.stderr
    assert "no.yaml: No such file" in text and "1 problem" in text
    bad = tmp_path / "bad.yaml"
    bad.write_text(
        "robot: bruce\nbus: {port: x, speed: 3}\nboard: {port: y}\nmotors: {a: {id: 300}}\n"
    )
    done = run_here("robot", "status", str(bad), code=2)
    text = done.stdout + done.stderr
    assert "bad.yaml:2:16: unknown-key: 'speed' is not a key of bus" in text
    assert "expected   port, baudrate, period" in text
    assert "bad.yaml:4:18: bad-value: motors.a.id cannot be 300" in text
    assert "expected   at most 252" in text and "2 problems" in text


def test_the_schema_is_one() -> None:
    schema = json.loads(run_here("robot", "schema").stdout)
    assert set(schema["required"]) == {"robot", "bus", "board", "motors"}


def test_bring_up_on_the_twin(tmp_path: Path) -> None:
    path = tmp_path / "bench.yaml"
    path.write_text(yaml.safe_dump(Hardware.for_twin(ROBOT).model_dump(mode="json")))
    text = run_here("robot", "bring-up", str(path), code=2)
    assert "give --yes" in text.stdout + text.stderr
    before_power = ("robot", "bring-up", str(path), "--yes", "--last", "switches")
    found = json.loads(run_here(*before_power, "--json").stdout)
    assert found["success"] and found["steps"][-1]["step"] == "switches"
    again = json.loads(run_here(*before_power, "--json").stdout)
    assert again["steps"] == []
    text = run_here("robot", "bring-up", str(path), "--yes", "--last", "jump", code=2)
    assert "there is no step 'jump': robot, drives, directions," in text.stdout + text.stderr


def test_bring_up_asks_nobody_on_a_twin_only(file: tuple[str, TwinServer]) -> None:
    done = run_here("robot", "bring-up", file[0], "--yes", code=2)
    assert "whose two ports are `twin`" in done.stdout + done.stderr
