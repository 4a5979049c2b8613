"""When a somersault leaves its tuck: its rotation at touchdown, simulated with the law's own physics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from aloft.blocks.jumping.turn_timing import (
    Body,
    Pose,
    Rotation,
    TurnProgress,
    TurnSettings,
    follow_turn,
    turned_beyond,
    value_at,
)
from aloft.blocks.signals import Phase
from aloft.mathematics.constants import GRAVITY

PERIOD = 0.002
FLIGHT = 0.36
SLOW, FAST = 10.0, 20.0
"""Rates of rotation with the legs out and tucked [rad/s]."""
TIMES = np.linspace(0.0, FLIGHT, 181)
RATES = np.interp(TIMES, [0.0, 0.08, 0.25, 0.31, FLIGHT], [SLOW, FAST, FAST, SLOW, SLOW])
LEFT = np.concatenate(
    [np.cumsum((0.5 * np.diff(TIMES) * (RATES[1:] + RATES[:-1]))[::-1])[::-1], [0]]
)
SPEED, HEIGHT = 1.7, 0.4
"""Of the planned lift-off [m/s, m]."""


def about_y(angle):
    return np.array([0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)])


@dataclass
class Flight:
    """A robot whose joints follow the plan at once, with ``spin`` times its momentum, ahead of its rotation
    by ``ahead`` [rad] at lift-off, and ``faster`` upwards [m/s]. ``sign`` is -1 backwards."""

    spin: float = 1.0
    ahead: float = 0.0
    faster: float = 0.0
    sign: float = 1.0
    early: float = 0.04
    late: float = 0.03
    aim: float = 0.0
    rates: np.ndarray = field(default_factory=lambda: RATES)
    delays: list[float] = field(default_factory=list)

    def fly(self) -> tuple[float, float]:
        """By how much it has turned further than the plan [rad], and how late the plan is [s]; both when it
        lands."""
        instant, matrix = np.zeros(3), np.zeros((6, 16))
        body = Body(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3), matrix)
        pose = Pose(np.array(int(Phase.FLIGHT)), np.array(FLIGHT), *np.zeros((2, 3)), np.zeros(4))
        rotation = Rotation(TIMES, self.rates, LEFT, np.array([0.075, 0.295, FAST, self.sign]))
        progress = TurnProgress(np.array(0.0), np.array(0.0))
        settings = TurnSettings(50.0, self.early, self.late, self.aim, PERIOD)
        momentum = 0.05 * FAST
        goal = HEIGHT + FLIGHT * (SPEED - 0.5 * GRAVITY * FLIGHT)
        turned, time = self.ahead, 0.0
        while True:
            speed = SPEED + self.faster
            height = HEIGHT + time * (speed - 0.5 * GRAVITY * time)
            instant[0] = time - float(progress.late)
            if height <= goal and time > 0.1:
                planned = LEFT[0] - value_at(TIMES, LEFT, instant[0])
                return turned - planned, float(progress.late)
            rate = value_at(TIMES, RATES, instant[0])
            matrix[4, 4] = momentum / rate
            body.angular_momentum[1] = self.sign * self.spin * momentum
            body.com[2], body.com_velocity[2] = height, speed - GRAVITY * time
            at = instant[0]
            pose.com[2] = HEIGHT + at * (SPEED - 0.5 * GRAVITY * at)
            pose.com_velocity[2] = SPEED - GRAVITY * at
            pose.orientation[:] = about_y(self.sign * (LEFT[0] - value_at(TIMES, LEFT, at)))
            angle = self.sign * turned
            body.base_rotation[0, 0] = body.base_rotation[2, 2] = math.cos(angle)
            body.base_rotation[0, 2], body.base_rotation[2, 0] = math.sin(angle), -math.sin(angle)
            follow_turn(instant, body, pose, rotation, settings, progress)
            self.delays.append(float(progress.late))
            turned += self.spin * rate * PERIOD
            time += PERIOD


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("spin", "ahead"), [(1.0, 0.15), (1.0, -0.1), (1.04, 0.0), (0.98, 0.0), (1.05, -0.1)]
)
def test_it_has_turned_as_planned_when_it_lands(spin, ahead, sign):
    left, late = Flight(spin=spin, ahead=ahead, sign=sign).fly()
    without = abs(ahead + (spin - 1.0) * LEFT[0])
    assert abs(left) < 0.03
    assert abs(left) < 0.3 * without
    assert abs(late) < 0.003


def test_the_plan_is_on_time_for_a_robot_that_falls_sooner_or_later():
    for faster in (-0.025, 0.05):
        left, late = Flight(faster=faster).fly()
        flies = (
            SPEED
            + faster
            + math.sqrt((SPEED + faster) ** 2 - SPEED**2 + (SPEED - GRAVITY * FLIGHT) ** 2)
        ) / GRAVITY
        assert late == pytest.approx(flies - FLIGHT, abs=0.004)
        assert abs(left) < 0.03


def test_a_robot_on_the_plan_is_left_alone():
    flight = Flight()
    flight.fly()
    assert np.abs(flight.delays).max() < 0.002


def test_a_plan_that_turns_no_faster_in_the_tuck_is_read_by_the_clock():
    flight = Flight(ahead=0.2, rates=np.full_like(RATES, FAST))
    flight.fly()
    before_the_legs_are_out = flight.delays[: int(0.29 / PERIOD)]
    assert before_the_legs_are_out == [0.0] * len(before_the_legs_are_out)


def test_who_turns_too_far_leaves_the_tuck_earlier_and_else_later_within_the_limits():
    for ahead, sign in ((0.2, -1.0), (-0.2, 1.0)):
        flight = Flight(ahead=ahead, early=0.006, late=0.004)
        flight.fly()
        most = sign * max(sign * delay for delay in flight.delays)
        assert most == pytest.approx(-0.006 if ahead > 0.0 else 0.004, abs=6e-4)


def test_the_aim_is_where_it_ends():
    left, _ = Flight(ahead=0.1, aim=-0.06).fly()
    assert left == pytest.approx(-0.06, abs=0.02)


@pytest.mark.parametrize("turned", [0.3, -0.2])
def test_the_angle_beyond_the_plan_has_no_jump_at_half_a_turn(turned):
    for planned in (0.0, 3.1, 6.2):
        angle = planned + turned
        rotation = np.array(
            [
                [math.cos(angle), 0, math.sin(angle)],
                [0, 1, 0],
                [-math.sin(angle), 0, math.cos(angle)],
            ]
        )
        assert turned_beyond(rotation, about_y(planned)) == pytest.approx(turned)
