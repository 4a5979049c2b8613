"""A whole turn in the air in closed loop, landed and stood."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.robots.example_robots import needs_robots

import aloft
from aloft.blocks.signals import Phase
from aloft.robots.description import find_robot
from aloft.runtime.loading import check

GRAPHS = Path(aloft.__file__).parent / "graphs"


def test_the_one_backwards_has_no_problems() -> None:
    assert check(GRAPHS / "somersault_backward_35cm.yaml").ok


@pytest.mark.long
@needs_robots
def test_go2_turns_over_backwards_with_its_real_motors() -> None:
    run = aloft.load(GRAPHS / "robots" / "go2_backflip.yaml", {"robot.seed": 1}).run()
    quaternion = run.signal("robot.truth.base_orientation")
    pitch = np.unwrap(2.0 * np.arctan2(quaternion[:, 1], quaternion[:, 3]))
    assert abs(pitch[-1] - pitch[0] + 2.0 * np.pi) < 0.1
    assert run.success, run.reason
    assert run.metrics["peak_motor_torque_nm"] <= find_robot("go2").motors.peak_torque.max()
    assert run.metrics["apex_above_standing_m"] > 0.35
    loads = run.signal("robot.truth.contact_force")[:, :, 2] > 1.0
    fore, hind = (loads[:, pair].any(axis=1) for pair in ([0, 1], [2, 3]))
    flight = int(np.argmax(run.signal("phase.phase.phase") == Phase.FLIGHT))
    last = [int(np.flatnonzero(each[:flight])[-1]) for each in (fore, hind)]
    assert 0.15 < 0.002 * (last[1] - last[0]) < 0.25, (
        "the fore feet leave 0.2 s before the hind ones"
    )


@pytest.mark.parametrize(
    "name", ["somersault", pytest.param("somersault_forward_35cm", marks=pytest.mark.long)]
)
def test_it_turns_once_lands_on_its_feet_and_stands(name: str) -> None:
    run = aloft.load(GRAPHS / f"{name}.yaml", {"robot.seed": 0}).run()
    phases = run.signal("phase.phase.phase")
    quaternion = run.signal("robot.truth.base_orientation")
    pitch = np.unwrap(2.0 * np.arctan2(quaternion[:, 1], quaternion[:, 3]))
    lift_off = int(np.argmax(phases == Phase.FLIGHT))
    assert phases[-1] == Phase.RECOVER
    assert abs(pitch[-1] - pitch[0] - 2.0 * np.pi) < 0.1
    assert pitch[int(np.argmax(phases == Phase.LANDING))] - pitch[lift_off] > np.radians(300.0)
    assert run.success, run.reason
    assert run.metrics["peak_motor_torque_nm"] <= 10.5
    assert run.metrics["forbidden_contacts"] == run.metrics["qp_failures"] == 0
