"""Task of a jump: the motion that is wanted. It is written in YAML or made in Python.

name: forward_10cm
rise: 15 cm
distance_x: 10 cm
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, Literal, Self

from pydantic import ValidationError, model_validator

from ...files.problems import nearest
from ...files.validation import describe, names_at
from ...robots.description import RobotDescription
from ...runtime.language.parameters import Parameters, parameter
from .boundary_set import BoundarySet
from .contact_groups import in_turn, wrong_times
from .files import JumpTaskError, LocatedFile
from .margins import Margins
from .recipe import choices, chosen_fields
from .scaling import scaled_defaults
from .sequence import (
    LEVEL,
    STEEPEST,
    FreeTimes,
    Hop,
    KnownStairs,
    PhaseSpec,
    RoughGround,
    Slope,
    StanceLocation,
    check_phase_specs,
    on_slopes,
    places_of,
)

__all__ = ["JumpTask", "JumpTaskError", "Knots", "Weights", "make_task"]


PLAN_FORMAT = 1
"""Part of every task's hash: plans of an older format or meaning are not taken from a library."""


class Knots(Parameters):
    """Numbers of intervals of each phase; about 60 in all are enough for a small biped."""

    squat: int = parameter(8, ge=2, le=200, text="the squat")
    thrust: int = parameter(16, ge=4, le=200, text="the thrust")
    flight: int = parameter(28, ge=4, le=400, text="the flight")
    landing: int = parameter(14, ge=4, le=200, text="from touchdown to rest")

    @property
    def total(self) -> int:
        """The intervals of the whole jump."""
        return self.squat + self.thrust + self.flight + self.landing


class Weights(Parameters):
    """Weights of the cost's quadratic terms, which are integrated over time; SI units."""

    posture: float = parameter(1.0, ge=0.0, text="joint angles away from the standing pose")
    orientation: float = parameter(1.0, ge=0.0, text="the torso's rotation away from the nominal")
    joint_velocity: float = parameter(1e-1, ge=0.0, text="joint velocities")
    acceleration: float = parameter(5e-4, ge=0.0, text="generalised accelerations")
    force: float = parameter(1e-3, ge=0.0, text="contact forces")
    impulse: float = parameter(0.05, ge=0.0, text="impulses at touchdown, not integrated over time")


class JumpTask(FreeTimes):
    """One jump from standing to standing, or several in a row.

    Heights are the centre of mass's above where it stands at the start. The world's origin is the
    ground midway between the soles at the start, x forward, z up. What is ``None`` (``free`` in a
    file) is left to the planner.

    Several jumps follow each other without standing still: ``repeat`` does the same jump that many
    times, ``jumps`` lists them, each relative to where it begins, with what the task says where
    they say nothing. With both the whole list is repeated.

    Raises pydantic's ``ValidationError`` for values out of range and for contradictions;
    ``read_task`` turns it into a ``JumpTaskError``.
    """

    name: str = parameter(text="what the jump is called")
    robot: str = parameter("bruce", text="the robot, named as in a graph file")
    formulation: Literal["full", "paper", "srbm"] = parameter(
        "full",
        text="full: whole-body dynamics and motors; paper: centroidal momentum and kinematics as in the "
        "paper; srbm: a single rigid body with massless legs",
    )
    recipe: Literal["robust", "paper"] = parameter(
        "robust",
        text="robust: parameters that are not set are chosen from task and robot so that the jump "
        "lands; paper: they have the defaults of this table",
    )
    rise: float | None = parameter(
        None, unit="m", gt=0.0, le=2.0, text="apex of the centre of mass above standing"
    )
    take_off_speed: float | None = parameter(
        None, unit="m/s", gt=0.0, le=8.0, text="vertical speed of the centre of mass at lift-off"
    )
    distance_x: float = parameter(0.0, unit="m", ge=-2.0, le=2.0, text="how far ahead it lands")
    distance_y: float = parameter(
        0.0, unit="m", ge=-2.0, le=2.0, text="how far to the left it lands"
    )
    twist: float = parameter(
        0.0, unit="rad", ge=-6.3, le=6.3, text="heading at landing, to the left; world frame"
    )
    landing_height: float = parameter(
        0.0, unit="m", ge=-2.0, le=2.0,
        text="ground at landing above the ground at the start, which goes on as its slope says",
    )  # fmt: skip
    slope: Slope | None = parameter(
        None, unit="rad",
        text="angles by which the ground at the start rises along x and y; None: it is level",
    )  # fmt: skip
    landing_slope: Slope | None = parameter(
        None, unit="rad", text="the same at landing; None: the ground leans as at the start"
    )
    step_edge: float | None = parameter(
        None, unit="m", ge=-2.0, le=2.0,
        text="x at which the ground changes its height; None: midway between start and landing",
    )  # fmt: skip
    gap: float | None = parameter(
        None, unit="m", ge=0.0, le=1.0,
        text="width of a gap in the ground that it jumps over, midway or at the step's edge",
    )  # fmt: skip
    rough: RoughGround | None = parameter(
        None, text="uneven ground under all the jumps, drawn by a seed; None: what they say"
    )
    stairs: KnownStairs | None = parameter(
        None, text="stairs under all the jumps, which set their landing heights and edges"
    )
    rotation: float = parameter(
        0.0, unit="rad", ge=-12.6, le=12.6,
        text="the body's turn in pitch from start to landing; 360 deg is a forward somersault",
    )  # fmt: skip
    squat_time: float | None = parameter(
        0.4, unit="s", gt=0.0, le=5.0, text="time of the squat; None: found by the planner"
    )
    thrust_time: float | None = parameter(
        0.25, unit="s", gt=0.0, le=2.0, text="time of the thrust; None: found by the planner"
    )
    flight_time: float | None = parameter(
        None, unit="s", gt=0.0, le=3.0, text="time of the flight; None: found by the planner"
    )
    landing_time: float | None = parameter(
        0.5,
        unit="s",
        gt=0.0,
        le=5.0,
        text="time from touchdown to rest; None: found by the planner",
    )
    contact_time: float | None = parameter(
        None, unit="s", gt=0.0, le=5.0,
        text="time on the ground between two jumps; None: found by the planner",
    )  # fmt: skip
    jumps: tuple[Hop, ...] | None = parameter(
        None, min_length=1, max_length=50, text="jumps in a row; None: one jump"
    )
    repeat: int | None = parameter(
        None, ge=1, le=100, text="how often the jumps are repeated in a row"
    )
    phases: tuple[PhaseSpec, ...] | None = parameter(
        None, text="the sequence of contacts; None: squat, thrust, flight, landing, on all contacts"
    )
    take_off: Mapping[str, float] | None = parameter(
        None, unit="s",
        text="how long before the flight contact points leave the ground, by a name as in contacts of phases: "
        "{fore: 80 ms}; None: all at once",
    )  # fmt: skip
    touchdown: Mapping[str, float] | None = parameter(
        None, unit="s",
        text="how long after the flight contact points come down, likewise: {hind: 60 ms}; None: all at once",
    )  # fmt: skip
    touchdown_lean: float | None = parameter(
        None, unit="rad", ge=0.0, le=1.5,
        text="largest lean of the torso forwards or backwards at touchdown; None: any",
    )  # fmt: skip
    lift_off_momentum: float | None = parameter(
        None, unit="N*m*s", ge=0.0, le=20.0,
        text="largest angular momentum about the centre of mass at lift-off, about each axis; "
        "None: any",
    )  # fmt: skip
    touchdown_momentum: float | None = parameter(
        None, unit="N*m*s", ge=0.0, le=20.0,
        text="the same at touchdown, after the impact if there is one; None: any",
    )  # fmt: skip
    impact: bool = parameter(
        False, text="feet may hit the ground with speed and stop by an impulse; else they "
        "arrive at rest"
    )  # fmt: skip
    knots: Knots = parameter(Knots, text="numbers of intervals in each phase")
    profile: str = parameter(
        "", text="actuator profile; empty: that of the graph, or the robot's first"
    )
    effort: float = parameter(
        1.0, gt=0.0, le=1.0,
        text="share of the motors' torque and speed that the plan may use; the rest is for feedback",
    )  # fmt: skip
    friction: float = parameter(0.5, gt=0.0, le=2.0, text="coefficient between foot and ground")
    foot_clearance: float = parameter(
        0.02, unit="m", ge=0.0, le=0.5,
        text="least height of the feet above the ground in the middle of the flight",
    )  # fmt: skip
    leg_clearance: float = parameter(
        0.01, unit="m", ge=0.0, le=0.2, text="least gap between the legs"
    )
    weights: Weights = parameter(Weights, text="weights of the cost")
    margins: Margins | None = parameter(
        None, text="room that the plan leaves to the feedback; None: only 5 mrad at the joints"
    )
    bounds: BoundarySet | None = parameter(
        None,
        text="formulation paper: bounds on speeds, forces and momentum, in place of motors; None: none",
    )
    moving: tuple[str, ...] | None = parameter(
        None, min_length=1,
        text="held joints that take part in the jump, such as arms, by name or pattern: [\"*_shoulder_pitch_joint\"]; "
        "None: those that the robot's description holds stay held",
    )  # fmt: skip
    initial: Mapping[str, float] = parameter(
        {}, unit="rad", text="joint angles at the start, by name; others as the robot stands"
    )
    final: Mapping[str, float] = parameter(
        {}, unit="rad", text="joint angles at the end, by name; others as the robot stands"
    )

    @model_validator(mode="after")
    def _check_together(self) -> JumpTask:
        if self.rise is not None and self.take_off_speed is not None:
            raise ValueError("give rise or take_off_speed, not both: one follows from the other")
        own: tuple[JumpTask | Hop, ...] = (self, *(self.jumps or ()))
        for name in ("rough", "stairs"):
            says = {"landing_height", "gap", "step_edge", "slope", "landing_slope", "rough"} - {
                name
            }
            more = [key for key in sorted(says) for one in own if getattr(one, key, None)]
            if getattr(self, name) is not None and more:
                raise ValueError(
                    f"{name} says what the ground is: give {name}, or {more[0]}, not both"
                )
        for angle in (a for one in own for a in (*(getattr(one, "slope", None) or ()),
                                                 *(one.landing_slope or ()))):  # fmt: skip
            if not abs(angle) <= STEEPEST:
                raise ValueError(
                    f"a slope is at most {math.degrees(STEEPEST):.0f} deg, not "
                    f"{math.degrees(angle):.4g} deg"
                )
        for number, hop in enumerate(self.hops()):
            which = f"jump {number + 1}: " if self.jumps else ""
            up = hop.landing_height or 0.0
            free = hop.rise is None and hop.take_off_speed is None and hop.flight_time is None
            if hop.rise is not None and hop.take_off_speed is not None:
                raise ValueError(f"{which}give rise or take_off_speed, not both")
            if free and not up and not hop.rotation:
                raise ValueError(
                    f"{which}say how high the jump is: rise, take_off_speed or flight_time"
                )
            if hop.rise is not None and hop.rise + 0.15 < up:
                raise ValueError(
                    f"{which}a rise of {hop.rise:g} m cannot reach ground that is {up:g} m higher; "
                    f"ask for a rise above {up:g} m"
                )
        for name, phase in (("take_off", "thrust"), ("touchdown", "landing")):
            lifted, whole = getattr(self, name), f"{phase}_time"
            if lifted is None:
                continue
            if self.phases is not None:
                raise ValueError(f"give {name}, or phases, which say the same and more, not both")
            given = getattr(self, whole) if whole in self.model_fields_set else None
            wrong = wrong_times(lifted, given, phase)
            if wrong:
                raise ValueError(f"{name}: {wrong}")
        wrong = check_phase_specs(self.phase_specs(), len(self.hops()))
        if wrong:
            raise ValueError(wrong)
        return self

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Copy the task as pydantic does, with what ``hops`` and ``places`` have kept only where these stay the same."""
        copy = super().model_copy(update=update, deep=deep)
        if not _LEADING.isdisjoint(update or ()):
            for name in ("_every_hop", "_every_place"):
                vars(copy).pop(name, None)
        return copy

    def hops(self) -> tuple[Hop, ...]:
        """Return the jumps in a row, everything filled in; a single one by default."""
        return self._every_hop

    @cached_property
    def _every_hop(self) -> tuple[Hop, ...]:
        own = {name: getattr(self, name) for name in Hop.model_fields}
        found = []
        for hop in self.jumps or (Hop(),):
            given = {name: value for name, value in hop if value is not None}
            how = {"rise", "take_off_speed"}
            found.append(
                Hop(**{k: v for k, v in own.items() if not (k in how and how & set(given))} | given)
            )
        row = tuple(found) * (self.repeat or 1)
        if self.slope or any(hop.landing_slope for hop in row):
            return on_slopes(row, self.slope or LEVEL)
        drawn = self.rough or self.stairs
        return row if drawn is None else drawn.under(row)

    def places(self) -> tuple[StanceLocation, ...]:
        """Return the places of the robot at the start, between its jumps, and at the end."""
        return self._every_place

    @cached_property
    def _every_place(self) -> tuple[StanceLocation, ...]:
        return places_of(self.hops(), self.slope or LEVEL)

    @property
    def leans(self) -> bool:
        """True if the ground leans anywhere where the robot stands."""
        return any(place.slope != LEVEL for place in self.places())

    def phase_specs(self) -> tuple[PhaseSpec, ...]:
        """Return the sequence of contacts, with all times that are given and numbers of knots."""
        hops, knots = self.hops(), self.knots
        if self.phases is None:
            half = None if self.contact_time is None else 0.5 * self.contact_time
            between = (PhaseSpec(phase="landing", time=half), PhaseSpec(phase="thrust", time=half))
            found = [
                PhaseSpec(phase="squat", time=self.squat_time),
                PhaseSpec(phase="thrust", time=self.thrust_time),
            ]
            for _ in hops[:-1]:
                found += [PhaseSpec(phase="flight"), *between]
            found += [PhaseSpec(phase="flight"), PhaseSpec(phase="landing", time=self.landing_time)]
            found = self._in_turn(found)
        else:
            found = list(self.phases)
        flights = iter(hop.flight_time for hop in hops)
        filled = []
        for phase_spec in found:
            of_jump = next(flights, None) if phase_spec.phase == "flight" else None
            time = of_jump if phase_spec.time is None else phase_spec.time
            count = phase_spec.knots or int(getattr(knots, phase_spec.phase))
            filled.append(phase_spec.model_copy(update={"time": time, "knots": count}))
        return tuple(filled)

    def _in_turn(self, phase_specs: list[PhaseSpec]) -> list[PhaseSpec]:
        """Return the phases with those before and behind a flight in parts, where feet leave or land in turn."""
        found = list[PhaseSpec]()
        for phase_spec in phase_specs:
            lifted = {"thrust": self.take_off, "landing": self.touchdown}.get(phase_spec.phase)
            if not lifted:
                found.append(phase_spec)
                continue
            whole = {"phase": phase_spec.phase, "time": phase_spec.time}
            knots, landing = (
                int(getattr(self.knots, phase_spec.phase)),
                phase_spec.phase == "landing",
            )
            found += [PhaseSpec(**part) for part in in_turn(whole, lifted, knots, landing=landing)]
        return found

    def start_joints(self, robot: RobotDescription) -> dict[str, float]:
        """Return the joint angles [rad] by name at the start. Raises ``JumpTaskError`` for an unknown joint."""
        return _stance(robot, self.initial, "initial")

    def end_joints(self, robot: RobotDescription) -> dict[str, float]:
        """Return the joint angles [rad] by name at the end. Raises ``JumpTaskError`` for an unknown joint."""
        return _stance(robot, self.final, "final")

    def equipped(self, robot: RobotDescription) -> RobotDescription:
        """Return the robot with the task's actuator profile in use, and the joints free that take part.

        Raises:
            JumpTaskError: the robot has no such profile or joint; the message names those that it has.
        """
        try:
            robot = robot.with_profile(self.profile) if self.profile else robot
        except LookupError as error:
            raise JumpTaskError(f"profile: {error.args[0]}") from error
        return self._freed(robot)

    def _freed(self, robot: RobotDescription) -> RobotDescription:
        """Return the robot with the joints free that take part."""
        try:
            return robot.freed(self.moving or ())
        except LookupError as error:
            raise JumpTaskError(f"moving: {error.args[0]}") from error

    def resolved(self, robot: RobotDescription) -> JumpTask:
        """Return the task with all that it leaves unsaid: what the ``recipe`` chooses for task and robot, times and
        weights that suit the robot's size (``scaling``), the actuator profile in use.
        """
        robot = self._freed(robot)
        found = chosen_fields(self, choices(self, robot))
        changed = found | scaled_defaults(self.model_copy(update=found), robot)
        if not self.profile:
            changed["profile"] = robot.motors.profile
        return self.model_copy(update=changed) if changed else self

    @property
    def landing_effort(self) -> float:
        """The share of the motors' torque and speed that the plan may use from touchdown on."""
        most = None if self.margins is None else self.margins.landing_effort
        return self.effort if most is None else most

    def content(self) -> dict[str, Any]:
        """Return all that decides the plan, as plain data: everything but the name."""
        # What is not given is left out, so that a parameter added later changes no hash.
        # So is the weight of impulses where there are none, and how the rest was chosen.
        unused: dict[str, Any] = {} if self.impact else {"weights": {"impulse"}}
        left_out = {"name": True, "recipe": True, **unused}
        return self.model_dump(mode="json", exclude=left_out, exclude_none=True)

    def hash(self, robot: RobotDescription) -> str:
        """Return the key under which a plan of this task is kept: the same for the same task, robot and format."""
        whole = {
            "format": PLAN_FORMAT,
            "task": self.resolved(robot).content(),
            "robot": planned_robot(robot),
        }
        return content_name(whole)


def content_name(content: object) -> str:
    """Return a name for a file that follows from plain data: the same for the same data."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def planned_robot(robot: RobotDescription) -> dict[str, Any]:
    """Return what a plan depends on of a robot. The task itself names the actuators it is planned for; no plan depends
    on sensors that are mounted on links.
    """
    return robot.changed(profile="", sensors=robot.sensors.built_in).model_dump(mode="json")


_LEADING = frozenset((*Hop.model_fields, "jumps", "repeat", "slope", "rough", "stairs"))
"""The parameters that ``hops`` and ``places`` follow from."""


def _stance(robot: RobotDescription, given: Mapping[str, float], which: str) -> dict[str, float]:
    known = [joint.name for joint in robot.joints]
    unknown = [name for name in given if name not in known]
    if unknown:
        raise JumpTaskError(
            f"{which}: {robot.name} has no joint {', '.join(unknown)}; there is {', '.join(known)}"
        )
    standing = dict(zip(known, robot.standing_position.tolist(), strict=True))
    return standing | dict(robot.held) | dict(given)


def make_task(
    values: Mapping[str, Any], *, where: str = "task", source: LocatedFile | None = None
) -> JumpTask:
    """Return a task from plain values, quantities as numbers or text.

    ``where`` is what messages call it; with ``source``, the file the values are from, they begin
    with the line and column instead.

    Raises:
        JumpTaskError: one line for every value that is wrong, with its key, what was found and what
            is expected.
    """
    try:
        return JumpTask.model_validate(values)
    except ValidationError as error:
        lines = []
        for problem in error.errors():
            line, place = _explain(problem), where
            if source is not None and not problem["loc"]:
                place = source.location_of_words(line)
            elif source is not None:
                place = source.place(problem["loc"], key=problem["type"] == "extra_forbidden")
            lines.append(f"{place}: {line}")
        raise JumpTaskError("\n".join(lines)) from error


def _explain(problem: Any) -> str:
    """Return one of pydantic's problems as a line: the key, what is expected and what was found."""
    location = problem["loc"]
    if problem["type"] == "extra_forbidden":
        near = nearest(str(location[-1]), names_at(JumpTask, location[:-1]), 1, 0.0)
        return (
            f"{'.'.join(map(str, location))}: is no parameter of a task; the nearest is {near[0]}"
        )
    return describe(problem, JumpTask)
