"""A triggered plan waits before its beginning, and then is the plan that begins with a run."""

from __future__ import annotations

import pytest

from aloft.blocks.jumping.jump_plan import JumpPlan
from aloft.blocks.jumping.triggered_jump_plan import TriggeredJumpPlan
from aloft.blocks.signals import Phase
from aloft.runtime.testing import BlockBench

PARAMS = {"solve": False, "task": "tasks/in_situ_12cm.yaml"}


@pytest.mark.parametrize("ahead", [0.0, 0.004])
def test_after_the_trigger_it_is_the_plan_of_a_run_that_begins(ahead: float) -> None:
    late = BlockBench(TriggeredJumpPlan, PARAMS, robot="bruce", rate=500.0)
    usual = BlockBench(JumpPlan, PARAMS, robot="bruce", rate=500.0)
    for bench in (late, usual):
        bench.set("delay", delay=0.005, ahead=ahead)
    late.set("phase", phase=Phase.HANG)
    for _ in range(300):
        late.step()
        assert float(late.get("reference").time) < 0.0
    late.set("phase", phase=Phase.STAND)
    for _ in range(800):
        late.step()
        usual.step()
        mine, other = late.get("reference"), usual.get("reference")
        assert float(mine.time) == pytest.approx(float(other.time), abs=1e-9)
        assert mine.phase == other.phase
        assert mine.com == pytest.approx(other.com, abs=1e-9)
