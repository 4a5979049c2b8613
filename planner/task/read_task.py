"""Reads a task from its YAML file, applies changes to it, and reports all of its mistakes at once.

Contradictions within a task, and between a task and its robot, are found without solving anything. The checks are bounds that no jump can exceed. A task that passes them may still have no plan.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription, find_robot
from ...robots.kinematics import (
    contact_centres,
    link_poses,
    link_poses_in_base,
    standing_contacts,
    standing_heights,
)
from ...robots.shapes import corners_of
from .boundary_set import unsupported_keys
from .contact_groups import contact_points, wrong_groups
from .files import JumpTaskError, read_located
from .margins import unknown_joints
from .sequence import Hop, StanceLocation, edge_of
from .task import JumpTask, make_task


def read_task(path: str | Path) -> JumpTask:
    """Return the task in a YAML file; its name is the file's where it has none.

    Raises:
        JumpTaskError: the file cannot be read, a value is wrong, or what is asked for contradicts
            itself or the robot; one line for each, with ``file:line:column``.
    """
    path = Path(path)
    source = read_located(path, "rise: 15 cm")
    task = make_task({"name": path.stem, **source.values}, where=str(path), source=source)
    try:
        robot = find_robot(task.robot, path.parent)
    except (LookupError, ValueError) as error:
        raise JumpTaskError(f"{source.place(['robot'])}: robot: {error.args[0]}") from error
    wrong = contradictions(task, robot)
    if wrong:
        raise JumpTaskError(
            "\n".join(f"{source.place(key.split('.'))}: {key}: {text}" for key, text in wrong)
        )
    return task


INSTEAD = ("rise", "take_off_speed")
"""Two ways to say one thing: a change of one of them takes the place of the other."""


def changed_task(path: Path, changes: Mapping[str, Any]) -> JumpTask:
    """Return the task in a file with some of its parameters changed, also single ones inside ``margins``, ``weights``
    and ``knots``.

    Raises:
        JumpTaskError: the file cannot be read as a task, or a change is wrong, or they contradict each
            other; lines about a change begin with ``task: key:``.
    """
    read_task(path)  # what is wrong in the file itself is said with its line
    values = dict(read_located(path, "rise: 15 cm").values)
    for name in INSTEAD:
        if any(changes.get(other) is not None for other in INSTEAD if other != name):
            values.pop(name, None)
    task = make_task({**_merged(values, changes), "name": changes.get("name", "")})
    wrong = contradictions(task, find_robot(task.robot, path.parent))
    if wrong:
        raise JumpTaskError("\n".join(f"task: {key}: {text}" for key, text in wrong))
    return spoken_name(task)


def _merged(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    found = dict(old)
    for key, value in new.items():
        inner = found.get(key)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            found[key] = _merged(inner, value)
        else:
            found[key] = value
    return found


def spoken_name(task: JumpTask) -> JumpTask:
    """Return the task, called by what it asks for if it has no name: ``12 cm high, 20 cm ahead``."""
    return task if task.name else task.model_copy(update={"name": describe_task(task)})


def describe_task(task: JumpTask) -> str:
    """Return a summary of a task in a few words."""
    if task.jumps or task.repeat:
        return f"{len(task.hops())} jumps"
    told = []
    if task.rise is not None:
        told.append(f"{_cm(task.rise)} high")
    if task.take_off_speed is not None:
        told.append(f"{task.take_off_speed:g} m per s up")
    pairs = (
        (task.distance_x, "ahead", "back"),
        (task.distance_y, "to the left", "to the right"),
        (task.landing_height, "up", "down"),
    )
    leaning = (("on", task.slope), ("onto", task.landing_slope))
    told += [f"{_cm(abs(value))} {plus if value > 0 else minus}" for value, plus, minus in pairs
             if value]  # fmt: skip
    for angle, what in ((task.twist, "turned"), (task.rotation, "over")):
        if angle:
            told.append(f"{what} {math.degrees(angle):.4g} deg")
    told += [
        f"{where} a slope of {' and '.join(f'{math.degrees(angle):.4g}' for angle in slope)} deg"
        for where, slope in leaning
        if slope is not None
    ]
    return ", ".join(told) or "jump"


def _cm(length: float) -> str:
    return f"{100.0 * length:.4g} cm"


LENIENCE = 0.03
"""Travel of the centre of mass within the body [m], beyond what the legs' length allows."""

Contradiction = tuple[str, str]
"""The parameter to look at first, and what is wrong."""


def contradictions(task: JumpTask, robot: RobotDescription) -> list[Contradiction]:
    """Return all contradictions of the task, in the order of its parameters."""
    return [
        *_unknown_names(task, robot),
        *_unsupported(task),
        *_contact_phases(task, robot),
        *_flight(task, robot),
        *_edge(task, robot),
        *_slopes(task),
    ]


def require_consistent(task: JumpTask, robot: RobotDescription) -> None:
    """Refuse a task that contradicts itself or its robot.

    Raises:
        JumpTaskError: one line for every contradiction.
    """
    found = contradictions(task, robot)
    if found:
        raise JumpTaskError("\n".join(f"{task.name}: {key}: {text}" for key, text in found))


def _unsupported(task: JumpTask) -> Iterator[Contradiction]:
    """Yield what the task's formulation has nothing for; it would be ignored."""
    other = "paper" if task.formulation == "full" else "full"
    for key in unsupported_keys(task):
        yield (
            key,
            f"formulation {task.formulation} has nothing for it; leave it out, or use formulation: {other}",
        )


def _unknown_names(task: JumpTask, robot: RobotDescription) -> Iterator[Contradiction]:
    from ...files.problems import nearest

    if task.profile and task.profile not in robot.profiles:
        there = ", ".join(robot.profiles)
        yield "profile", f"{robot.name} has no actuator profile {task.profile!r}; there is {there}"
    joints = dict(zip((j.name for j in robot.joints), robot.joint_limits.tolist(), strict=True))
    units = {joint.name: joint.unit("rad") for joint in robot.joints}
    for key, given in (("initial", task.initial), ("final", task.final)):
        for name, angle in given.items():
            if name not in joints:
                near = ", ".join(nearest(name, joints) or joints)
                yield f"{key}.{name}", f"{robot.name} has no joint {name}; the nearest is {near}"
            elif not joints[name][0] <= angle <= joints[name][1]:
                (low, high), unit = joints[name], units[name]
                limits = f"{low:.4g} to {high:.4g} {unit}"
                yield f"{key}.{name}", f"{angle:.4g} {unit} is outside the joint's limits, {limits}"
    if task.margins is not None:
        for name in unknown_joints(task.margins, list(joints)):
            short = sorted({joint.partition("_")[2] for joint in joints} | set(joints))
            near = ", ".join(nearest(name, short) or short)
            yield (
                f"margins.landing_limits.{name}",
                f"{robot.name} has no joint {name}; the nearest is {near}",
            )


def _contact_phases(task: JumpTask, robot: RobotDescription) -> Iterator[Contradiction]:
    """Yield contact points that feet leave and land on in turn, or that phases name, and the robot does not have; and
    phases in which none pushes.
    """
    groups = [
        (f"{key}.{name}", name)
        for key in ("take_off", "touchdown")
        for name in getattr(task, key) or ()
    ]
    for number, phase_spec in enumerate(task.phases or ()):
        groups.append((f"phases.{number}.contacts", phase_spec.contacts))
        groups.append((f"phases.{number}.raised", phase_spec.raised or ()))
    wrong = list(wrong_groups(robot, groups)) if robot.contacts else []
    yield from wrong
    for key in ("take_off", "touchdown"):
        named = contact_points(robot, getattr(task, key) or ())
        if named and not wrong and len(named) == len(robot.contacts):
            yield (
                key,
                f"names all contact points of {robot.name}; leave out those that leave last, or land first",
            )


def _jumps(task: JumpTask) -> Iterator[tuple[str, Hop, StanceLocation, StanceLocation]]:
    """Yield every jump that is written down, with its path in the task and where it begins and ends."""
    places = task.places()
    for number, hop in enumerate(task.hops()[: len(task.jumps or "1")]):
        path = f"jumps.{number}." if task.jumps else ""
        yield path, hop, places[number], places[number + 1]


def _flight(task: JumpTask, robot: RobotDescription) -> Iterator[Contradiction]:
    """Yield contradictions between height and time of a flight, which follow from one another, but for where the legs
    let the centre of mass be at lift-off and touchdown.
    """
    low, high = leg_travel(robot)
    for path, hop, _, _ in _jumps(task):
        asked, up = hop.flight_time, hop.landing_height or 0.0
        if asked is not None and hop.rise is not None:
            # Each half of the flight is a fall to or from the apex.
            times = [
                _fall(hop.rise - level) + _fall(hop.rise - up - level) for level in (low, high)
            ]
            what = f"a rise of {hop.rise:g} m"
        elif asked is not None and hop.take_off_speed is not None:
            speed = hop.take_off_speed
            most = speed**2 / (2.0 * GRAVITY) - up
            times = [speed / GRAVITY + _fall(most + way) for way in (low - high, high - low)]
            what = f"a take_off_speed of {speed:g} m/s"
        else:
            continue
        if not min(times) <= asked <= max(times):
            yield (
                f"{path}flight_time",
                f"{what} takes {min(times):.3f} to {max(times):.3f} s in the air, not {asked:g} s; "
                + "leave flight_time to the planner, or ask for another height",
            )


def _fall(height: float) -> float:
    """Return the duration of a fall [s]; none from below the ground."""
    return math.sqrt(2.0 * max(0.0, height) / GRAVITY)


def leg_travel(robot: RobotDescription) -> tuple[float, float]:
    """Return the least and the greatest height of the centre of mass on the ground, above standing [m]."""
    poses = link_poses(
        robot, np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)),
        np.array([robot.standing_position, np.zeros(len(robot.joints))]),
    )  # fmt: skip
    standing, straight = np.min([poses.of(foot.link)[0][:, 2] for foot in robot.feet], axis=0)
    return 0.8 * float(standing), float(standing - straight) + LENIENCE


def _slopes(task: JumpTask) -> Iterator[Contradiction]:
    """Yield the ground that the robot stands on and on which its feet do not hold."""
    where = [("slope", task.places()[0])]
    where += [(f"{path}landing_slope", end) for path, _, _, end in _jumps(task)]
    for key, place in where:
        steep = math.hypot(*(math.tan(angle) for angle in place.slope))
        if steep >= task.friction:
            needed = (
                f"ground that rises {100.0 * steep:.0f} cm a metre needs a friction of more than "
            )
            said = f"{steep:.2g}, and the task says friction: {task.friction:g}; "
            yield key, needed + said + "ask for a smaller slope"


def _edge(task: JumpTask, robot: RobotDescription) -> Iterator[Contradiction]:
    """Yield the faults of a step: its edge is under a foot, or part of the standing robot is in the step."""
    for path, hop, start, end in _jumps(task):
        edge = edge_of(hop, start)
        if edge is None or not robot.contacts:
            continue
        for where, place, higher in _stances(hop, start, end):
            for name, back, front in _reaches(robot, place, higher):
                if back < edge < front:
                    yield (
                        f"{path}step_edge",
                        f"the step's edge at x = {edge:g} m is under {name} at the {where}, which "
                        + f"reach from {back:.3f} to {front:.3f} m; give a step_edge between start and "
                        + "landing, or jump farther",
                    )
                    break


def edge_room(
    robot: RobotDescription,
    hop: Hop,
    start: StanceLocation,
    end: StanceLocation,
    above: float = 0.0,
) -> tuple[float, float]:
    """Return the range of x [m] in which an edge under a jump is under no foot, and nothing of the standing robot in
    the step, or less than ``above`` [m] over it: from the front of the robot where it begins to its back where it
    lands, the former first. A robot that lands near where it stood has no such room: the former is then beyond the
    latter.
    """
    before, behind = (
        list(_reaches(robot, place, higher + above if higher > 0.0 else higher))
        for _, place, higher in _stances(hop, start, end)
    )
    if (hop.distance_x or 0.0) >= 0.0:
        return max(front for _, _, front in before), min(back for _, back, _ in behind)
    return min(back for _, back, _ in before), max(front for _, _, front in behind)


def _stances(
    hop: Hop, start: StanceLocation, end: StanceLocation
) -> tuple[tuple[str, StanceLocation, float], ...]:
    """Return the places of the robot before and behind an edge, and how much higher the ground beyond it is [m]."""
    step = hop.landing_height or 0.0
    return ("start", start, step), ("landing", end, -step)


def _reaches(
    robot: RobotDescription, place: StanceLocation, higher: float
) -> Iterator[tuple[str, float, float]]:
    """Yield the range of x [m] that the feet of a robot that stands there reach, and what of it is lower than ground
    beside it that is ``higher`` [m]: it must be away from that with all that is below its height.
    """
    feet = standing_contacts(robot)
    for name, points, radii in (
        ("the feet", feet, np.zeros(len(feet))), *_low_links(robot, higher)
    ):  # fmt: skip
        x: Array = place.x + product(points[:, :2], _onward(place.heading))
        yield name, float(np.min(x - radii)), float(np.max(x + radii))


def _onward(heading: float) -> Array:
    return np.array([math.cos(heading), -math.sin(heading)])


def _low_links(robot: RobotDescription, height: float) -> Iterator[tuple[str, Array, Array]]:
    """Yield the links of the standing robot of which a part is lower than that [m] above the ground: the name, the
    places (n, 3) of the ends of the shapes that are, from the feet's middle, and their radii (n,).
    """
    if height <= 0.0:
        return
    poses = link_poses_in_base(robot, robot.standing_position)
    links = {foot.name: foot.link for foot in robot.feet}
    rotation, origin = poses[links[robot.contacts[0].foot]]
    middle = origin + product(rotation, contact_centres(robot)[0]) - standing_contacts(robot)[0]
    ground = float(np.min(standing_heights(robot)))
    for link in robot.links:
        rotation, origin = poses[link.name]
        corners, radii = corners_of(link.shapes)
        places = origin + product(corners, rotation.T)
        low = places[:, 2] - radii - ground < height
        if low.any():
            yield link.name, places[low] - middle, radii[low]
