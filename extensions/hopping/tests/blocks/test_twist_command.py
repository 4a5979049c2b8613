"""``TwistCommand`` commands jumps as long as a velocity is asked for."""

from __future__ import annotations

import pytest

from aloft.extensions.hopping.blocks.twist_command import TwistCommand
from aloft.runtime.testing import BlockBench

Bench = BlockBench[TwistCommand]


def ask(
    bench: Bench, ahead: float = 0.0, left: float = 0.0, turn: float = 0.0, up: float = 0.0
) -> int:
    """Ask for a velocity, and the number of the command."""
    bench.set("twist", linear=[ahead, left, up], angular=[0.0, 0.0, turn])
    bench.step()
    return int(bench.get("command").number)


def test_a_velocity_becomes_one_jump_after_the_other() -> None:
    bench = BlockBench(TwistCommand, {"jump_time": 2.0})
    command = bench.get("command")
    assert ask(bench) == 0
    assert ask(bench, 0.1, -0.05, 0.2) == 1
    jump = [float(command.ahead), float(command.aside), float(command.turn)]
    assert jump == pytest.approx([0.2, -0.1, 0.4])
    assert ask(bench, 0.12) == 1, "it has not been taken, so it follows the stick"
    assert float(command.ahead) == pytest.approx(0.24)
    bench.set("taken", command=1)
    assert ask(bench, 0.12) == 2, "the stick is held: there is a next one"
    assert ask(bench, 0.0) == 1, "and there is none when it is let go"
    assert ask(bench, 0.0, up=0.1) == 2, "a jump on the spot"
    assert float(command.ahead) == 0.0


def test_what_is_far_is_clipped_and_what_is_small_is_none() -> None:
    bench = BlockBench(TwistCommand)
    assert ask(bench, 0.009) == 0
    assert ask(bench, 5.0, -5.0, 5.0) == 1
    command = bench.get("command")
    jump = [float(command.ahead), float(command.aside), float(command.turn)]
    assert jump == pytest.approx([0.3, -0.3, 0.8])


def test_a_jump_that_has_not_begun_is_replaced_where_the_velocity_has_changed() -> None:
    bench = BlockBench(TwistCommand, {"jump_time": 2.0})
    command = bench.get("command")
    ask(bench, 0.1)
    bench.set("taken", command=1, waits=True)
    assert ask(bench, 0.11) == 2
    assert not bool(command.replaces), "2 cm are no other jump"
    assert ask(bench, 0.0, 0.1) == 2
    assert bool(command.replaces)
    bench.set("taken", command=1, waits=False)
    ask(bench, 0.0, 0.1)
    assert not bool(command.replaces), "the jump has begun"
