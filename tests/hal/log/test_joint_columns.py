"""Which joint each column of a log is, told by feet that stand: columns of robots whose order is known, shuffled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aloft import load
from aloft.hal.log.joint_columns import (
    SURE,
    ColumnGuess,
    guess_columns,
    stiller,
    unrest_of,
    within_limits,
)
from aloft.hal.log.standing_feet import LoggedMotion, StandingFeet

from ...stepping import BRUCE, NAMES, shuffled, stepping


def wrong(guesses: list[ColumnGuess], truth: list[str]) -> list[tuple[str | None, str]]:
    return [
        (each.joint, name)
        for each, name in zip(guesses, truth, strict=True)
        if each.joint not in (None, name)
    ]


@pytest.mark.parametrize(
    "seed", [2, *(pytest.param(k, marks=pytest.mark.long) for k in range(6) if k != 2)]
)
def test_shuffled_columns_are_told_by_the_feet(seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(NAMES))
    guesses = guess_columns(BRUCE, [shuffled(stepping(seed), order)])
    assert not wrong(guesses, [NAMES[k] for k in order])
    told = [each for each in guesses if each.joint is not None]
    assert {each.sure for each in told} == {"told"} and len(told) >= 6, guesses
    assert "times as restless" in told[0].why


def test_feet_of_the_right_order_stand_still() -> None:
    motion = stepping()
    feet = StandingFeet(BRUCE, motion)
    assert feet.unrest({j: j for j in feet.joints}) < 0.01
    assert feet.unrest({j: len(NAMES) - 1 - j for j in feet.joints}) > 1.0
    assert unrest_of(BRUCE, motion, NAMES) == feet.unrest({j: j for j in feet.joints})
    assert unrest_of(BRUCE, motion, [*NAMES[:-1], "-"]) is None, (
        "a leg has a joint without a column"
    )


def test_names_that_are_wrong_are_noticed() -> None:
    motion = stepping()
    assert stiller(BRUCE, motion, NAMES) == pytest.approx(1.0)
    names = list(NAMES)
    knee, hip = names.index("left_knee"), names.index("left_hip_pitch")
    names[knee], names[hip] = names[hip], names[knee]
    found = stiller(BRUCE, motion, names)
    assert found is not None and found > SURE


@pytest.mark.long
def test_what_stands_still_tells_nothing() -> None:
    motion = stepping()
    rest = replace(
        motion, position=np.tile(motion.position[:1], (len(motion.position), 1)), velocity=0.0 * motion.velocity,
        rate=0.0 * motion.velocity[:, :3], up=np.tile(motion.up[:1], (len(motion.position), 1)),
    )  # fmt: skip
    order = np.random.default_rng(1).permutation(len(NAMES))
    assert {each.sure for each in guess_columns(BRUCE, [shuffled(rest, order)])} == {"open"}


def test_without_feet_the_robots_own_order_is_assumed_and_said_to_be() -> None:
    motion = stepping()
    air = replace(motion, closed=np.zeros_like(motion.closed))
    guesses = guess_columns(BRUCE, [air])
    assert [each.joint for each in guesses] == NAMES
    assert {each.sure for each in guesses} == {"assumed"}
    assert "nothing tells it" in guesses[0].why
    fewer = replace(air, position=air.position[:, :4], velocity=air.velocity[:, :4])
    assert {(each.joint, each.sure) for each in guess_columns(BRUCE, [fewer])} == {(None, "open")}
    bent = replace(air, position=air.position + 9.0)
    assert {each.joint for each in guess_columns(BRUCE, [bent])} == {None}
    assert "limits" in guess_columns(BRUCE, [bent])[0].why


def test_limits_exclude_joints() -> None:
    low, high = BRUCE.joint_limits.T
    columns = np.linspace(low, high, 50)
    fits = within_limits(BRUCE, columns)
    assert fits.diagonal().all()
    knee = NAMES.index("left_knee")
    assert (
        not fits[knee, NAMES.index("left_hip_roll")] or not fits[NAMES.index("left_hip_roll"), knee]
    )
    assert not within_limits(BRUCE, columns + 10.0).any()


@pytest.mark.long
def test_shuffled_columns_of_a_simulated_sway_are_told_or_open_but_never_wrong(tmp_path) -> None:
    file = tmp_path / "sway.yaml"
    file.write_text("include: [aloft:sway, aloft:trials/standard]\n")
    result = load(file).run()
    result.raise_if_failed()

    def mean(name: str, size: int) -> np.ndarray:
        values = np.asarray(result.signal(f"robot.{name}"))
        window = np.ones(size) / size
        return np.stack([np.convolve(column, window, "same") for column in values.T], axis=1)

    force = mean("imu.specific_force", 500)
    points = np.asarray(result.signal("robot.contacts.closed")).astype(bool)
    foot = np.array(BRUCE.foot_of_contact())
    motion = LoggedMotion(
        np.asarray(result.signal("robot.joints.position")), mean("joints.velocity", 20),
        np.stack([points[:, foot == k].any(axis=1) for k in range(2)], axis=1),
        mean("imu.angular_velocity", 20), force / np.linalg.norm(force, axis=1, keepdims=True),
    )  # fmt: skip
    inner = slice(500, -500)
    motion = replace(motion, **{
        part: getattr(motion, part)[inner] for part in ("position", "velocity", "closed", "rate", "up")
    })  # fmt: skip
    told = []
    for seed in range(4):
        order = np.random.default_rng(seed).permutation(len(NAMES))
        guesses = guess_columns(BRUCE, [shuffled(motion, order)])
        assert not wrong(guesses, [NAMES[k] for k in order])
        told.append(sum(each.joint is not None for each in guesses))
    assert max(told) >= 6, told
    assert not wrong(guess_columns(BRUCE, [motion]), NAMES)
    assert sum(each.joint is not None for each in guess_columns(BRUCE, [motion])) >= 8, (
        "a driver's order"
    )
