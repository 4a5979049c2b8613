"""``SteppingStones`` commands each stone in turn, and tells the ground that they make."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from aloft.extensions.hopping.blocks.stepping_stones import SteppingStones, SteppingStonesParameters
from aloft.runtime.graph import load
from aloft.runtime.language.errors import AloftError
from aloft.runtime.testing import BlockBench

GIVEN = [{"x": 0.25, "y": 0.02, "top": 0.04}, {"x": 0.5, "top": 0.02}, {"x": 0.7}]


def test_the_next_stone_is_known_when_the_one_before_is_taken() -> None:
    bench = BlockBench(SteppingStones, {"stones": GIVEN, "seen": 2})
    bench.step()
    command, seen = bench.get("command"), bench.get("seen")
    assert int(command.number) == 1 and bool(command.placed) and not bool(command.replaces)
    place = [float(getattr(command, name)) for name in ("ahead", "aside", "turn", "up")]
    assert place == pytest.approx([0.25, 0.02, 0.0, 0.04])
    assert int(seen.count) == 2
    assert np.asarray(seen.place) == pytest.approx(np.array([[0.25, 0.02, 0.04], [0.5, 0, 0.02]]))
    bench.step()
    assert int(command.number) == 1, "the first has not been taken"
    for taken in (1, 2):
        bench.set("taken", command=taken)
        bench.step()
        assert int(command.number) == taken + 1
    assert float(command.ahead) == pytest.approx(0.7)
    assert int(seen.count) == 1, "there is none behind the last one"
    bench.set("taken", command=3)
    bench.step()
    assert int(command.number) == 3


def test_drawn_stones_follow_from_their_seed_and_keep_their_bounds() -> None:
    random = {"count": 40, "seed": 5, "height": 0.05}
    stones = SteppingStonesParameters.model_validate({"random": random}).placed()
    assert stones == SteppingStonesParameters.model_validate({"random": random}).placed()
    other = SteppingStonesParameters.model_validate({"random": {**random, "seed": 6}}).placed()
    assert stones != other
    for one, following in pairwise(stones):
        assert 0.02 - 1e-3 <= following.x - one.x - 0.12 <= 0.14 + 1e-3
        assert abs(following.y - one.y) <= 0.03 + 1e-3
        assert abs(following.top - one.top) <= 0.05 + 1e-3
    assert np.ptp([stone.top for stone in stones]) > 0.03


def test_the_robot_stands_on_the_ground_that_they_make() -> None:
    checked = load(
        "aloft:hopping/steer_stones", {"commands.stones": GIVEN, "commands.seen": 1}
    ).checked
    blocks = {block.path: block for block in checked.blocks}
    assert blocks["score"].params.jumps == 3
    scene = blocks["robot"].params.ground.scene
    assert scene.floor == pytest.approx(-0.1)
    assert [(box.x, box.top) for box in scene.boxes][1:] == [
        ((0.19, 0.31), 0.04), ((0.44, 0.56), 0.02), ((0.64, 0.76), 0.0),
    ]  # fmt: skip
    ground = scene.build()
    assert [block.most[2] for block in ground.blocks] == [0.0, 0.04, 0.02, 0.0]


def test_stones_that_overlap_are_refused() -> None:
    with pytest.raises(AloftError, match="stone 2 overlaps the one before it"):
        load("aloft:hopping/steer_stones", {"commands.stones": [{"x": 0.25}, {"x": 0.3}]})
    with pytest.raises(AloftError, match="gap must be two positive lengths"):
        load("aloft:hopping/steer_stones", {"commands.random.gap": [0.1, 0.05]})


@pytest.mark.long
def test_bruce_hops_up_and_down_and_repeats_to_the_byte() -> None:
    stones = [{"x": 0.22, "y": 0.01, "top": 0.04}, {"x": 0.44, "top": 0.0}]
    runs = [
        load("aloft:hopping/steer_stones", {"commands.stones": stones}).run(log=False)
        for _ in range(2)
    ]
    assert runs[0].success, runs[0].reason
    assert runs[0].metrics["plans_planned"] == 2
    assert runs[0].metrics["forbidden_contacts"] == 0
    assert runs[0].run_hash == runs[1].run_hash
