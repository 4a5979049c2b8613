"""Oddities of a robot's description: ``aloft robot check-up``, and obstacles to jumping.

Nothing here is a fault that a description is refused for. Each rule compares numbers that nobody writes down on
purpose with what bodies, legs and motors of that size are like.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..mathematics.arrays import Array
from ..robots.kinematics import inertia_tensor
from ..robots.plausible_size import wrong_size
from ..robots.shapes import corners_of

if TYPE_CHECKING:
    from ..robots.description import RobotDescription
    from ..robots.robot_description import Link


HEAVY = 0.5
"""A link that is no base and has a larger share of the robot's mass is named."""
SLENDER, WIDE = 0.1, 1.5
"""Radii of gyration, as shares of the farthest that a link's shapes reach from its centre of mass."""
AWAY = 1.5
"""A centre of mass farther from the middle of the link's shapes than this times their reach is outside."""
FAR = 4.0
"""A joint farther from the middle of its parent's shapes than this times the reach of both links is misplaced; of the robots of
``example-robot-data`` it is at most 1.7 times."""
NEARLY_ALONG = math.radians(5.0)
"""An axis closer to a coordinate axis than this, and not along it, was measured or typed."""
NEAR_LIMIT = 0.05
"""Distance from a limit below which the standing robot is close to it [rad]."""
SLOW = 2.0
"""Least bandwidth of the joints of legs that can balance a robot [Hz]."""
STEP = 0.1
"""Step by which a joint's bandwidth is measured [rad]."""


@dataclass(frozen=True)
class Remark:
    """An oddity of a description: the ``part``, the value ``found``, and the ``usual`` one."""

    part: str
    found: str
    usual: str


def check_up(robot: RobotDescription) -> dict[str, Any]:
    """Compute the figures of a robot and the remarks about it, as plain data in SI units."""
    standing = standing_rows(robot)
    remarks = [
        *_size(robot), *_links(robot), *_inertias(robot), *_joints(robot), *_axes(robot), *_limits(robot), *_stance(robot), *_sides(robot),
        *_motors(robot, standing),
    ]  # fmt: skip
    return {
        "name": robot.name,
        "mass_kg": robot.total_mass,
        "motors": standing,
        "remarks": [vars(remark) for remark in remarks],
    }


FROM_JOINT = 0.05
"""A centre of mass so far from its joint [m] tells how far its link reaches."""


def _size(robot: RobotDescription) -> Iterator[Remark]:
    """Check mass and size of the whole robot."""
    for found in wrong_size(robot):
        yield Remark("the robot", found, "lengths in m and masses in kg")


def _joints(robot: RobotDescription) -> Iterator[Remark]:
    """Find joints far from the links that they join."""
    for joint in robot.joints:
        parent, child = robot.link(joint.parent), robot.link(joint.child)
        if not parent.shapes or not child.shapes:
            continue
        reach, middle = _extent(parent)
        both = reach + _extent(child)[0]
        away = float(np.linalg.norm(np.array(joint.origin) - middle))
        if away > FAR * both:
            yield Remark(f"joint {joint.name}", f"{away:.3g} m from the middle of {parent.name}'s shapes",
                         f"less than {FAR * both:.2g} m, as far as shapes of {parent.name} and {child.name} reach")  # fmt: skip


def _links(robot: RobotDescription) -> Iterator[Remark]:
    """Check masses and inertias."""
    for link in robot.links:
        share = link.mass / robot.total_mass
        if link.name != robot.base and share > HEAVY:
            yield Remark(f"link {link.name}", f"{share:.0%} of the mass",
                         "less than half for a link that is no base")  # fmt: skip
        if not link.shapes:
            continue
        reach, middle = _extent(link)
        away = float(np.linalg.norm(np.array(link.com) - middle))
        if away > AWAY * reach:
            yield Remark(f"link {link.name}", f"its centre of mass is {away:.3g} m from the middle of its shapes",
                         f"within them, {reach:.3g} m")  # fmt: skip
        xx, yy, zz = link.inertia[:3]
        gyration = math.sqrt(max(xx, yy, zz) / link.mass)
        if not SLENDER * reach <= gyration <= WIDE * reach:
            yield Remark(f"link {link.name}", f"radius of gyration {gyration:.3g} m",
                         f"{SLENDER * reach:.2g} to {WIDE * reach:.2g} m for its shapes")  # fmt: skip


def _inertias(robot: RobotDescription) -> Iterator[Remark]:
    """Find inertias that are too large for a link without shapes, as one about the joint in place of the centre of mass is.

    A body between its joint and a place R along its centre of mass, c away, has a radius of gyration of at most sqrt(c (R - c)).
    """
    ends = {joint.parent: np.array(joint.origin) for joint in robot.joints}
    for joint in robot.joints:
        link = robot.link(joint.child)
        away = float(np.linalg.norm(link.com))
        if link.shapes or away < FROM_JOINT or link.mass <= 0.0:
            continue
        along = np.array(link.com) / away
        end = float(ends.get(link.name, np.zeros(3)) @ along)
        most = math.sqrt(away * (max(2.0 * away, end) - away))
        tensor = inertia_tensor(link.inertia)
        across = np.linalg.svd(along[None])[2][1:]
        gyration = math.sqrt(
            max(0.0, np.linalg.eigvalsh(across @ tensor @ across.T)[0]) / link.mass
        )
        if gyration > most:
            about = "about the joint" if gyration**2 - away**2 <= most**2 else "in other units"
            yield Remark(f"link {link.name}", f"radius of gyration {gyration:.3g} m about its centre of mass, which is "
                         f"{away:.3g} m from its joint", f"at most {most:.3g} m: is its inertia {about}?")  # fmt: skip


def _extent(link: Link) -> tuple[float, Array]:
    """Return the reach of a link's shapes from their middle [m], and that middle (3,)."""
    corners, radii = corners_of(link.shapes)
    low, high = (corners - radii[:, None]).min(axis=0), (corners + radii[:, None]).max(axis=0)
    return 0.5 * float(np.linalg.norm(high - low)), 0.5 * (low + high)


def _axes(robot: RobotDescription) -> Iterator[Remark]:
    """Find axes that are nearly, and not quite, along a coordinate axis."""
    for joint in robot.joints:
        along = max(abs(component) for component in joint.axis)
        off = math.acos(min(1.0, along))
        if 1e-6 < off < NEARLY_ALONG:
            yield Remark(f"joint {joint.name}", f"its axis is {math.degrees(off):.2g} deg off a coordinate axis",
                         "along it, or clearly inclined")  # fmt: skip


def _limits(robot: RobotDescription) -> Iterator[Remark]:
    """Check limits, and the standing robot's distance from them."""
    for k, joint in enumerate(robot.joints):
        if joint.limits is None:
            yield Remark(
                f"joint {joint.name}", "no limits", "a range, for the planner and the stops"
            )
            continue
        low, high = joint.limits
        if joint.kind == "hinge" and high - low > 2.0 * math.pi + 1e-6:
            yield Remark(f"joint {joint.name}", f"a range of {math.degrees(high - low):.0f} deg",
                         "at most 360 deg")  # fmt: skip
        angle = float(robot.standing_position[k])
        room = min(angle - low, high - angle)
        if joint.name not in robot.held and robot.feet and room < NEAR_LIMIT:
            yield Remark(f"joint {joint.name}", f"stands {room:.2g} {joint.unit('rad')} from its limit",
                         f"{NEAR_LIMIT:g} or more")  # fmt: skip


def _stance(robot: RobotDescription) -> Iterator[Remark]:
    """Find feet that the robot cannot stand on."""
    off = off_its_feet(robot) if robot.contacts else ""
    if off:
        yield Remark("the standing pose", off, "a pose that rests on all contact points")


def _sides(robot: RobotDescription) -> Iterator[Remark]:
    """Find legs of which left and right differ, and signs of joints that do."""
    from ..planner.models.symmetry import mirrored_pairs
    from ..robots.welding import welded

    if not robot.feet:
        return
    try:
        part = welded(robot).robot
    except ValueError:
        return
    pairs = mirrored_pairs(part)
    if pairs is None:
        yield Remark("the legs", "left and right are no mirror images, so every jump is planned with all joints",
                     "lengths within 1 mm, masses and inertias within 2 %")  # fmt: skip
        return
    for pair in pairs:
        signs = [
            f"{part.joints[i].name} and {part.joints[j].name}"
            for i, j, sign in pair.joints
            if sign < 0.0 and abs(part.joints[i].axis[1]) > 0.9
        ]
        if signs:
            yield Remark(
                "signs",
                f"{', '.join(signs)} turn opposite ways about y",
                "the same way, left and right",
            )


def _motors(robot: RobotDescription, rows: list[dict[str, Any]]) -> Iterator[Remark]:
    """Find motors that cannot hold the robot, or hardly, and those that are slow; and rotors."""
    for row in rows:
        share = row["standing_share"]
        if share is not None and share > 0.5:
            taken = f"{share:.3g} times" if share > 1.0 else f"{share:.0%} of"
            yield Remark(f"motor {row['motor']}", f"standing takes {taken} its peak torque",
                         "less than half")  # fmt: skip
        if (
            row["bandwidth_hz"] is not None
            and row["bandwidth_hz"] < SLOW
            and row["motor"] not in robot.held
        ):
            yield Remark(f"motor {row['motor']}", f"a bandwidth of {row['bandwidth_hz']:.2g} Hz",
                         f"{SLOW:g} Hz or more")  # fmt: skip
    if not any(robot.motors.rotor_inertia):
        yield Remark(
            "the motors",
            "rotor inertia zero",
            "more: it is most of a joint's inertia where gears are high",
        )


def standing_rows(robot: RobotDescription) -> list[dict[str, Any]]:
    """Return for every motor its peak torque, the part that standing takes (none where the robot
    cannot stand), and the bandwidth: the rate at which it could turn its joint by ``STEP`` and
    back, everything behind it at rest."""
    from ..hal.simulated.mujoco_model import build_mujoco_model
    from ..hal.simulated.stance import joint_inertias, standing_torques

    model = build_mujoco_model(robot)
    stands = robot.contacts and not off_its_feet(robot)
    needed = standing_torques(robot, model) if stands else None
    inertia = joint_inertias(robot, model)
    peak, rows = robot.motors.peak_torque, []
    for k, motor in enumerate(robot.transmission.motors):
        gears = np.abs(robot.joint_to_motor[k])
        joint = int(gears.argmax())
        share = None if needed is None or peak[k] <= 0.0 else float(abs(needed[k]) / peak[k])
        rate = math.sqrt(float(peak[k]) * float(gears[joint]) / (inertia[joint] * STEP))
        rows.append({
            "motor": motor, "peak_torque": float(peak[k]), "unit": robot.motor_unit(k, "N m"),
            "standing_torque": None if needed is None else float(abs(needed[k])),
            "standing_share": share,
            "bandwidth_hz": rate / (2.0 * math.pi) if peak[k] > 0.0 else None,
        })  # fmt: skip
    return rows


def obstacles_to_jumping(robot: RobotDescription) -> list[str]:
    """List the obstacles to any jump of a robot, in its own terms; empty where there are none."""
    if robot.base_joint != "floating":
        return [
            f"its base is {robot.base_joint}: write base_joint: floating, if it can leave the ground"
        ]
    if not robot.contacts:
        return ["it has no feet: write them under feet: [{name: NAME, at: LINK, radius: METRES}]"]
    off = off_its_feet(robot)
    if off:
        return [off]
    weak = [
        f"motor {row['motor']} has {row['peak_torque']:.3g} {row['unit']}, and standing alone takes "
        f"{row['standing_torque']:.3g}: it is too weak by a factor of {row['standing_share']:.2g}"
        for row in standing_rows(robot)
        if row["standing_share"] is not None and row["standing_share"] > 1.0
    ]
    return weak[:3]


def off_its_feet(robot: RobotDescription) -> str:
    """Return the reason why a robot with feet cannot stand on them in its standing pose; empty
    where it can."""
    from ..hal.simulated.unsupported import uneven_contacts
    from ..mathematics.capture_step import support_margin
    from ..robots.kinematics import standing_contacts, standing_feet

    uneven = uneven_contacts(robot)
    if uneven:
        return uneven
    places = standing_contacts(robot)
    x, y = (-float(value) for value in standing_feet(robot).mean(axis=0)[:2])
    margin = support_margin(places, np.ones(len(places), dtype=np.bool_), x, y)
    if margin > 0.0:
        return ""
    return (
        f"its centre of mass stands {1e3 * -margin:.2g} mm outside its contact points: give it soles "
        "(feet: [{name: NAME, at: LINK, points: [...]}]), or another standing pose"
    )


def torque_factor(task: Any, robot: RobotDescription) -> float | None:
    """Return the factor on the motors' strength and speed with which a task has a plan; none where
    they are not in the way."""
    from ..planner.library.library import solve_and_check
    from ..planner.task.files import JumpTaskError, PlanError

    for factor in FACTORS:
        try:
            solve_and_check(task, with_stronger_motors(robot, factor), refine=False)
        except (JumpTaskError, PlanError):
            continue
        return factor
    return None


FACTORS = (1.25, 1.5, 2.0, 3.0)
SCALED = ("peak_torque", "continuous_torque", "corner_speed", "no_load_speed")


def with_stronger_motors(robot: RobotDescription, factor: float) -> RobotDescription:
    """Return the robot with torque and speed of its motors scaled, in every profile."""
    profiles = {}
    for name, profile in robot.profiles.items():
        motors = {
            motor: rating.model_copy(
                update={k: factor * v for k in SCALED if (v := getattr(rating, k)) is not None}
            )
            for motor, rating in profile.motors.items()
        }
        scaled = {key: factor * getattr(profile, key) for key in SCALED}
        profiles[name] = profile.model_copy(update={**scaled, "motors": motors})
    return robot.changed(profiles=profiles)
