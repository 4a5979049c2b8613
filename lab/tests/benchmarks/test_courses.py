"""Courses, stones and the staircase: the same of a seed on every machine, and graphs that take them."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

import aloft
from aloft.lab.benchmarks.changed_targets import BEFORE, KINDS, LIFT_OFF, two_levels
from aloft.lab.benchmarks.courses import JUMPS, course
from aloft.lab.benchmarks.stones import STAIRCASE, STEP, STEPS, passed


def test_a_course_is_that_of_its_seed_and_within_what_is_asked() -> None:
    found = course(31700)
    assert len(found) == JUMPS
    assert found == course(31700) != course(31701)
    for one in found:
        assert 0.05 <= math.hypot(one["ahead"], one["aside"]) <= 0.3001
        assert abs(one["turn"]) <= 0.25 * math.pi + 1e-4


def test_the_staircase_has_no_gaps() -> None:
    sets = {"commands.stones": STAIRCASE, "commands.size": STEP}
    graph = aloft.load("aloft:hopping/steer_stones", sets)
    (commands,) = (block for block in graph.checked.blocks if block.path == "commands")
    boxes = commands.params.boxes()
    assert len(boxes) == STEPS + 1
    for below, above in pairwise(boxes):
        assert above["x"][0] == pytest.approx(below["x"][1], abs=3e-3)
        assert above["top"] - below["top"] == pytest.approx(0.04)


def test_who_touches_a_stone_with_anything_but_the_feet_has_not_passed() -> None:
    good = {"jumps": STEPS, "reason": "all criteria hold", "forbidden_contacts": 0}
    assert passed(good, STEPS)
    assert not passed(good)
    assert not passed({**good, "forbidden_contacts": 1}, STEPS)
    assert not passed({**good, "reason": "fell at 3 s"}, STEPS)


@pytest.mark.parametrize("kind", KINDS)
def test_changed_targets_are_those_of_their_seed(kind: str) -> None:
    def drawn(seed: int) -> list[dict[str, object]]:
        return KINDS[kind](np.random.default_rng(seed))

    first, *changes = drawn(7)
    assert drawn(7) == [first, *changes] != drawn(8)
    assert "replaces" not in first and len(changes) == (3 if kind == "several" else 1)
    for change in changes:
        assert change["replaces"]
        before = LIFT_OFF - change["at"]
        if kind == "in flight":
            assert before < 0.0
        elif kind != "several":
            assert BEFORE[0] - 1e-3 <= before <= BEFORE[1] + 1e-3


def test_the_ground_of_a_height_that_changes_has_its_edge_between_the_feet() -> None:
    boxes = two_levels(0.2, -0.03)["boxes"]
    assert boxes[0]["x"][1] < 0.1 == boxes[1]["x"][0]
    assert (boxes[0]["top"], boxes[1]["top"]) == (0.0, -0.03)
    assert all(box["bottom"] < -0.03 for box in boxes)
