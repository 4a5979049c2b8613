"""The reference block: the plan by time, and its errors."""

from __future__ import annotations

import time

import numpy as np
import pytest

from aloft.blocks.jumping.squat_jump_reference import SquatJumpReference
from aloft.blocks.signals import Phase
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def test_the_plan_is_made_within_a_second_and_runs_through_every_phase():
    begun = time.process_time()
    bench = BlockBench(SquatJumpReference, robot="bruce", rate=500.0)
    assert time.process_time() - begun < 1.0
    reference, phases = bench.get("reference"), []
    for tick in range(1500):
        bench.step()
        assert float(reference.time) == pytest.approx(tick * 0.002)
        assert np.linalg.norm(reference.orientation) == pytest.approx(1.0, abs=1e-12)
        if not phases or phases[-1] != int(reference.phase):
            phases.append(int(reference.phase))
    assert phases == [
        Phase.STAND, Phase.SQUAT, Phase.THRUST, Phase.FLIGHT, Phase.LANDING, Phase.RECOVER,
    ]  # fmt: skip


def test_it_goes_on_from_a_snapshot():
    bench = BlockBench(SquatJumpReference, robot="bruce")
    bench.step(550)
    snapshot = bench.snapshot()
    bench.step(20)
    wanted = bench.get("reference").joint_position.copy()
    bench.restore(snapshot)
    bench.step(20)
    assert (bench.get("reference").joint_position == wanted).all()


def test_it_needs_a_robot():
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(
            SquatJumpReference,
            dimensions={"n_joints": 10, "n_contacts": 4, "n_feet": 2, "n_velocities": 16},
        )
