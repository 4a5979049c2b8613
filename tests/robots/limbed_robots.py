"""Robots with legs of several kinds, made of a few numbers, for the tests of any number of joints.

Their leg geometry is close to that of robots one can buy or build: a quadruped with offset hips, a
light one whose knees bend both ways, humanoids with inclined hips and six or seven joints a leg.
"""

import math

import numpy as np

from aloft.robots.description import RobotDescription

_INCLINE = 0.1749
X, Y, Z = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
INCLINED = [math.cos(_INCLINE), 0.0, -math.sin(_INCLINE)]

QUADRUPED = [
    ("hip_roll", [0.19, 0.0465, 0.0], X, [-1.05, 1.05]),
    ("hip_pitch", [0.0, 0.0955, 0.0], Y, [-1.57, 3.49]),
    ("knee", [0.0, 0.0, -0.213], Y, [-2.72, -0.84]),
]
LIGHT_QUADRUPED = [
    ("hip_roll", [0.19, 0.0875, 0.0], X, [-1.5, 1.5]),
    ("hip_pitch", [0.0, 0.014, 0.0], Y, [-3.0, 3.0]),
    ("knee", [0.0, 0.03745, -0.16], Y, [-2.8, 2.8]),
]
HUMANOID = [
    ("hip_pitch", [0.0, 0.0645, -0.1027], Y, [-2.53, 2.88]),
    ("hip_roll", [0.0, 0.052, -0.0305], INCLINED, [-0.52, 2.96]),
    ("hip_yaw", [0.025, 0.0, -0.1241], Z, [-2.75, 2.75]),
    ("knee", [-0.0783, 0.0021, -0.1773], Y, [-0.087, 2.88]),
    ("ankle_pitch", [0.0, 0.0, -0.3], Y, [-0.87, 0.52]),
    ("ankle_roll", [0.0, 0.0, -0.0176], X, [-0.26, 0.26]),
]
SEVEN_JOINTS = [*HUMANOID, ("ankle_yaw", [0.0, 0.0, -0.03], Z, [-0.5, 0.5])]
SLIDING_LEG = [
    ("hip_pitch", [0.0, 0.05, 0.0], Y, [-1.2, 1.2]),
    ("hip_roll", [0.0, 0.0, 0.0], X, [-0.8, 0.8]),
    ("length", [0.0, 0.0, -0.2], Z, [-0.2, 0.1]),
]
STANDING = {"hip_pitch": 0.8, "knee": -1.5}, {"hip_pitch": -0.3, "knee": 0.6, "ankle_pitch": -0.3}
CORNERS = [(0.12, 0.03), (0.12, -0.03), (-0.05, 0.03), (-0.05, -0.03)]


def legged_robot(name, leg, sole, points, standing, places, extra=(), **more):
    """A robot whose base carries the same leg at several places.

    Args:
        leg: (name, origin, axis, limits) of every joint, of a leg on the left of the base.
        sole, points: of the foot's centre and of its contact points, in the last link's frame.
        standing: angles by joint name.
        places: for each leg its name and the factors of its place ahead and aside.
        extra: further joints of the base.
    """
    body = {"mass": 0.5, "com": [0.0, 0.0, 0.0], "inertia": [0.01, 0.01, 0.01, 0.0, 0.0, 0.0]}
    links, joints, feet, contacts, stance = [{"name": "base", **body}], [], [], [], {}
    for side, ahead, aside in places:
        parent = "base"
        for number, (joint, origin, axis, limits) in enumerate(leg):
            x, y, z = origin
            origin = [x * (ahead if number == 0 else 1.0), y * aside, z]
            turned = axis[0] != 0.0 or axis[2] != 0.0
            if aside < 0.0 and turned and joint != "length":
                limits = [-limits[1], -limits[0]]
            links.append({"name": f"{side}_{joint}_link", **body})
            joints.append({
                "name": f"{side}_{joint}", "parent": parent, "child": f"{side}_{joint}_link",
                "origin": origin, "axis": list(axis), "limits": limits,
                "kind": "slide" if joint == "length" else "hinge",
            })  # fmt: skip
            parent = f"{side}_{joint}_link"
            if joint in standing:
                stance[f"{side}_{joint}"] = standing[joint]
        feet.append({"name": side, "link": parent, "sole": sole})
        for number, (x, y) in enumerate(points):
            place = [sole[0] + x, sole[1] + y, sole[2]]
            contacts.append(
                {"name": f"{side}_{number}", "foot": side, "position": place, "radius": 0.005}
            )
    for joint, origin, axis, limits in extra:
        links.append({"name": f"{joint}_link", **body})
        joints.append({
            "name": joint, "parent": "base", "child": f"{joint}_link", "origin": origin,
            "axis": axis, "limits": limits,
        })  # fmt: skip
    n = len(joints)
    motor = {
        "peak_torque": 20.0, "corner_speed": 20.0, "no_load_speed": 30.0, "continuous_torque": 8.0,
        "rotor_inertia": 0.01, "friction": 0.1, "damping": 0.05,
    }  # fmt: skip
    return RobotDescription.model_validate({
        "name": name, "base": "base", "links": links, "joints": joints, "feet": feet,
        "contacts": contacts, "profiles": {"motor": motor}, "standing": stance,
        "transmission": {
            "motors": [joint["name"] for joint in joints], "joint_to_motor": np.eye(n).tolist(),
        },
        **more,
    })  # fmt: skip


FOUR = [("front_left", 1, 1), ("front_right", 1, -1), ("back_left", -1, 1), ("back_right", -1, -1)]
TWO = [("left", 1, 1), ("right", 1, -1)]


def quadruped(leg=QUADRUPED):
    """Twelve joints and four point feet."""
    end = [0.0, 0.0, -0.213] if leg is QUADRUPED else [0.0, 0.008, -0.16]
    return legged_robot("quadruped", leg, end, [(0.0, 0.0)], STANDING[0], FOUR)


def humanoid(leg=HUMANOID):
    """Two flat feet, and two joints of the base that belong to no leg, one of them held."""
    arms = [("waist", [0, 0, 0.1], Z, [-1.0, 1.0]), ("shoulder", [0, 0.2, 0.3], Y, [-2.0, 2.0])]
    return legged_robot(
        "humanoid", leg, [0.03, 0.0, -0.03], CORNERS, STANDING[1], TWO, arms, held={"waist": 0.1}
    )


def slider():
    """Two legs whose length is a slide, with point feet."""
    return legged_robot("slider", SLIDING_LEG, [0.0, 0.0, -0.1], [(0.0, 0.0)], {}, TWO)
