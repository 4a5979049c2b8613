"""Checks of the transmission, and of what motors and thrusters can do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase

import numpy as np

from ...files.problems import listing
from ..robot_description import SLIDE_UNITS, ActuatorProfile, MotorRating, Thruster, Transmission
from .errors import Draft, Path, nearest, number, vector
from .structure import check_axis

LARGEST_CONDITION = 1e8
"""The largest condition number of a transmission; beyond it motor torques are rounding errors."""


def check_actuation(draft: Draft) -> None:
    """Report transmissions that are singular and motors that cannot exist."""
    transmission = draft.part(Transmission, "transmission")
    motors = transmission.motors if transmission else ()
    if transmission:
        _check_transmission(draft, transmission)
    profiles = dict(draft.entries("profiles"))
    if isinstance(draft.data.get("profiles"), Mapping) and not profiles:
        draft.add(
            ("profiles",), "the robot has no actuator profile",
            "at least one, by name, with peak_torque, corner_speed, no_load_speed, ...", "none",
        )  # fmt: skip
    chosen = draft.data.get("profile")
    if isinstance(chosen, str) and chosen and profiles and chosen not in profiles:
        right = nearest(chosen, profiles)
        draft.add(
            ("profile",), f"the robot has no actuator profile {chosen!r}", listing(list(profiles)),
            f"profile: {chosen}", f"profile: {right}" if right else "",
        )  # fmt: skip
    for name in profiles:
        profile = draft.part(ActuatorProfile, "profiles", name)
        if profile is not None:
            slides = _sliding_motors(draft, transmission) if transmission else frozenset()
            _check_profile(draft, name, profile, motors, slides)


def _sliding_motors(draft: Draft, transmission: Transmission) -> frozenset[str]:
    """Return the motors that move slides only, whose torques are forces."""
    kinds = [
        joint.get("kind") for joint in draft.data.get("joints") or () if isinstance(joint, Mapping)
    ]
    moved = (
        (motor, {kind for kind, gear in zip(kinds, row, strict=False) if gear})
        for motor, row in zip(transmission.motors, transmission.joint_to_motor, strict=False)
    )
    return frozenset(motor for motor, of in moved if of == {"slide"})


def _check_transmission(draft: Draft, transmission: Transmission) -> None:
    joints, count = draft.names("joints"), len(draft.data.get("joints") or ())
    path: Path = ("transmission", "joint_to_motor")
    motors, rows = transmission.motors, transmission.joint_to_motor
    for k, name in enumerate(motors):
        if name in motors[:k]:
            draft.add(
                ("transmission", "motors", k), f"motor {name!r} is there twice",
                "a name of its own for each motor", name, f"{name}_2",
            )  # fmt: skip
    if len(motors) != count:
        draft.add(
            ("transmission", "motors"), f"there are {len(motors)} motors for {count} joints",
            f"{count} motors; one that a joint lacks has peak_torque 0 in the profile",
            listing(motors),
        )  # fmt: skip
    wrong = [k for k, row in enumerate(rows) if len(row) != count]
    if len(rows) != count or wrong:
        found = f"{len(rows)} rows" if len(rows) != count else (
            f"row {wrong[0] + 1} with {len(rows[wrong[0]])} values"
        )  # fmt: skip
        draft.add(
            path, "the transmission's matrix does not fit the joints",
            f"{count} rows of {count} values, one row a motor and one column a joint", found,
        )  # fmt: skip
        return
    matrix = np.array(rows, dtype=float).reshape(count, count)
    if not np.all(np.isfinite(matrix)):
        draft.add(path, "the transmission's matrix is not finite", "finite numbers", "NaN or inf")
        return
    for k, joint in enumerate(joints if len(joints) == count else []):
        if not np.any(matrix[:, k]):
            draft.add(
                path, f"no motor moves joint {joint}", "a value in that joint's column",
                f"zeros in column {k + 1}",
            )  # fmt: skip
            return
    if count and np.linalg.cond(matrix) > LARGEST_CONDITION:
        rank = int(np.linalg.matrix_rank(matrix, tol=np.abs(matrix).max() / LARGEST_CONDITION))
        draft.add(
            path, "the transmission is singular: some motion of the joints turns no motor",
            f"a matrix of rank {count}", f"rank {rank}",
        )  # fmt: skip


def _check_profile(
    draft: Draft,
    name: str,
    profile: ActuatorProfile,
    motors: tuple[str, ...],
    slides: frozenset[str],
) -> None:
    whole: Path = ("profiles", name)
    units = _units(motors, slides)
    _check_rating(draft, whole, f"profile {name}", profile, profile, units, passive=False)
    for pattern, rating in profile.motors.items():
        path = (*whole, "motors", pattern)
        rated = [motor for motor in motors if fnmatchcase(motor, pattern)]
        if motors and not rated:
            right = nearest(pattern, motors)
            draft.add(
                path, f"profile {name}: no motor is called {pattern}", listing(motors), pattern,
                f"{right}:" if right else "",
            )  # fmt: skip
        units = _units(rated, slides)
        owner = f"profile {name}, motors {pattern}"
        _check_rating(draft, path, owner, rating, profile, units, passive=True)


def _units(motors: Sequence[str], slides: frozenset[str]) -> Mapping[str, str]:
    """Return the units of torque and speed of these motors, by those of one that turns its joints."""
    found = {}
    for hinge in ("N m", "rad/s"):
        slide = SLIDE_UNITS[hinge]
        some = any(motor in slides for motor in motors)
        mixed = f"{hinge} ({slide} for a slide)" if some else hinge
        found[hinge] = slide if some and all(motor in slides for motor in motors) else mixed
    return found


def _check_rating(
    draft: Draft,
    path: Path,
    owner: str,
    rating: ActuatorProfile | MotorRating,
    profile: ActuatorProfile,
    units: Mapping[str, str],
    *,
    passive: bool,
) -> None:
    """Check the values that a rating gives itself, and its speeds together with the profile's."""
    none = "no motor has a"
    for key in ("peak_torque", "continuous_torque", "corner_speed", "no_load_speed"):
        value = getattr(rating, key)
        zero = key == "corner_speed" or (passive and key.endswith("torque"))
        if value is None or value > 0.0 or (zero and value == 0.0):
            continue
        unit = units["N m" if key.endswith("torque") else "rad/s"]
        expected = f"a number of {unit} from 0" if zero else f"a positive number of {unit}"
        fix = f"{key}: {number(-value)}" if value < 0.0 else ""
        draft.add(
            (*path, key), f"{owner}: {none} {key} of {number(value)}", expected, number(value), fix
        )
    for key in ("rotor_inertia", "friction", "damping", "gear_play"):
        value = getattr(rating, key)
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            draft.add(
                (*path, key), f"{owner}: {none} {key} of {number(value)}",
                "a finite number from 0", number(value),
            )  # fmt: skip
    if (
        isinstance(rating, MotorRating)
        and (rating.corner_speed, rating.no_load_speed) == (None,) * 2
    ):
        return
    corner, free = (
        getattr(profile, key) if getattr(rating, key) is None else getattr(rating, key)
        for key in ("corner_speed", "no_load_speed")
    )
    if corner >= free > 0.0:
        draft.add(
            (*path, "corner_speed" if rating.corner_speed is not None else "no_load_speed"),
            f"{owner}: the torque falls from corner_speed to no_load_speed, which is not above it",
            f"corner_speed below {number(free)} {units['rad/s']}", number(corner),
            f"corner_speed: {number(0.6 * free)}",
        )  # fmt: skip


def check_thrusters(draft: Draft) -> None:
    """Report thrusters on unknown links, without direction, or that give nothing."""
    links = draft.names("links")
    for name, _ in draft.entries("thrusters"):
        path: Path = ("thrusters", name)
        thruster, owner = draft.part(Thruster, "thrusters", name), f"thruster {name}"
        if thruster is None:
            continue
        if thruster.link not in links:
            draft.unknown((*path, "link"), f"the link of {owner}", thruster.link, "link", links)
        if not all(map(math.isfinite, thruster.position)):
            draft.add(
                (*path, "position"), f"{owner} is nowhere", "three finite numbers of m",
                vector(thruster.position),
            )  # fmt: skip
        check_axis(draft, (*path, "axis"), owner, thruster.axis)
        most = thruster.max_thrust
        if not (math.isfinite(most) and most > 0.0):
            draft.add(
                (*path, "max_thrust"), f"{owner} has a max_thrust of {number(most)}",
                "a positive number of N", number(most),
                f"max_thrust: {number(-most)}, and the axis reversed" if most < 0.0 else "",
            )  # fmt: skip
        if not math.isfinite(thruster.torque_ratio):
            draft.add(
                (*path, "torque_ratio"), f"{owner} has no torque_ratio", "a finite number of m",
                number(thruster.torque_ratio),
            )  # fmt: skip
        lag = thruster.time_constant
        if not (math.isfinite(lag) and lag >= 0.0):
            draft.add(
                (*path, "time_constant"), f"{owner} has a time_constant of {number(lag)}",
                "a finite number of s from 0", number(lag),
            )  # fmt: skip
