"""The tick's benchmark: that its cases compute the same; how fast they are is for ``aloft bench``."""

import json
from importlib.util import find_spec

import numpy as np
import pytest

from aloft.lab.benchmarks.tick.controller import (
    OUTSIDE,
    HandWrittenLoop,
    RecordedController,
    RecordedJump,
    record_jump,
)  # fmt: skip
from aloft.lab.benchmarks.tick.programs import (
    BARE,
    COMPILED,
    FUSED,
    HAND,
    OSQP,
    PLAIN,
    QP_OSQP,
    WHOLE_BODY,
    WHOLE_BODY_TSID,
    OsqpController,
)  # fmt: skip
from aloft.lab.benchmarks.tick.tick import late_share, tick


@pytest.fixture(scope="module")
def jump() -> RecordedJump:
    return record_jump(60)


@pytest.mark.long
def test_rows_are_complete_and_say_what_is_missing() -> None:
    rows = {row.name: row for row in tick(rounds=1, ticks=60, process=False)}
    for name in (PLAIN, COMPILED, FUSED, HAND, BARE, OSQP, WHOLE_BODY, "block wbc", "block legs"):
        assert name in rows
        assert rows[name].value or "not installed" in rows[name].note
    assert not {f"block {path}" for path in OUTSIDE} & set(rows)
    assert (rows[BARE].peer, rows[BARE].floor, rows[BARE].goal) == (HAND, 1.05, 1.02)
    assert "aloft bench tick --tsid" in rows[WHOLE_BODY_TSID].note
    assert "--since COMMIT" in rows["controller of an earlier commit"].note
    assert rows["whole-body program, beside DAQP"].floor == pytest.approx(1 / 1.8)
    installed = find_spec("osqp") is not None
    assert (rows[QP_OSQP].value is not None) == installed
    json.dumps([row.to_json() for row in rows.values()], allow_nan=False)


@pytest.mark.long
@pytest.mark.parametrize("plain", [False, True])
def test_the_recorded_controller_repeats_the_jump(jump: RecordedJump, plain: bool) -> None:
    controller = RecordedController(jump, plain=plain)
    for _ in range(2):
        controller.run(20)
        controller.check()
        controller.run(1000)  # as far as there are ticks
        controller.check()
        assert controller.tick == jump.ticks
        controller.again()
    assert len(controller.times) == 2 * jump.ticks


def test_the_hand_written_loop_has_the_same_bodies(jump: RecordedJump) -> None:
    loop = HandWrittenLoop(jump)
    loop.run(jump.ticks)
    loop.check()


def test_another_controller_is_noticed(jump: RecordedJump) -> None:
    rows = jump.rows.copy()
    controller = RecordedController(RecordedJump(jump.graph, rows))
    first, last = controller.bound.memory.bus.layout.byte_range("joint_pd.command.torque")
    rows[9, first:last] = 0
    controller.run(10)
    with pytest.raises(AssertionError, match=r"joint_pd\.command\.torque differs .* in tick 9"):
        controller.check()


@pytest.mark.skipif(find_spec("osqp") is None, reason="osqp is not installed")
def test_osqp_solves_the_controllers_program(jump: RecordedJump) -> None:
    controller = RecordedController(jump, instead={"wbc": OsqpController})
    block = controller.bound.blocks["wbc"]
    assert isinstance(block, OsqpController)
    controller.run(jump.ticks)
    exact = block.command.torque.copy()
    controller.again()
    block.learning = False
    controller.run(jump.ticks)
    assert int(block.memory.failures) == 0
    apart = np.abs(block.command.torque - exact).max()
    assert 0.0 < apart < 1.0  # its tolerance is coarse, but it is the same program


def test_ticks_that_begin_late_are_counted(jump: RecordedJump) -> None:
    controller = RecordedController(jump)
    assert late_share(controller, jump, 1e9, 1e-7) > 0.5
