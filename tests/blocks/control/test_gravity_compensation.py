"""The torque that holds an arm up is that of the pendulum, of a slide its weight."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aloft.blocks.control.gravity_compensation import GravityCompensation
from aloft.robots.description import RobotDescription
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench
from aloft.runtime.testing.conformance import check_block, conformance_cases

LINK = {"mass": 2.0, "com": [0.3, 0.0, 0.0], "inertia": [0.01, 0.1, 0.1, 0, 0, 0]}
ARM: dict[str, Any] = {
    "name": "lift", "base": "mast", "base_joint": "fixed",
    "links": [{"name": name, **LINK} for name in ("mast", "carriage", "beam")],
    "joints": [
        {"name": "lift", "kind": "slide", "parent": "mast", "child": "carriage",
         "origin": [0, 0, 0], "axis": [0, 0, 1]},
        {"name": "hinge", "parent": "carriage", "child": "beam", "origin": [0, 0, 0],
         "axis": [0, 1, 0]},
    ],
    "transmission": {"motors": ["one", "two"], "joint_to_motor": [[1, 0], [0, 1]]},
    "profiles": {"only": {"peak_torque": 50, "corner_speed": 5, "no_load_speed": 9,
                          "continuous_torque": 20, "rotor_inertia": 0.01, "friction": 0.1,
                          "damping": 0.1}},
}  # fmt: skip
ROBOT = RobotDescription.model_validate(ARM)


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.2, 3.0])
def test_a_beam_on_a_lift(angle: float) -> None:
    bench = BlockBench(GravityCompensation, robot=ROBOT)
    bench.set("joints", position=[0.7, angle], velocity=[3.0, -5.0])
    bench.step()
    # A positive turn about y lowers the beam, so it is held by a negative torque.
    expected = [4.0 * 9.81, -2.0 * 9.81 * 0.3 * math.cos(angle)]
    np.testing.assert_allclose(bench.get("torque").torque, expected, atol=1e-12)


def test_a_floating_robot_is_refused() -> None:
    with pytest.raises(BlockError, match="needs a robot on a fixed base; bruce has a floating one"):
        BlockBench(GravityCompensation, robot="bruce")


@pytest.mark.parametrize("case", conformance_cases())
def test_conformance(case: str) -> None:
    check_block(GravityCompensation, robot=ROBOT, cases=[case])
