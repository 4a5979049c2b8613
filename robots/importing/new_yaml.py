"""Writes a first short YAML for a URDF or MJCF file, as far as it can be found, with the feet guessed.

A foot is the last link of a limb of two joints or more that reaches down, at the zero of all
joints, nearly as far as the farthest one does. Balls that the file has there for collisions are
taken for its contact points. Else a leg with an ankle stands on the corners of its lowest shapes, and any
other on a ball at the lowest body of the link.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...files.problems import listing
from ...mathematics.rotations import quaternions_of_matrices
from ..comparison.differences import Differences, unread
from ..plausible_size import wrong_size
from ..robot_description import RobotDescription
from ..validation import RobotError, find_errors
from ..validation.errors import number, vector
from .build import BodyFrame, LinkTree, tidy
from .capsules import Capsule
from .description_data import Imported, import_robot
from .fit_to_ground import fit_to_ground
from .raw_model import RawModel


class NewYaml(NamedTuple):
    """A short YAML: its ``text``, what the file lacks or what was guessed in ``notes``, and how what was read compares with
    other readings of the file."""

    text: str
    notes: list[str]
    compared: list[Differences]


def new_yaml(file: Path, target: Path) -> NewYaml:
    """Return the YAML to be written to ``target``.

    Raises:
        RobotError: the file describes no robot, or MuJoCo or Pinocchio reads another one in it.
    """
    bare = import_robot(file, {})
    guessed, more = guess(bare)
    feet, held = guessed["feet"], guessed["held"]
    imported = import_robot(file, {"name": target.stem, **guessed}, bare.model)
    errors = find_errors(imported.data)
    if errors:
        raise RobotError(str(file), _placed(imported, errors))
    compared = imported.compared()
    robot = RobotDescription.model_validate(imported.data)
    robot, fitted = fit_to_ground(robot, False, imported.model.pose)
    notes = [*more, *imported.notes, *fitted, *wrong_size(robot), *unread(compared)]
    name = os.path.relpath(file, target.parent)
    estimated = not any(joint.rotor_inertia for joint in imported.built.raw_joints.values())
    sensors = _sensors(robot, imported.model, imported.built)
    text = yaml_text(Path(name).as_posix(), robot, feet, held, notes, estimated, sensors)
    return NewYaml(text, notes, compared)


def guess(bare: Imported) -> tuple[dict[str, Any], list[str]]:
    """Return the keys ``feet`` and ``held`` of a short YAML for a file that was read without one, and notes.

    Joints are held that move no foot, such as those of arms, or several feet, such as a spine's.
    """
    feet = guess_feet(bare.model, bare.built)
    if not feet:
        return {"feet": [], "held": {}}, []
    notes = [f"the feet are guessed: {listing([foot['name'] for foot in feet], 8)}"]
    carrier = {joint["child"]: joint for joint in bare.built.joints}
    moved: Counter[str] = Counter()
    for foot in feet:
        link = bare.built.frames[foot["at"]].link
        while link in carrier:
            moved[carrier[link]["name"]] += 1
            link = carrier[link]["parent"]
    held = {
        joint["name"]: float(bare.data["standing"].get(joint["name"], 0.0))
        for joint in bare.built.joints
        if moved[joint["name"]] != 1
    }
    if held:
        notes.append(f"held, as they move no foot or several: {listing([*held], 6)}")
    return {"feet": feet, "held": held}, notes


def _placed(imported: Imported, errors: Any) -> list[Any]:
    from .description_data import located_in_model

    return [
        located_in_model(description_error, imported.data, imported.model)
        for description_error in errors
    ]


SAME_DIRECTION = 1e-6
"""Sensors turned by about half of that [rad] or less are parallel to their link."""
REACH = 0.1
"""Share by which a foot reaches down less than the farthest limb, at most."""
LEVEL = 0.01
"""Contact points lie within this height [m]."""
JOINTS_WITH_ANKLE, NARROW, SOLE_RADIUS = 5, 0.03, 0.005
"""Legs of so many joints have an ankle; a sole is not narrower than this [m], and its corners are so round."""
RADIUS = 0.02
"""The radius of a foot whose shape the file does not give [m]."""


def guess_feet(model: RawModel, built: LinkTree) -> list[dict[str, Any]]:
    """Return the feet as a short YAML has them: ``name``, ``at``, ``ball`` or ``points``, ``radius``; none of a robot
    that does not float.
    """
    if built.base_joint != "floating":
        return []
    heights = {link: _lowest(model, built, link) for link in _limb_ends(built)}
    lowest = min(heights.values(), default=0.0)
    if lowest >= 0.0:
        return []
    ends = [link for link, height in heights.items() if height <= (1.0 - REACH) * lowest]
    return [_foot(model, built, link) for link in ends]


def _limb_ends(built: LinkTree) -> list[str]:
    """Return the links at the end of a chain of two joints or more."""
    parent = {joint["child"]: joint["parent"] for joint in built.joints}
    ends = [link for link in parent if link not in parent.values()]
    return [link for link in ends if parent[link] != built.base]


def _origins(built: LinkTree) -> dict[str, Any]:
    """Return the origin of every link at the zero of all joints [m, base frame]."""
    places = {built.base: np.zeros(3)}
    for joint in built.joints:
        places[joint["child"]] = places[joint["parent"]] + np.array(joint["origin"])
    return places


def _bodies(built: LinkTree, link: str) -> dict[str, BodyFrame]:
    return {name: frame for name, frame in built.frames.items() if frame.link == link}


def _lowest(model: RawModel, built: LinkTree, link: str) -> float:
    """Return the lowest height of a link, with all that is fixed to it, at the zero of all joints [m]."""
    height = _origins(built)[link][2]
    found = [height]
    for name, frame in _bodies(built, link).items():
        found.append(height + frame.position[2])
        shapes = model.bodies[name].shapes if name in model.bodies else ()
        found += [height + frame.position[2] + shape.lowest(frame.rotation) for shape in shapes]
    return float(min(found))


def _place(frame: BodyFrame) -> tuple[float, ...]:
    """Return what a link's bodies are sorted by: the lowest first, of these the foremost, then the innermost. So both legs have
    their foot on the same place, in whatever order the file has its bodies."""
    x, y, z = frame.position.tolist()
    return round(z, 3), -round(x, 3), abs(round(y, 3))


def _foot(model: RawModel, built: LinkTree, link: str) -> dict[str, Any]:
    bodies = dict(sorted(_bodies(built, link).items(), key=lambda each: _place(each[1])))
    bottom = _lowest(model, built, link) - _origins(built)[link][2]
    balls = []
    for name, frame in bodies.items():
        for shape in model.bodies[name].shapes if name in model.bodies else ():
            if not isinstance(shape, Capsule):
                continue
            is_ball = np.linalg.norm(shape.end - shape.start) < 0.1 * shape.radius
            if is_ball and frame.position[2] + shape.lowest(frame.rotation) < bottom + LEVEL:
                balls.append((name, frame, 0.5 * (shape.start + shape.end), shape.radius))
    if not balls:
        name = next(iter(bodies))
        points = _sole(model, built, link, bottom, bodies[name])
        if points:
            return {"name": name, "at": name, "radius": SOLE_RADIUS, "points": points}
        return {"name": name, "at": name, "radius": RADIUS}
    name, _, centre, radius = balls[0]
    if len(balls) == 1:
        ball = [float(value) for value in np.round(centre, 6) + 0.0]
        return {"name": name, "at": name, "ball": ball, "radius": round(radius, 6)}
    points = []
    for other, frame, middle, size in balls:
        if other == name:
            down = middle - size * frame.rotation[2]
            points.append([float(value) for value in np.round(down, 6) + 0.0])
    return {"name": name, "at": name, "points": points, "radius": round(radius, 6)}


def _sole(
    model: RawModel, built: LinkTree, link: str, bottom: float, foot: BodyFrame
) -> list[list[float]]:
    """Return four corners [m, body of the foot] around what of a link's shapes is near the ground, where a leg of so
    many joints has an ankle and the shapes are wide; else none.
    """
    carrier = {joint["child"]: joint["parent"] for joint in built.joints}
    count, above = 0, link
    while above in carrier:
        count, above = count + 1, carrier[above]
    found = []
    for name, frame in _bodies(built, link).items():
        for shape in model.bodies[name].shapes if name in model.bodies else ():
            if frame.position[2] + shape.lowest(frame.rotation) < bottom + LEVEL:
                radius = shape.radius if isinstance(shape, Capsule) else 0.0
                for corner in shape.corners:
                    middle = frame.rotation @ corner + frame.position
                    if isinstance(shape, Capsule) or middle[2] < bottom + LEVEL:
                        found.append([*(middle[:2] - radius), *(middle[:2] + radius)])
    if not found or count < JOINTS_WITH_ANKLE:
        return []
    each = np.array(found)
    low, high = each[:, :2].min(axis=0), each[:, 2:].max(axis=0)
    if (high - low).min() < NARROW:
        return []
    corners = [[x, y, bottom] for x in (high[0], low[0]) for y in (high[1], low[1])]
    points = [foot.rotation.T @ (np.array(corner) - foot.position) for corner in corners]
    return [[float(value) for value in np.round(point, 6) + 0.0] for point in points]


def yaml_text(
    file: str, robot: RobotDescription, feet: list[dict[str, Any]], held: Mapping[str, float],
    notes: list[str], estimated: bool, sensors: list[str],
) -> str:  # fmt: skip
    """Return the YAML's text.

    Args:
        file: what the YAML's key ``file`` says.
        robot: as it was read with these feet.
        feet, held: that were guessed, as ``guess`` gives them.
        notes: what the file lacks, which become comments.
        estimated: whether the inertia of rotors is no file's.
        sensors: the lines that say which there are.
    """
    lines = [
        f"# What {Path(file).name} does not say of the robot. Everything here was guessed or found by",
        "# `aloft robot import`: look at each part, correct it, and write where its numbers are from.",
        f"file: {file}",
        f"name: {quoted(robot.name)}",
        'text: ""',
        f"base_joint: {robot.base_joint}",
        "",
    ]
    lines += [f"# {note}." for note in notes]
    lines += ["", *_feet(feet), "", *_profile(robot, estimated), "", *sensors]
    if feet:
        lines += ["", *_standing(robot.standing)]
    lines += [
        "",
        "# Joints that stand still at an angle while the robot is at work: arms, a waist.",
    ]
    lines += ["held:", *_numbers(held)] if held else ["held: {}"]
    return "\n".join(lines) + "\n"


def _feet(feet: list[dict[str, Any]]) -> list[str]:
    if not feet:
        return [
            "# No feet were found: nothing reaches down. Without any, leave this out.",
            "feet: []",
        ]
    lines = [
        "# GUESSED: the ends of the limbs that reach lowest. `at` is a link of the file, `ball` the",
        "# centre of a ball foot in its frame, `points` the lowest points of a sole.",
        "feet:",
    ]
    for foot in feet:
        lines.append(f"  - name: {quoted(foot['name'])}")
        lines.append(f"    at: {quoted(foot['at'])}")
        if "ball" in foot and any(foot["ball"]):
            lines.append(f"    ball: {vector(foot['ball'])}")
        if "points" in foot:
            lines.append("    points:")
            lines += [f"      - {vector(point)}" for point in foot["points"]]
        lines.append(f"    radius: {number(foot['radius'])}")
    return lines


def _profile(robot: RobotDescription, estimated: bool) -> list[str]:
    rated = robot.profiles["rated"]
    lines = [
        "# From the file: peak torques (effort limits) and no-load speeds (speed limits). ASSUMED: the",
        "# torque falls from 0.6 of the no-load speed on, and two fifths of it can be held for long.",
        "# MISSING where zero: rotor inertia at the gearbox output, friction, damping. ESTIMATED where it",
        "# is in a comment: rotor inertia, from torque and speed. A value given here counts for all",
        "# motors, so those in which motors differ are in comments; `motors: {NAME or PATTERN:",
        "# {peak_torque: ...}}` for some.",
        "profiles:",
        "  rated:",
    ]
    differ = {
        key
        for rating in rated.motors.values()
        for key, value in rating.model_dump(exclude_none=True).items()
    }
    ratings = ("peak_torque", "corner_speed", "no_load_speed", "continuous_torque")
    if rated.motors:
        values = ", ".join(f"{key}: {number(getattr(rated, key))}" for key in ratings)
        lines.append(f"    # {values}")
    else:
        lines += [f"    {key}: {number(getattr(rated, key))}" for key in ratings]
    written = not rated.motors
    for key in ("rotor_inertia", "friction", "damping"):
        value = number(getattr(rated, key))
        # What is one joint's own, in the file or by an estimate, must not become one that counts for all.
        if key in differ or (key == "rotor_inertia" and estimated and rated.rotor_inertia):
            lines.append(f"    # {key}: {value}")
            lines += [f"    #   {name}: {own}" for name, own in _own(robot, key)]
        else:
            written = True
            lines.append(f"    {key}: {value}")
    if not written:
        lines[lines.index("  rated:")] = "  rated: {}"
    return lines


def _own(robot: RobotDescription, key: str) -> list[tuple[str, str]]:
    """Return what motors have that is not the value of most, by name."""
    found = []
    for name, rating in robot.profiles["rated"].motors.items():
        value = getattr(rating, key)
        if value is not None:
            found.append((name, number(value)))
    return found


def _sensors(robot: RobotDescription, model: RawModel, built: LinkTree) -> list[str]:
    lines = [
        "# ASSUMED: an IMU at the base's origin, and a switch in every contact point.",
        "sensors:",
        f"  imu: {str(robot.sensors.imu).lower()}",
        f"  switches: {str(robot.sensors.switches).lower()}",
    ]
    found = {name: each for name, each in model.sensors.items() if each.body in built.frames}
    if found:
        lines.append("  # From the file: further sensors, each an output of the robot.")
    feet = {foot.link for foot in robot.feet}
    for name, sensor in found.items():
        frame = built.frames[sensor.body]
        entry = f"{name}: {{kind: {sensor.kind}, link: {quoted(frame.link)}, position: {vector(frame.point(sensor.position))}"
        turn = quaternions_of_matrices(frame.rotation @ sensor.rotation)
        if np.abs(turn[:3]).max() > SAME_DIRECTION:
            entry += f", orientation: {vector(tidy(turn, 9))}"
        if sensor.noise:
            each = ", ".join(f"{k}: {{noise: {number(v)}}}" for k, v in sensor.noise.items())
            entry += f", noise: {{{each}}}"
        if sensor.kind == "force_torque" and frame.link not in feet:
            lines.append(
                "  # Left out, as force_torque measures what a link's contacts with the ground give,"
            )
            lines.append(f"  # and this link is no foot's: {entry}}}")
        else:
            lines.append(f"  {entry}}}")
    return lines


def _standing(angles: Mapping[str, float]) -> list[str]:
    if not angles:
        return ["# NOT FOUND: a pose in which it stands. Write one: standing: {JOINT: ANGLE, ...}"]
    found = "# Found: soles on one level, the centre of mass over their middle."
    return [found, "standing:", *_numbers(angles)]


def _numbers(angles: Mapping[str, float]) -> list[str]:
    return [f"  {quoted(name)}: {round(angle, 9):.9g}" for name, angle in angles.items()]


def quoted(name: str) -> str:
    """Return a name as YAML has it: in quotes where YAML would take it for a number or a truth value."""
    import yaml

    try:
        plain = yaml.safe_load(name) == name
    except yaml.YAMLError:
        plain = False
    return name if plain else f'"{name}"'
