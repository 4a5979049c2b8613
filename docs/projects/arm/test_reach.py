"""``python -m pytest`` in this folder."""

from pathlib import Path

import numpy as np
import pytest
from reach import Reach

import aloft
from aloft.robots.description import find_robot
from aloft.runtime.language.context import Clock, Context
from aloft.runtime.testing.bench import BlockBench
from aloft.runtime.testing.conformance import check_block, conformance_cases

HERE = Path(__file__).parent
ARM = find_robot("arm.xml", HERE)


def test_begins_at_the_measured_joints_and_ends_at_the_target():
    bench = BlockBench(Reach, {"target": [1.0, 0.5, 0.0, 0.0], "duration": 0.1}, robot=ARM)
    bench.set("joints", position=[0.2, 0.5, -0.1, 0.0])
    bench.set("gravity", torque=[0.0, 1.0, 2.0, 3.0])
    bench.step()
    command = bench.get("command")
    assert command.position == pytest.approx([0.2, 0.5, -0.1, 0.0])
    assert command.velocity == pytest.approx(0.0)
    bench.step(25)
    assert command.position == pytest.approx([0.6, 0.5, -0.05, 0.0])
    assert command.velocity[0] == pytest.approx(0.8 * 1.875 / 0.1)
    bench.step(50)
    assert command.position == pytest.approx([1.0, 0.5, 0.0, 0.0])
    assert command.torque == pytest.approx([0.0, 1.0, 2.0, 3.0])


def test_a_target_beyond_a_limit_is_refused():
    (unmet,) = Reach.requires(
        Reach.Params(target=[0.0, 3.0, 0.0, 0.0]), Context("block", Clock(0.002), robot=ARM)
    )
    assert (unmet.message, unmet.expected) == ("shoulder cannot go there", "-1.8 to 1.8 rad")


@pytest.mark.parametrize("case", conformance_cases())
def test_keeps_every_blocks_promises(case):
    check_block(Reach, robot=ARM, cases=[case])


@pytest.mark.parametrize("target", [[0.8, -0.2, 0.9, -0.7], [-2.0, 0.5, -1.0, 1.0]])
def test_the_arm_gets_there(target):
    result = aloft.load(HERE / "reach.yaml", [f"reach.target={target}"]).run()
    assert result.success
    assert result.metrics["target_error_rad"] < 0.01
    assert np.isfinite(result.metrics["target_error_rad"])
