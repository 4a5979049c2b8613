"""Chooses the parameters that a task of a few lines does not set, so that the jump lands in closed loop.

A plan that uses the motors and joints to the full cannot be followed, because noise, delay and errors of the
model leave the feedback no room. The recipe is the same for every jump of every robot. Angles and shares are
the same for all robots. Times, weights, the names of joints, and whether the heels rise before the toes leave
the ground follow from the robot:

- motors are used to 85 %, and up to 92 % where the jump asks for much;
- feet may hit the ground with speed, but the impulse has a high weight in the cost;
- the torso's orientation and the forces have high weights, so that the robot squats no deeper than it must;
- the last sixth of the thrust is done on the toes, which lengthens the legs by the foot, by robots whose ankles
  are strong enough;
- until lift-off every contact point on the ground bears some load, so that the feet stay flat;
- feet come down slowly, and more slowly still along the ground; from high up the toes touch down
  before the heels;
- a jump that is low beside the robot leaves the ground with a least speed;
- from touchdown on the torso leans little and the knees are bent; joints keep off their limits.

A parameter that the task sets is kept: ``effort``, ``impact``, ``phases``, a time, or any single one of
``weights`` and ``margins``; ``margins: null`` switches all margins off. With ``recipe: paper`` nothing is
chosen: other parameters have their defaults, with full use of the motors and feet at rest at touchdown.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...mathematics.constants import GRAVITY
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from ...runtime.language.parameters import Parameters
from .margins import Margins
from .scaling import (
    ball_feet,
    knee_limits,
    least_distance_to_limits,
    rounded,
    size_of,
    toe_name_token,
    toe_push,
)
from .sequence import Hop, PhaseSpec

EFFORT, MOST_EFFORT = 0.85, 0.92
EASY, HARD = 1.0, 1.5
"""Demands (see ``take_off_energy_ratio``) up to which the least, and from which the most effort is chosen."""
WEIGHTS = {"force": 0.01, "orientation": 20.0, "impulse": 5.0}
SCALED_WEIGHTS = ("force", "impulse")
THRUST, TOES, TOE_KNOTS = 0.25, 0.04, 8
"""s; of the whole thrust and of its part on the toes, for a robot of BRUCE's size."""
CONTACT = 0.6
"""s on the ground between two jumps in a row, for a robot of BRUCE's size."""
KNOTS = {"squat": 12, "thrust": 12, "flight": 16, "landing": 12}
LANDING_LEAN, KNEE_BEND, JOINTS = 0.1, 0.4, 0.06
"""rad"""
STEP, STEP_HEIGHT, FOOT_CLEARANCE = 0.012, 0.05, 0.12
"""m from a step, how much more for each m that it goes up or down, and the feet's height in the middle of
the flight as a share of that of the centre of mass."""
LEAST_CLEARANCE = 0.04
"""m. Over a step that is lower than the feet's share they need to rise by its own height only, or by this: 8 cm over a
step of 3 cm made G1 leave the ground on bent knees, after a squat in which its base was 0.21 m above the ground."""
KNEE_SAG = 0.06
"""Sag of knees that fold down to the ground, as a share of the centre of mass's height. In a deep squat joints are 50
mrad off. With 4 % the thighs of Solo12 touched, as long as its mesh is.
"""
TOE_PUSH = 2.5
"""Multiple of the weight that the ankles must be able to bear on the toes, or no heel rises before them. G1's bear 1.8.
At its margin it could push with 1.4 in the last sixth of the thrust, so it had to be fast before: it first stood up on
straight knees and swung its torso by 50 degrees, and fell.
"""
LOAD, DEEP_LOAD = 0.4, 0.6
"""The share of the weight that the ground bears until lift-off; and before a deep squat."""
SQUAT, DEEP_SQUAT = 0.4, 0.5
"""s; the time of the squat, and of a deep one, for a robot of BRUCE's size."""
DEEP, DEEP_BACK = (0.65, 0.75), (0.8, 0.9)
"""Rises in place, and distances backwards, as multiples of the centre of mass's height: above the first
number the squat begins to be a deep one, and from the second on it wholly is."""
LOW, FLOWN = 0.1, 0.75
"""Greatest rise, as a multiple of the centre of mass's height, for which a robot with toes must fly a share of the
rise, and that share. Without it such a jump is hardly more than standing up onto the toes, and the toes, which leave
the ground some milliseconds late, take away more of its speed than the plan has to spare.
"""
TOUCHDOWN_SPEED, TOUCHDOWN_SLIDE, TOUCHDOWN_ROLL = 1.7, 0.6, 1.2
"""Speeds of the feet at touchdown [m/s], downwards and along the ground, of soles and of balls, which roll on, for a
robot of BRUCE's size.
"""
FALL, LEVEL_FALL = 0.9, 1.1
"""Greatest fall from the apex, as a multiple of the centre of mass's height, for which slow feet are required: in
general, and in a jump on level ground that ends where it began. From higher up the motors stop the robot only if its
legs are nearly stretched, and then flat feet are fast.
"""
TOES_LAND, TOE_LANDING_KNOTS = 0.04, 6
"""s; for how long before the heels the toes touch down in a jump straight ahead from higher up."""
TOES_SPEEDS = ((1.37, 1.8), (1.46, 2.3))
"""Greatest fall, again as a multiple of that height, from which the toes can be as slow as that [m/s], for a robot of
BRUCE's size. From higher up there is no limit.
"""
DROP = 0.5
"""Least depth of such a jump, again as a multiple of that height."""
LANDING_EFFORT = 1.0
"""Share of the motors' abilities from touchdown on, where the toes land first: balance takes over there, and the plan
is not followed.
"""
SQUAT_LEAN, FAR = 0.9, 1.2
"""Lean in the squat [rad], and the distance ahead from which on it holds, as a multiple of the centre of mass's
height.
"""
HIGH_AND_FAR = (0.42, 0.6)
"""Rise and distance ahead, as multiples of that height, beyond both of which the same holds."""
STEP_LEAN = 0.85
"""Lean in the squat in front of a step, whatever its distance [rad]."""


class RecipeInputs(Protocol):
    """The attributes of a ``JumpTask`` that the recipe reads."""

    recipe: Any
    formulation: Any
    squat_time: float | None
    thrust_time: float | None
    contact_time: float | None
    take_off: Mapping[str, float] | None
    touchdown: Mapping[str, float] | None
    margins: Margins | None
    weights: Any
    knots: Any

    @property
    def model_fields_set(self) -> set[str]:
        """Names of the fields that the task sets."""
        ...

    def hops(self) -> tuple[Hop, ...]:
        """Return the jumps in a row."""
        ...


@dataclass(frozen=True)
class Choice:
    """A parameter of a task that the recipe chose: its name, its value and the reason."""

    parameter: str
    value: Any
    why: str

    def as_json(self) -> dict[str, Any]:
        """Return the choice as plain data."""
        value = self.value
        if isinstance(value, Parameters):
            value = value.model_dump(mode="json")
        if isinstance(value, tuple):
            value = [each.model_dump(mode="json", exclude_none=True) for each in value]
        return {"parameter": self.parameter, "value": value, "why": self.why}


def applies(task: RecipeInputs) -> bool:
    """Check whether the recipe chooses anything for a task: for jumps of the ``full`` formulation in which nothing
    turns over.
    """
    turns = any(hop.rotation for hop in task.hops())
    return task.recipe == "robust" and task.formulation == "full" and not turns


def choices(task: RecipeInputs, robot: RobotDescription) -> tuple[Choice, ...]:
    """Return all choices of the recipe for a task of a robot; empty if the task sets all parameters."""
    if not applies(task) or not robot.contacts:
        return ()
    return (*_plain(task, robot), *_weights(task, robot), *_margins(task, robot))


def chosen_fields(task: RecipeInputs, found: tuple[Choice, ...]) -> dict[str, Any]:
    """Return the task's fields with those choices."""
    fields, parts = dict[str, Any](), dict[str, dict[str, Any]]()
    for choice in found:
        group, _, name = choice.parameter.partition(".")
        if name:
            parts.setdefault(group, {})[name] = choice.value
        else:
            fields[group] = choice.value
    for group, changed in parts.items():
        before = fields.get(group) or getattr(task, group) or Margins()
        fields[group] = before.model_copy(update=changed)
    return fields


def _plain(task: RecipeInputs, robot: RobotDescription) -> Iterator[Choice]:
    """Yield the choices of impact, effort and phases."""
    given_fields, slow = task.model_fields_set, size_of(robot).slow
    if "impact" not in given_fields:
        yield Choice("impact", True, "feet that stop before they touch cost joint speed")
    if "effort" not in given_fields:
        asked = take_off_energy_ratio(task, robot)
        share = min(1.0, max(0.0, (asked - EASY) / (HARD - EASY)))
        why = f"the jump asks for {asked:.2g} (easy below {EASY:g}, hard from {HARD:g}); "
        yield Choice("effort", round(EFFORT + share * (MOST_EFFORT - EFFORT), 2),
                     why + "the rest is the feedback's")  # fmt: skip
    heights = [max(0.0, hop.landing_height or 0.0) for hop in task.hops()]
    if "foot_clearance" not in given_fields and any(heights):
        high = FOOT_CLEARANCE * size_of(robot).height
        if len(heights) == 1:
            high = min(high, max(LEAST_CLEARANCE, heights[0]))
        yield Choice("foot_clearance", rounded(high), "feet pass a step's edge")
    if "knots" not in given_fields:
        why = "the flight is exact on any grid; where feet stand knots are closer"
        yield Choice("knots", task.knots.model_copy(update=KNOTS), why)
    rows = len(task.hops()) > 1
    if "phases" in given_fields:
        return
    contact = _contact_time(task, slow)
    if rows and "contact_time" not in given_fields:
        yield Choice("contact_time", contact, "between two jumps the robot comes to balance")
    if task.take_off or task.touchdown:
        return
    toes = _toes(robot)
    if toes and task.thrust_time is not None and not (rows and contact is None):
        whole = task.thrust_time if "thrust_time" in given_fields else rounded(THRUST * slow)
        late = min(rounded(TOES * slow), 0.5 * whole)
        half = 0.5 * (contact or 0.0)
        phase_specs = [
            PhaseSpec(phase="squat", time=_squat_time(task, robot)),
            *_thrust(whole, late, toes),
        ]
        for _ in task.hops()[1:]:
            between = _thrust(half, min(late, 0.5 * half), toes)
            phase_specs += [
                PhaseSpec(phase="flight"),
                PhaseSpec(phase="landing", time=half),
                *between,
            ]
        landing: tuple[PhaseSpec, ...] = (
            PhaseSpec(phase="landing", time=_time(task, "landing_time", slow)),
        )
        why = f"the heels rise {1000 * late:.0f} ms before the {toes}s leave the ground: the foot lengthens the leg"
        soft = rounded(TOES_LAND * slow)
        if toes_speed(task, robot) is not None and (landing[0].time or 1.0) > 2.0 * soft:
            landing = _landing(landing[0].time, soft, toes)
            why += f"; they come down {1000 * soft:.0f} ms after them, because flat feet would be too fast"
        yield Choice("phases", (*phase_specs, PhaseSpec(phase="flight"), *landing), why)


def _toes(robot: RobotDescription) -> str:
    """Return the common word in the names of a robot's toes that can thrust with them; empty for others."""
    token = toe_name_token(robot)
    return token if token and toe_push(robot) >= TOE_PUSH else ""


def _thrust(whole: float, late: float, toes: str) -> tuple[PhaseSpec, PhaseSpec]:
    """Return a thrust [s], first on all contacts and at last on the toes."""
    return (
        PhaseSpec(phase="thrust", time=round(whole - late, 6)),
        PhaseSpec(phase="thrust", time=late, contacts=toes, knots=TOE_KNOTS),
    )


def _landing(whole: float | None, early: float, toes: str) -> tuple[PhaseSpec, ...]:
    """Return a landing [s], first on the toes."""
    rest = None if whole is None else round(whole - early, 6)
    return (
        PhaseSpec(phase="landing", time=early, contacts=toes, knots=TOE_LANDING_KNOTS),
        PhaseSpec(phase="landing", time=rest),
    )


def _contact_time(task: RecipeInputs, slow: float) -> float | None:
    """Return the time on the ground between two jumps [s]: the task's, or one that leaves time for balance."""
    given = "contact_time" in task.model_fields_set
    return task.contact_time if given else rounded(CONTACT * slow)


def _time(task: RecipeInputs, name: str, slow: float) -> float | None:
    """Return a phase's time [s]: the task's, or the usual one for a robot of that size."""
    value: float | None = getattr(task, name)
    return value if name in task.model_fields_set or value is None else rounded(value * slow)


def _squat_time(task: RecipeInputs, robot: RobotDescription) -> float | None:
    """Return the squat's time [s]: the task's, or the longer, the deeper it is."""
    if "squat_time" in task.model_fields_set or task.squat_time is None:
        return task.squat_time
    time = SQUAT + squat_depth_share(task, robot) * (DEEP_SQUAT - SQUAT)
    return rounded(round(time, 2) * size_of(robot).slow)


def _weights(task: RecipeInputs, robot: RobotDescription) -> Iterator[Choice]:
    given_fields = task.weights.model_fields_set if "weights" in task.model_fields_set else set()
    light = size_of(robot).light
    reasons = {
        "force": "forces are dear: a shallow squat and a smooth thrust",
        "orientation": "the torso stays near upright",
        "impulse": "the legs give way as the feet touch down",
    }
    for name, value in WEIGHTS.items():
        if name not in given_fields:
            scaled = rounded(value * light) if name in SCALED_WEIGHTS else value
            yield Choice(f"weights.{name}", scaled, reasons[name])


def _margins(task: RecipeInputs, robot: RobotDescription) -> Iterator[Choice]:
    if "margins" in task.model_fields_set and task.margins is None:
        return
    given_fields = set() if task.margins is None else task.margins.model_fields_set
    hops = task.hops()
    # Only for a single jump: in a row nothing squats that deep in front of a step.
    onto = max(0.0, hops[0].landing_height or 0.0) if len(hops) == 1 else 0.0
    far = max(abs(hop.distance_x or 0.0) for hop in hops) / size_of(robot).height
    high, ahead = (limit * size_of(robot).height for limit in HIGH_AND_FAR)
    both = any((hop.rise or 0.0) > high and (hop.distance_x or 0.0) > ahead for hop in hops)
    lies_down = far > FAR or (both and not onto)
    if "squat_lean" not in given_fields and lies_down:
        why = f"{far:.2g} times the centre of mass's height ahead; without it the torso lies down"
        yield Choice("margins.squat_lean", SQUAT_LEAN, why)
    elif "squat_lean" not in given_fields and onto:
        why = "the torso lies down in front of a step, as the calves keep away from it"
        yield Choice("margins.squat_lean", STEP_LEAN, why)
    if "load" not in given_fields:
        share = round(LOAD + squat_depth_share(task, robot) * (DEEP_LOAD - LOAD), 2)
        yield Choice(
            "margins.load", share, "it does not squat so fast that its feet lose the ground"
        )
    rise = min(_rise(hop) for hop in hops)
    low = 0.0 < rise < LOW * size_of(robot).height and _toes(robot)
    if "lift_off_speed" not in given_fields and low and all(hop.rise for hop in hops):
        speed = rounded(math.sqrt(2.0 * GRAVITY * FLOWN * rise))
        yield Choice(
            "margins.lift_off_speed", speed, "it flies, and does not only stand up onto its toes"
        )
    if "landing_lean" not in given_fields:
        yield Choice("margins.landing_lean", LANDING_LEAN, "it lands upright")
    knees = knee_limits(robot, KNEE_BEND)
    if "landing_limits" not in given_fields and knees:
        yield Choice("margins.landing_limits", knees, "it lands on bent knees, which can give way")
    yield from _slow_feet(task, robot, given_fields)
    fall = max(0.0, *(-(hop.landing_height or 0.0) for hop in hops))
    at_a_step = any(hop.landing_height for hop in hops)
    if "step" not in given_fields and (at_a_step or knee_sag(robot)):
        edge = STEP + STEP_HEIGHT * max(fall, onto) if at_a_step else 0.0
        why = (
            "a disturbed robot must not touch the step"
            if at_a_step
            else "knees hang lower than planned"
        )
        yield Choice("margins.step", rounded(edge + knee_sag(robot)), why)
    if "joints" not in given_fields:
        room = math.floor(100.0 * min(JOINTS, 0.5 * least_distance_to_limits(robot))) / 100.0
        yield Choice("margins.joints", max(Margins().joints, room), "joints keep off their limits")


def _slow_feet(
    task: RecipeInputs, robot: RobotDescription, given_fields: set[str]
) -> Iterator[Choice]:
    """Yield slower touchdown speeds of the feet, where the motors can stop the robot all the same."""
    size = size_of(robot)
    hops = task.hops()
    level = not any(hop.landing_height or hop.distance_x or hop.distance_y for hop in hops)
    falls = [_rise(hop) - (hop.landing_height or 0.0) for hop in hops]
    if max(falls) > (LEVEL_FALL if level else FALL) * size.height:
        speed = toes_speed(task, robot)
        if speed is None or "phases" in task.model_fields_set:
            return
        if "touchdown_speed" not in given_fields:
            yield Choice("margins.touchdown_speed", speed, "fast toes sink into soft ground")
        if "landing_effort" not in given_fields:
            yield Choice("margins.landing_effort", LANDING_EFFORT, "the legs must stop a deep fall")
        return
    if "touchdown_speed" not in given_fields:
        speed = rounded(TOUCHDOWN_SPEED * size.slow)
        yield Choice("margins.touchdown_speed", speed, "fast feet sink into soft ground")
    # Jumps back go 1 cm too far with that bound.
    back = any((hop.distance_x or 0.0) < 0.0 for hop in task.hops())
    if "touchdown_slide" not in given_fields and not back:
        most = TOUCHDOWN_ROLL if ball_feet(robot) else TOUCHDOWN_SLIDE
        why = "feet that swing on miss their place if they land early"
        yield Choice("margins.touchdown_slide", rounded(most * size.slow), why)


def toes_speed(task: RecipeInputs, robot: RobotDescription) -> float | None:
    """Return the greatest speed of the toes [m/s] where they should touch down before the heels; ``None``: nowhere.

    They should in a single jump straight ahead and down from so high up that flat feet are fast, by a
    robot that has toes. Aside, or with a turn, no such plans are found.
    """
    size, hop = size_of(robot), task.hops()[0]
    drop = -(hop.landing_height or 0.0) / size.height
    fall = drop + _rise(hop) / size.height
    bare = "margins" in task.model_fields_set and task.margins is None
    other = bare or len(task.hops()) > 1 or hop.distance_y or hop.twist
    if other or not _toes(robot) or fall <= FALL or drop < DROP:
        return None
    return next((rounded(speed * size.slow) for most, speed in TOES_SPEEDS if fall <= most), None)


def knee_sag(robot: RobotDescription) -> float:
    """Return the distance [m] that knees may hang lower than planned, of legs that end in balls: they fold down to the
    ground.
    """
    return KNEE_SAG * size_of(robot).height if ball_feet(robot) else 0.0


def squat_depth_share(task: RecipeInputs, robot: RobotDescription) -> float:
    """Return the depth of the squat, 0 to 1: for a high jump in place, or one far back.

    Such a squat is a fall that the legs must stop, and on soft ground the feet lose the ground as
    they do. It takes longer then, and the ground bears more. Other jumps do worse so (turns, steps
    up, high jumps ahead or aside, shorter ones back), and keep the usual squat.
    """
    back, high = 0.0, 0.0
    for hop in task.hops():
        ahead, aside = hop.distance_x or 0.0, hop.distance_y or 0.0
        if hop.twist or (hop.landing_height or 0.0) > 0.0:
            return 0.0
        back = max(back, -ahead)
        high = max(high, 0.0 if ahead or aside else _rise(hop))
    height = size_of(robot).height
    return max(_share(high / height, DEEP), _share(back / height, DEEP_BACK))


def _share(value: float, between: tuple[float, float]) -> float:
    """Return a value's share of the way from the one to the other of two, from 0 to 1."""
    low, high = between
    return min(1.0, max(0.0, (value - low) / (high - low)))


def take_off_energy_ratio(task: RecipeInputs, robot: RobotDescription) -> float:
    """Return the take-off energy ratio of a jump: its kinetic energy at lift-off by m g times the height of the centre
    of mass, half of it. Speed aside counts three times, as legs push aside with their hips only; a turn as the speed of
    what is a fifth of that height away. 1.2 is 20 cm straight up for BRUCE.
    """
    height = size_of(robot).height
    found = 0.0
    for hop in task.hops():
        up = hop.landing_height or 0.0
        rise = max(_rise(hop), up + 0.01)
        time = math.sqrt(2.0 * rise / GRAVITY) + math.sqrt(2.0 * (rise - up) / GRAVITY)
        speeds = np.array([hop.distance_x or 0.0, hop.distance_y or 0.0, hop.twist or 0.0]) / time
        shares = np.array([1.0, 3.0, (0.2 * height) ** 2])
        along = float(product(shares, speeds**2))
        found = max(found, (2.0 * GRAVITY * rise + along) / (GRAVITY * height))
    return found


def _rise(hop: Hop) -> float:
    """Return the height of a jump above where it begins [m]."""
    if hop.rise is not None:
        return hop.rise
    if hop.take_off_speed is not None:
        return hop.take_off_speed**2 / (2.0 * GRAVITY)
    return GRAVITY * (hop.flight_time or 0.3) ** 2 / 8.0
