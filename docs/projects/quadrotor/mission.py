"""The flight: take-off, hover, a flip, hover and landing."""

import math
from collections.abc import Iterable, Mapping
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from geometric_control import FlightMode, FlightTarget, wrenches

from aloft import Block, Field, Input, Output, Parameters, Signal, State, parameter
from aloft.blocks.signals import BaseState
from aloft.mathematics.arrays import Array1D
from aloft.mathematics.elementary import sincos
from aloft.mathematics.kernel import kernel
from aloft.mathematics.rotations import multiply, yaw
from aloft.runtime.language.block import Context, UnmetRequirement

GRAVITY = 9.81
TO_SPARE = 0.8
"""The share of the rotors' force and moment that the plan may take."""
PEAK = 10.0 / math.sqrt(3.0)
"""The largest second derivative of 10 s^3 - 15 s^4 + 6 s^5."""
PRESSED = 0.1
"""Depth of the target below the robot that marks the landing [m]."""


class FlightPhase(IntEnum):
    """The phases of the flight."""

    WAIT = 0
    RISE = 1
    HOVER = 2
    BOOST = 3
    FLIP = 4
    RECOVER = 5
    HOVER_AGAIN = 6
    DESCEND = 7
    LANDED = 8


class Progress(Signal):
    """The progress of the flight."""

    phase = Field(dtype="int64", values=FlightPhase, text="see FlightPhase")
    time = Field(unit="s", text="since it began")
    home = Field(3, unit="m", frame="world", text="where the robot stood")
    heading = Field(unit="rad", frame="world", text="its heading there")
    position = Field(3, unit="m", frame="world", text="where the phase began")
    velocity = Field(3, unit="m/s", frame="world", text="how fast")


class Flown(Signal):
    """The present phase of the flight."""

    phase = Field(dtype="int64", values=FlightPhase, text="see FlightPhase")


class MissionScratch(Signal):
    """Scratch memory of one tick."""

    goal = Field(3, text="where a motion ends")
    speed = Field(3, text="how fast it ends")
    turn = Field(4, text="a rotation")
    heading = Field(4, text="the heading")


class Mission(Block):
    """Takes off from where the robot stands, hovers, flips once, hovers again and lands.

    Motions are polynomials of degree five with no acceleration at their ends. Before the flip the robot
    is boosted upwards to v = g T / 2, so that it is as high after a flip of duration T as before. In the
    flip the target is an orientation, R_z(heading) R(a): the angle a goes from 0 to 360 deg as such
    a polynomial about the ``axis``, with the thrust ``flip_thrust`` for the mass. Then the target
    leads from where the robot is back to the place where it hovered.

    It has landed when the target, which sinks on, is 0.1 m below it: then the rotors are off.
    """

    class Params(Parameters):
        height: float = parameter(
            1.5, unit="m", gt=0, text="at which it hovers, above where it stood"
        )
        wait: float = parameter(0.5, unit="s", gt=0, text="before it takes off")
        rise: float = parameter(2.0, unit="s", gt=0, text="how long it takes off")
        hover: float = parameter(2.0, unit="s", gt=0, text="how long it hovers each time")
        boost: float = parameter(0.6, unit="s", gt=0, text="how long it is boosted upwards")
        flip: float = parameter(0.6, unit="s", ge=0.2, text="how long the flip takes")
        axis: Literal["roll", "pitch"] = parameter("roll", text="about which it flips")
        flip_thrust: float = parameter(
            4.0, unit="m/s^2", ge=0, text="thrust for the mass meanwhile"
        )
        recover: float = parameter(1.5, unit="s", gt=0, text="how long it goes back")
        sink_speed: float = parameter(0.4, unit="m/s", gt=0, text="how fast it lands")

    Scratch = MissionScratch
    needs = ("robot",)
    params: Params
    scratch: MissionScratch
    base = Input(BaseState, text="pose and velocity")
    target = Output(FlightTarget, text="where it should be")
    flown = Output(Flown, text="what the flight is at")
    progress = State(Progress, text="the progress")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Require rotors that give the boost and the flip, with some to spare for steering."""
        robot, about = context.robot, 0 if params.axis == "roll" else 1
        most = np.array([each.max_thrust for each in robot.thrusters.values()])
        speed = 0.5 * GRAVITY * params.flip
        needed = robot.total_mass * (GRAVITY + 1.5 * speed / params.boost)
        if needed > TO_SPARE * most.sum():
            yield UnmetRequirement(
                f"the rotors of {robot.name} are too weak for a boost to {speed:.3g} m/s in {params.boost:g} s",
                parameter="boost", expected=f"up to {TO_SPARE * most.sum():.3g} N of their {most.sum():.3g} N",
                found=f"{needed:.3g} N", fix="a longer boost or a shorter flip",
            )  # fmt: skip
        moment = float(np.maximum(wrenches(robot)[1 + about], 0.0) @ most)
        needed = robot.links[0].inertia[about] * PEAK * 2.0 * math.pi / params.flip**2
        if needed > TO_SPARE * moment:
            yield UnmetRequirement(
                f"the rotors of {robot.name} are too weak for a flip about {params.axis} in {params.flip:g} s",
                parameter="flip", expected=f"up to {TO_SPARE * moment:.3g} N m of their {moment:.3g} N m",
                found=f"{needed:.3g} N m",
                fix=f"flip: {math.sqrt(needed / (TO_SPARE * moment)) * params.flip + 0.005:.2f} s",
            )  # fmt: skip

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Return the values of the flight that a score needs."""
        return {"height": params.height, "hover": params.hover, "axis": params.axis}

    def setup(self) -> None:
        """Choose the axis of the flip."""
        self.about = 0 if self.params.axis == "roll" else 1

    @kernel
    @staticmethod
    def step(
        base: BaseState, target: FlightTarget, flown: Flown, progress: Progress, params: Params,
        scratch: MissionScratch, about: int, period: float,
    ) -> None:  # fmt: skip
        p, t = progress, target
        advance(base, p, params)
        goal, speed, heading = scratch.goal, scratch.speed, scratch.heading
        goal[:] = p.home
        speed[:] = 0.0
        t.mode = FlightMode.TRACK
        t.heading = p.heading
        t.angular_velocity[:] = 0.0
        t.angular_acceleration[:] = 0.0
        heading[0], heading[1] = 0.0, 0.0
        heading[2], heading[3] = sincos(0.5 * p.heading)
        t.orientation[:] = heading
        t.thrust = params.flip_thrust
        if p.phase == FlightPhase.WAIT or p.phase == FlightPhase.LANDED:
            t.mode = FlightMode.OFF
            move(p, goal, speed, 1.0, t)
        elif p.phase == FlightPhase.DESCEND:
            t.position[:] = p.position
            t.position[2] -= params.sink_speed * p.time
            t.velocity[:] = 0.0
            t.velocity[2] = -params.sink_speed
            t.acceleration[:] = 0.0
        elif p.phase == FlightPhase.FLIP:
            t.mode = FlightMode.TURN
            s = min(p.time / params.flip, 1.0)
            full = 2.0 * math.pi
            angle = full * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            t.angular_velocity[about] = full * 30.0 * s**2 * (1.0 - s) ** 2 / params.flip
            t.angular_acceleration[about] = (
                full * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / params.flip**2
            )
            scratch.turn[:] = 0.0
            scratch.turn[about], scratch.turn[3] = sincos(0.5 * angle)
            multiply(heading, scratch.turn, t.orientation)
            t.position[:] = base.position
            t.velocity[:] = base.linear_velocity
            t.acceleration[:] = 0.0
        else:
            goal[2] += params.height
            duration = params.hover
            if p.phase == FlightPhase.RISE:
                duration = params.rise
            elif p.phase == FlightPhase.RECOVER:
                duration = params.recover
            elif p.phase == FlightPhase.BOOST:
                duration = params.boost
                speed[2] = 0.5 * GRAVITY * params.flip
                goal[2] += 0.5 * speed[2] * duration
            else:
                p.position[:] = goal
                p.velocity[:] = 0.0
            move(p, goal, speed, duration, t)
        flown.phase = p.phase
        p.time += period


@kernel
def advance(base: BaseState, p: Progress, params: Mission.Params) -> None:
    """Enter the next phase where the present one has ended."""
    over = False
    if p.phase == FlightPhase.WAIT:
        over = p.time >= params.wait
        p.home[:] = base.position
        p.heading = yaw(base.orientation)
    elif p.phase == FlightPhase.RISE:
        over = p.time >= params.rise
    elif p.phase == FlightPhase.HOVER or p.phase == FlightPhase.HOVER_AGAIN:
        over = p.time >= params.hover
    elif p.phase == FlightPhase.BOOST:
        over = p.time >= params.boost
    elif p.phase == FlightPhase.FLIP:
        over = p.time >= params.flip
    elif p.phase == FlightPhase.RECOVER:
        over = p.time >= params.recover
    elif p.phase == FlightPhase.DESCEND:
        sunk = p.position[2] - params.sink_speed * p.time
        over = sunk < base.position[2] - PRESSED
    if over:
        p.phase += 1
        p.time = 0.0
        p.position[:] = base.position
        p.velocity[:] = base.linear_velocity
        if p.phase != FlightPhase.RECOVER:
            p.velocity[:] = 0.0
        if p.phase != FlightPhase.RECOVER and p.phase != FlightPhase.RISE:
            p.position[:] = p.home
            p.position[2] += params.height


@kernel
def move(p: Progress, goal: Array1D, speed: Array1D, duration: float, t: FlightTarget) -> None:
    """Set the target on the polynomial from the phase's start to a ``goal`` [m], which it passes
    with a ``speed`` [m/s]."""
    time = min(p.time, duration)
    for k in range(3):
        way, first, last = goal[k] - p.position[k], p.velocity[k], speed[k]
        a = (10.0 * way - (6.0 * first + 4.0 * last) * duration) / duration**3
        b = (-15.0 * way + (8.0 * first + 7.0 * last) * duration) / duration**4
        c = (6.0 * way - 3.0 * (first + last) * duration) / duration**5
        t.position[k] = p.position[k] + time * (first + time**2 * (a + time * (b + time * c)))
        t.velocity[k] = first + time**2 * (3.0 * a + time * (4.0 * b + time * 5.0 * c))
        t.acceleration[k] = time * (6.0 * a + time * (12.0 * b + time * 20.0 * c))
