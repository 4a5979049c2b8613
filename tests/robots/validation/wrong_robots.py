"""A robot without a fault, and one change after another that makes it wrong, with its report."""

from __future__ import annotations

from typing import Any

NAN = float("nan")


def hopper() -> dict[str, Any]:
    """A one-legged robot with a hip and a knee whose motors are coupled."""
    inertia = [0.01, 0.01, 0.01, 0.0, 0.0, 0.0]
    link = {"mass": 1.0, "com": [0, 0, 0], "inertia": inertia}
    return {
        "name": "hopper",
        "base": "body",
        "links": [{"name": name, **link} for name in ("body", "thigh", "shank")],
        "joints": [
            {"name": "hip", "parent": "body", "child": "thigh", "origin": [0, 0, 0],
             "axis": [0, 1, 0], "limits": [-1, 1]},
            {"name": "knee", "parent": "thigh", "child": "shank", "origin": [0, 0, -0.2],
             "axis": [0, 1, 0], "limits": [0, 2]},
        ],
        "feet": [{"name": "foot", "link": "shank", "sole": [0, 0, -0.2]}],
        "contacts": [
            {"name": "toe", "foot": "foot", "position": [0, 0, -0.2], "radius": 0.005}
        ],
        "transmission": {"motors": ["a", "b"], "joint_to_motor": [[1, 0], [1, 1]]},
        "profiles": {
            "small": {
                "peak_torque": 5.0, "corner_speed": 10.0, "no_load_speed": 20.0,
                "continuous_torque": 2.0, "rotor_inertia": 0.001, "friction": 0.05,
                "damping": 0.01,
            }
        },
        "standing": {"knee": 0.5},
    }  # fmt: skip


Change = tuple[tuple[str | int, ...], object]

WRONG_BODIES: list[tuple[list[Change], list[str]]] = [
    (
        [(("links", 0, "mass"), -1.0)],
        [
            "hopper.yaml:5:9: link body has a mass of -1 kg",
            "    expected   a positive number of kg",
            "    found      -1",
            "    fix        mass: 0.1",
        ],
    ),
    (
        [(("links", 0, "mass"), NAN)],
        [
            "hopper.yaml:5:9: link body has a mass of nan kg",
            "    expected   a positive number of kg",
            "    found      nan",
            "    fix        mass: 0.1",
        ],
    ),
    (
        [(("links", 1, "inertia"), [1.0, 0.1, 0.1, 0, 0, 0])],
        [
            "hopper.yaml:21:3: link thigh has an inertia that no body has: a principal moment is larger than the sum of the others",
            "    expected   principal moments of which each is at most the sum of the others",
            "    found      [1, 0.1, 0.1, 0, 0, 0], with principal moments [0.1, 0.1, 1]",
        ],
    ),
    (
        [(("links", 1, "inertia"), [0.1, 0.1, 0.1, 0.2, 0, 0])],
        [
            "hopper.yaml:21:3: link thigh has an inertia that no body has: a principal moment is not positive",
            "    expected   three positive principal moments",
            "    found      [0.1, 0.1, 0.1, 0.2, 0, 0], with principal moments [-0.1, 0.1, 0.3]",
        ],
    ),
    (
        [(("joints", 1, "axis"), [0, 0, 0])],
        [
            "hopper.yaml:48:3: the axis of joint knee is no direction",
            "    expected   a vector of length 1",
            "    found      [0, 0, 0]",
            "    fix        axis: [0, 0, 1]",
        ],
    ),
    (
        [(("joints", 1, "axis"), [0, 0, 2])],
        [
            "hopper.yaml:48:3: the axis of joint knee has length 2",
            "    expected   a vector of length 1",
            "    found      [0, 0, 2]",
            "    fix        axis: [0, 0, 1]",
        ],
    ),
    (
        [(("joints", 0, "limits"), [1, -1])],
        [
            "hopper.yaml:38:3: the limits of joint hip are reversed",
            "    expected   [lower, upper] with lower < upper",
            "    found      [1, -1]",
            "    fix        limits: [-1, 1]",
        ],
    ),
    (
        [(("joints", 0, "limits"), [NAN, 1])],
        [
            "hopper.yaml:38:3: the limits of joint hip are not numbers",
            "    expected   [lower, upper] with lower < upper",
            "    found      [nan, 1]",
        ],
    ),
    (
        [(("joints", 0, "parent"), "shank")],
        [
            "hopper.yaml:27:11: joints hip, knee carry each other in a ring and do not hang on the base",
            "    expected   a tree that hangs on body",
            "    found      thigh <- shank <- thigh",
        ],
    ),
    (
        [(("joints", 1, "child"), "thigh")],
        [
            "hopper.yaml:21:3: link shank hangs on nothing: no joint carries it",
            "    expected   a joint with child: shank",
            "    found      none",
            "hopper.yaml:42:10: link thigh is carried by two joints, hip and knee",
            "    expected   one joint that carries each link",
            "    found      child: thigh",
        ],
    ),
    (
        [(("joints", 1, "child"), "body")],
        [
            "hopper.yaml:21:3: link shank hangs on nothing: no joint carries it",
            "    expected   a joint with child: shank",
            "    found      none",
            "hopper.yaml:42:10: joint knee carries the base body",
            "    expected   a base that no joint carries",
            "    found      child: body",
            "    fix        swap the joint's parent and child, or name another base",
        ],
    ),
    (
        [(("profiles", "small", "peak_torque"), -5)],
        [
            "hopper.yaml:80:18: profile small: no motor has a peak_torque of -5",
            "    expected   a positive number of N m",
            "    found      -5",
            "    fix        peak_torque: 5",
        ],
    ),
    (
        [(("profiles", "small", "corner_speed"), 30)],
        [
            "hopper.yaml:81:19: profile small: the torque falls from corner_speed to no_load_speed, which is not above it",
            "    expected   corner_speed below 20 rad/s",
            "    found      30",
            "    fix        corner_speed: 12",
        ],
    ),
    (
        [(("transmission", "joint_to_motor"), [[1, 1], [1, 1]])],
        [
            "hopper.yaml:74:3: the transmission is singular: some motion of the joints turns no motor",
            "    expected   a matrix of rank 2",
            "    found      rank 1",
        ],
    ),
    (
        [(("transmission", "joint_to_motor"), [[1, 0]])],
        [
            "hopper.yaml:74:3: the transmission's matrix does not fit the joints",
            "    expected   2 rows of 2 values, one row a motor and one column a joint",
            "    found      1 rows",
        ],
    ),
    (
        [
            (
                ("thrusters",),
                {
                    "fan": {"link": "bdy", "axis": [0, 0, 2], "max_thrust": -3},
                    "jet": {
                        "link": "body",
                        "position": [0, NAN, 0],
                        "max_thrust": 3,
                        "time_constant": -1,
                    },
                },
            )
        ],
        [
            "hopper.yaml:91:11: the link of thruster fan is 'bdy', and there is no such link",
            "    expected   body, thigh, shank",
            "    found      'bdy'",
            "    fix        body",
            "hopper.yaml:93:5: the axis of thruster fan has length 2",
            "    expected   a vector of length 1",
            "    found      [0, 0, 2]",
            "    fix        axis: [0, 0, 1]",
            "hopper.yaml:96:17: thruster fan has a max_thrust of -3",
            "    expected   a positive number of N",
            "    found      -3",
            "    fix        max_thrust: 3, and the axis reversed",
            "hopper.yaml:100:5: thruster jet is nowhere",
            "    expected   three finite numbers of m",
            "    found      [0, nan, 0]",
            "hopper.yaml:104:20: thruster jet has a time_constant of -1",
            "    expected   a finite number of s from 0",
            "    found      -1",
        ],
    ),
    (
        [(("thrusters",), {"fan": {"link": "body", "thrust": 3}})],
        [
            "hopper.yaml:91:5: thruster fan lacks 'max_thrust'",
            "    expected   a value for 'max_thrust'",
            "    found      nothing",
            "hopper.yaml:92:13: thruster fan has no key 'thrust'",
            "    expected   link, position, axis, max_thrust, torque_ratio, time_constant",
            "    found      'thrust'",
            "    fix        max_thrust: 3",
        ],
    ),
]
