"""``FootholdCommand`` commands a jump to each new pose."""

from __future__ import annotations

import math

import pytest

from aloft.extensions.hopping.blocks.foothold_command import FootholdCommand
from aloft.runtime.testing import BlockBench


def test_a_new_pose_is_a_new_command() -> None:
    bench = BlockBench(FootholdCommand)
    command = bench.get("command")
    bench.step()
    assert int(command.number) == 0, "a pose of zeros is none"
    turned = [0.0, 0.0, math.sin(0.25), math.cos(0.25)]
    bench.set("pose", position=[0.3, 0.1, 0.04], orientation=turned)
    for _ in range(3):
        bench.step()
    assert int(command.number) == 1, "the same pose counts once"
    assert bool(command.placed) and bool(command.replaces)
    place = [float(getattr(command, name)) for name in ("ahead", "aside", "turn", "up")]
    assert place == pytest.approx([0.3, 0.1, 0.5, 0.04])
    bench.set("pose", position=[0.5, 0.1, 0.04])
    bench.step()
    assert int(command.number) == 2 and float(command.ahead) == 0.5
