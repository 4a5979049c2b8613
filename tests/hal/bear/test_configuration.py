"""The file of the hardware: what is shipped fits, and every fault is named with its place."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

import aloft
from aloft.hal.bear.configuration import Hardware, HardwareError
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
SHIPPED = Path(aloft.__file__).parent / "graphs" / "hardware" / "bruce.yaml"


def test_the_shipped_file_is_of_bruce() -> None:
    hardware = Hardware.read(SHIPPED, ROBOT)
    assert [motor.id for motor in hardware.motors.values()] == list(range(1, 11))
    assert tuple(hardware.motors) == ROBOT.transmission.motors
    assert hardware.board.gyro_range == pytest.approx(8.7266, abs=1e-3)
    assert hardware.dead_man.kind == "gamepad"


def test_a_twins_is_without_fault() -> None:
    for name in ("bruce", "go2", "solo12", "talos"):
        robot = find_robot(name)
        made = Hardware.for_twin(robot)
        assert made.find_faults(robot) == []
        peak = robot.motors.peak_torque.max() / made.drives.torque_constant
        assert peak <= made.drives.current_limit - made.drives.current_margin + 1e-9


def test_every_fault_has_its_place(tmp_path: Path) -> None:
    data = yaml.safe_load(SHIPPED.read_text())
    data["motors"]["left_knee_motor"]["id"] = 4
    data["motors"]["left_ankle"] = data["motors"].pop("left_ankle_motor")
    data["board"]["switches"][1] = "right_hel"
    data["board"]["normally_closed"] = ["left_toes"]
    data["drives"]["lowest_voltage"] = "18 V"
    data["motors"]["right_yaw_motor"] |= {"low": 1.0, "high": 0.5}
    file = tmp_path / "bench.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(HardwareError) as caught:
        Hardware.read(file, ROBOT)
    text = str(caught.value)
    for part in (
        "left_knee_motor and right_knee_motor have the same address 4",
        "bruce has no motor 'left_ankle'; did you mean left_ankle_motor?",
        "motor left_ankle_motor is missing",
        "bruce has no contact point 'right_hel': right_toe, right_heel, left_toe, left_heel",
        "'left_toes' is none of board.switches: right_toe, right_hel, left_toe, left_heel",
        "lowest_voltage is above highest_voltage",
        "right_yaw_motor: low 1 is not below high 0.5",
        "bench.yaml: 7 problems",
    ):
        assert part in text, text
    heads = [line for line in text.splitlines() if line and not line.startswith("    ")]
    assert len(heads) == 8 and all(line.startswith(f"{file}:") for line in heads)


def test_another_robots_file_is_refused() -> None:
    with pytest.raises(HardwareError, match="this is the hardware of bruce, not of go2"):
        Hardware.read(SHIPPED, find_robot("go2"))
