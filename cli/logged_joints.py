"""Joints of a log's columns for `aloft log import`: by the file's names, those given, or what the data tell."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np

from ..hal.log.played_log import NO_JOINT, UNNAMED
from ..mathematics.arrays import Array, Flags2D
from ..runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ..hal.log.log_file import LogFile
    from ..hal.log.standing_feet import LoggedMotion
    from ..robots.robot_description import RobotDescription

PERIOD, LONGEST = 0.005, 600.0
"""Between the samples of the log that are looked at, and how much of it is [s]."""
SMOOTH, LEVEL, IMPACT = 0.04, 1.0, 0.05
"""Seconds over which speeds are meant, over which specific force is the direction up, and around a change of contact that do not count."""
_KINDS = {
    "velocity": {"vel", "velocity", "speed", "dq", "qd", "v"},
    "torque": {"tau", "torque", "effort"},
    "position": {"pos", "position", "angle", "q", "meas", "measured"},
}
"""Words beside a joint's name in a column's."""
_LIKELY = ("meas", "actual", "fbk", "feedback")
_UNLIKELY = (
    "des", "ref", "cmd", "command", "target", "setpoint", "filt", "fric", "err", "con",
    "estimate", "estimated", "estimator", "plan", "planned", "predicted", "reference", "truth",
)  # fmt: skip
"""Words of what was measured, and of what was wanted, computed or known to a simulator only: no sensor."""


@dataclass(frozen=True)
class Named:
    """The joint of one column, how sure that is, and why."""

    column: str
    joint: str | None
    sure: str
    why: str


@dataclass
class LoggedJoints:
    """The value of `joints.names`, the guess of each column, and remarks."""

    names: str | list[str] | None = None
    columns: list[Named] = field(default_factory=list)
    sensor: str | None = None
    notes: list[str] = field(default_factory=list)


def doubt_of(name: str, beside: str = "") -> tuple[int, int]:
    """Return by how much a column is in doubt: 0 if its name says that it was measured, 2 if it was wanted or computed, else 1; and
    less, the more words it begins with as the column ``beside`` does, which was measured."""
    parts = re.split(r"[^a-z]+", name.lower())
    shared = 0
    for one, other in zip(_words(name), _words(beside), strict=False):
        if one != other:
            break
        shared += 1
    if any(word in name.lower() for word in _LIKELY):
        return 0, -shared
    return (2 if any(word in parts for word in _UNLIKELY) else 1), -shared


def lists_of_joints(
    texts: Mapping[str, Sequence[str]], robot: RobotDescription | None
) -> dict[str, list[str]]:
    """Return the file's lists of texts that name joints: half of them the robot's."""
    if robot is None:
        return {name: list(each) for name, each in texts.items() if len(each) > 1}
    own = {joint.name for joint in robot.joints}
    return {
        name: list(each)
        for name, each in texts.items()
        if 2 * len(own & set(each)) >= len(each) > 0
    }


def columns_of_joints(
    widths: Mapping[str, int], robot: RobotDescription, beside: str = ""
) -> dict[str, Any]:
    """Return what `joints` is to be where columns of one number have a joint's name each, such as ``l_knee_vel``; else nothing.

    Of several columns of a joint, the one that is least in doubt is taken; ``beside`` is one that was measured.
    """
    names = [joint.name for joint in robot.joints]
    found: dict[str, dict[str, str]] = {kind: {} for kind in _KINDS}
    for column, width in sorted(widths.items(), key=lambda each: doubt_of(each[0], beside)):
        words = _words(column)
        own = [name for name in names if _without(words, _words(name)) is not None]
        if width != 1 or not own:
            continue
        name = max(own, key=len)
        rest = set(_without(words, _words(name)) or ())
        kind = next((kind for kind, each in _KINDS.items() if each & rest), None)
        if kind is not None or not rest:
            found[kind or "position"].setdefault(name, column)
    joints = [name for name in names if name in found["position"]]
    whole = [kind for kind in ("position", "velocity", "torque") if set(joints) <= set(found[kind])]
    if not joints:
        return {}
    return {"names": joints} | {kind: [found[kind][name] for name in joints] for kind in whole}


def _words(text: str) -> list[str]:
    return re.findall(r"[a-z]+|[0-9]+", text.lower())


def _without(words: list[str], part: list[str]) -> list[str] | None:
    """Return what is left of words without consecutive ones; none if they are not there."""
    for k in range(len(words) - len(part) + 1):
        if words[k : k + len(part)] == part:
            return words[:k] + words[k + len(part) :]
    return None


def name_joints(
    log: LogFile,
    played: Mapping[str, Any],
    robot: RobotDescription | None,
    given: Sequence[str] = (),
) -> LoggedJoints:
    """Return which joint each column of `joints.position` is.

    Args:
        log: the file.
        played: what `hal.LogRobot` is to play: `joints`, and what may tell how the base moves and when feet stand.
        robot: whose joints they are; without it the file's names, or those given, count.
        given: names of the columns in their order.

    Raises:
        AloftError: not as many are given as there are columns, or one is near the name of a joint.
    """
    labels = _labels(log, played["joints"]["position"])
    lists = {
        name: each
        for name, each in lists_of_joints(log.texts, robot).items()
        if len(each) == len(labels)
    }
    by_column = played["joints"].get("names")
    names: str | list[str]
    if given:
        _check_given(given, labels, robot)
        names, named, why = list(given), list(given), "--joints"
    elif by_column:
        names, named, why = list(by_column), list(by_column), "the column's name"
    elif lists:
        own = next(iter(lists))
        names, named, why = own, lists[own], f"{own} of the file"
    elif robot is None:
        found = LoggedJoints(
            None, [Named(label, None, "open", "no robot is given (--robot)") for label in labels]
        )
        found.notes.append(
            "without `joints.names` the columns are taken for the robot's joints in its own order"
        )
        return found
    else:
        return _guessed(log, played, robot, labels)
    sure = "given" if given else "named"
    found = LoggedJoints(
        names, [Named(c, n, sure, why) for c, n in zip(labels, named, strict=True)]
    )
    if robot is not None:
        _look(found, _motions(log, played, robot), robot, named)
    return found


def _labels(log: LogFile, columns: Any) -> list[str]:
    if isinstance(columns, list):
        return [str(column) for column in columns]
    return [f"{columns}[{k}]" for k in range(log.array(columns).values.shape[1])]


def _check_given(
    given: Sequence[str], labels: Sequence[str], robot: RobotDescription | None
) -> None:
    if len(given) != len(labels):
        raise AloftError(
            f"--joints has {len(given)} names, expected {len(labels)}: one for each column from {labels[0]} to {labels[-1]}, in that order, "
            f"and {NO_JOINT} for one that is no joint of the robot"
        )
    own = [] if robot is None else [joint.name for joint in robot.joints]
    for name in given:
        near = get_close_matches(name, own, 1, 0.5)
        if near and name not in own and name not in (NO_JOINT, UNNAMED):
            raise AloftError(f"--joints: the robot has no joint {name}; did you mean {near[0]}?")


def _guessed(
    log: LogFile, played: Mapping[str, Any], robot: RobotDescription, labels: list[str]
) -> LoggedJoints:
    from ..hal.log.joint_columns import guess_columns

    motions = _motions(log, played, robot)
    guesses = guess_columns(robot, list(motions.values()))
    names = [UNNAMED if guess.joint is None else guess.joint for guess in guesses]
    found = LoggedJoints(
        names,
        [Named(label, g.joint, g.sure, g.why) for label, g in zip(labels, guesses, strict=True)],
    )
    if robot.feet and not any(motion.closed.any() for motion in motions.values()):
        found.notes.append("no contacts of feet were found, which would tell the legs' columns")
    elif robot.feet and set(motions) == {""}:
        found.notes.append(
            "neither an IMU nor motion capture was found, so only standing on two feet tells the legs' columns"
        )
    _look(found, motions, robot, names)
    if UNNAMED in names:
        found.notes.append(
            f"{names.count(UNNAMED)} columns have no name yet, {UNNAMED} in joints.names: write their joints there, as the driver's documentation "
            f"has them, or import again with --joints NAME,NAME,... for all {len(names)} in the columns' order; {NO_JOINT} is no joint of the robot"
        )
    return found


def _look(
    found: LoggedJoints,
    motions: Mapping[str, LoggedMotion],
    robot: RobotDescription,
    names: Sequence[str],
) -> None:
    """Note whether feet stand with the names, and take the sensor with which they stand stillest for the IMU."""
    from ..hal.log.joint_columns import FLOOR, SURE, stiller, unrest_of

    unrest = {
        how: value
        for how, each in motions.items()
        if (value := unrest_of(robot, each, names)) is not None
    }
    imus = {how: value for how, value in unrest.items() if how not in ("", "truth")}
    if len(imus) > 1:
        first, second = sorted(imus, key=lambda how: imus[how])[:2]
        if first != robot.base and imus[second] + FLOOR > SURE * (imus[first] + FLOOR):
            found.sensor = first
            found.notes.append(
                f"the IMU is taken for {first}: at any other place of one the standing feet turn more"
            )
    how = (
        "truth"
        if "truth" in unrest
        else found.sensor or min(unrest, key=lambda each: unrest[each], default="")
    )
    if how not in unrest or (times := stiller(robot, motions[how], names)) is None:
        return
    if times < SURE:
        found.notes.append(
            "the feet stand still with these names, and hardly stiller with any two exchanged"
        )
    else:
        found.notes.append(
            f"the feet stand {times:.1f} times as still if columns change places: look at the names of the legs' joints"
        )


def _motions(
    log: LogFile, played: Mapping[str, Any], robot: RobotDescription
) -> dict[str, LoggedMotion]:
    """Return the columns' motion by what tells the base's: `truth`, each place that an IMU may have, or only the feet (empty)."""
    from ..hal.log.columns import LogClock, at_times, moments_of, rows_to_keep
    from ..hal.log.log_file import LogError
    from ..hal.log.parameters import LogParameters
    from ..hal.log.played_log import play
    from ..hal.log.standing_feet import LoggedMotion
    from ..hal.log.turns import rotation_of

    joints = played["joints"]
    raw, own = _angles(log, joints["position"], "rad")
    kinds = [raw, raw]
    if "velocity" in joints:
        speeds, clock = _angles(log, joints["velocity"], "rad/s")
        if speeds.shape == raw.shape and (own is None) == (clock is None):
            kinds[1] = speeds
    still = LoggedMotion(raw, np.zeros_like(raw), np.zeros((len(raw), len(robot.feet)), bool))
    try:
        moments = moments_of(log, LogClock.model_validate(played.get("clock", {})), len(raw), own)
    except LogError:
        return {"": still}
    both = np.hstack(kinds) if moments.order is None else np.hstack(kinds)[moments.order]
    keep = rows_to_keep(moments.times, both)[0]
    stamps, both = moments.times[keep], both[keep]
    whole = {part: each for part, each in played.items() if part != "joints"}
    if len(stamps) > 1 and stamps[-1] - stamps[0] > LONGEST:
        whole["end"] = LONGEST
    places: dict[str, Any] = {"": None}
    if "imu" in played:
        mounted = [
            n
            for n, each in robot.sensors.mounted.items()
            if each.kind == "imu" and each.link == robot.base
        ]
        places |= {robot.base: played["imu"]} | {
            name: {**played["imu"], "sensor": name} for name in mounted
        }
    found: dict[str, LoggedMotion] = {}
    for place, imu in places.items():
        settings = LogParameters.model_validate(whole | {"imu": imu})
        rows = play(log, settings, robot, PERIOD).rows
        if rows is None:
            continue
        position, speeds = np.hsplit(at_times(stamps, both, rows.position.times), 2)
        if kinds[1] is raw:
            speeds = np.gradient(position, PERIOD, axis=0)
        moving = position, _mean(speeds, SMOOTH), _steady(rows.closed, robot)
        turn = rotation_of(rows.pose[:, 3:])
        if imu is not None:
            up = _mean(rows.imu[:, 3:], LEVEL)
            up = up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9)
            found[place] = LoggedMotion(*moving, _mean(rows.imu[:, :3], SMOOTH), up)
            continue
        found[place] = LoggedMotion(*moving)
        if "truth" in played:
            speed = np.einsum("nji,nj->ni", turn, rows.twist[:, :3])
            rate = _mean(rows.twist[:, 3:], SMOOTH)
            found["truth"] = LoggedMotion(*moving, rate, turn[:, 2], _mean(speed, SMOOTH))
    return found or {"": still}


def _angles(log: LogFile, columns: Any, unit: str) -> tuple[Array, Array | None]:
    """Return columns of joints and their own stamps: in a unit of hinges, or of slides as the file has them."""
    from ..hal.log.columns import numbers
    from ..hal.log.log_file import LogError

    try:
        return numbers(log, columns, unit)
    except LogError:
        return numbers(log, columns, "")


def _mean(values: Array, span: float) -> Array:
    """Return moving means over so many seconds."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(
        uniform_filter1d(values, max(1, round(span / PERIOD)), axis=0, mode="nearest")
    )


def _steady(closed: Flags2D, robot: RobotDescription) -> Flags2D:
    """Return which foot stands, not near an impact, (n, n_feet)."""
    from scipy.ndimage import minimum_filter1d

    own = np.asarray(robot.foot_of_contact(), np.int64)
    feet = np.stack([closed[:, own == k].any(axis=1) for k in range(len(robot.feet))], axis=1)
    size = 2 * round(IMPACT / PERIOD) + 1
    steady: Flags2D = minimum_filter1d(feet.astype(np.uint8), size, axis=0, mode="nearest") > 0
    return steady


def commented(text: str, found: LoggedJoints) -> str:
    """Return a graph's YAML with how sure each name of `joints.names` is beside it."""
    lines: list[str] = []
    left: list[Named] | None = None
    for line in text.splitlines():
        if left and line.lstrip().startswith("- "):
            one = left.pop(0)
            line += f"  # {one.column}: {one.sure}, {one.why}"
        elif line.strip() == "names:":
            left = list(found.columns)
        lines.append(line)
    return "\n".join(lines) + "\n"
