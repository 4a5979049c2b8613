"""What the inverse kinematics does before its legs: where soles may be laid flat."""

from __future__ import annotations

import numpy as np

from aloft.blocks.control.leg_inverse_kinematics import LegInverseKinematics
from aloft.robots import five_joint_leg
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

HIP = five_joint_leg.read_leg(find_robot("bruce"), 0).hip


def test_where_the_toes_land_first_no_sole_is_laid_flat_to_keep_its_height():
    found = []
    for beyond, toes_first in (("slide", True), ("turn", False), ("slide", False)):
        bench = BlockBench(LegInverseKinematics, {"beyond": beyond}, robot="bruce")
        turn = np.array([[0.825, 0.0, 0.565], [0.0, 1.0, 0.0], [-0.565, 0.0, 0.825]])
        position = np.tile(HIP + turn @ np.array([-0.12, 0.0, -0.30]), (2, 1))
        bench.set("feet", position=position, rotation=np.tile(turn, (2, 1, 1)), velocity=0.0)
        bench.set("reference", toes_first=toes_first)
        bench.step()
        found.append(bench.get("target").position.tolist())
    assert found[0] == found[1] != found[2]
