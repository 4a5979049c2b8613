"""More changes that make a robot wrong: names, poses, feet, motors; each with its report."""

from __future__ import annotations

from .wrong_robots import NAN, Change

WRONG_STANCES: list[tuple[list[Change], list[str]]] = [
    (
        [(("standing", "nee"), 1)],
        [
            "hopper.yaml:89:8: a joint in standing is 'nee', and there is no such joint",
            "    expected   hip, knee",
            "    found      'nee'",
            "    fix        knee",
        ],
    ),
    (
        [(("standing", "knee"), 3)],
        [
            "hopper.yaml:88:9: standing: joint knee is outside its limits",
            "    expected   a value in [0, 2]",
            "    found      3",
            "    fix        knee: 2",
        ],
    ),
    (
        [(("contacts", 0, "foot"), "feet")],
        [
            "hopper.yaml:55:3: foot foot has no contact point",
            "    expected   at least one in contacts",
            "    found      none",
            "    fix        contacts: [{name: foot_1, foot: foot, position: [0, 0, -0.2], radius: 0.005}]",
            "hopper.yaml:63:9: the foot of contact toe is 'feet', and there is no such foot",
            "    expected   foot",
            "    found      'feet'",
        ],
    ),
    (
        [(("feet",), [])],
        [
            "hopper.yaml:56:1: contact points belong to feet that are not there: foot",
            "    expected   a foot for each in feet",
            "    found      feet: none",
            "    fix        feet, or no contacts",
        ],
    ),
    (
        [(("contacts", 0, "radius"), -0.1)],
        [
            "hopper.yaml:68:11: contact toe has a radius of -0.1 m",
            "    expected   a positive number of m: the rubber there is round",
            "    found      -0.1",
            "    fix        radius: 0.005",
        ],
    ),
    (
        [(("profile",), "smal")],
        [
            "hopper.yaml:89:10: the robot has no actuator profile 'smal'",
            "    expected   small",
            "    found      profile: smal",
            "    fix        profile: small",
        ],
    ),
    (
        [(("links", 0, "weight"), 2)],
        [
            "hopper.yaml:17:11: link body has no key 'weight'",
            "    expected   name, mass, com, inertia, shapes",
            "    found      'weight'",
        ],
    ),
    (
        [(("jionts",), 2)],
        [
            "hopper.yaml:89:9: the robot has no key 'jionts'",
            "    expected   name, text, base, base_joint, links, joints, feet, contacts, transmission, profiles, profile, sensors, standing, held, points, thrusters, supply, looks",
            "    found      'jionts'",
            "    fix        joints: 2",
        ],
    ),
    (
        [(("links", 0, "mass"), "heavy")],
        [
            "hopper.yaml:5:9: link body: mass cannot be 'heavy'",
            "    expected   a number",
            "    found      'heavy'",
        ],
    ),
    (
        [(("links", 0, "com"), [0, 0])],
        [
            "hopper.yaml:7:3: link body, com: too few values",
            "    expected   at least 3",
            "    found      2",
        ],
    ),
    (
        [(("joints", 0, "kind"), "ball")],
        [
            "hopper.yaml:40:9: joint hip: kind cannot be 'ball'",
            "    expected   'hinge' or 'slide'",
            "    found      'ball'",
        ],
    ),
    (
        [(("joints", 0, "limits"), [0.5, 1])],
        [
            "hopper.yaml:38:3: joint hip stands at 0, which is outside its limits: standing does not name it",
            "    expected   an angle in [0.5, 1] in standing",
            "    found      none",
            "    fix        standing: {hip: 0.75}",
        ],
    ),
    (
        [(("contacts",), [])],
        [
            "hopper.yaml:55:3: foot foot has no contact point",
            "    expected   at least one in contacts",
            "    found      none",
            "    fix        contacts: [{name: foot_1, foot: foot, position: [0, 0, -0.2], radius: 0.005}]",
        ],
    ),
    (
        [(("base",), "bodi")],
        [
            "hopper.yaml:2:7: the base is 'bodi', and there is no such link",
            "    expected   body, thigh, shank",
            "    found      'bodi'",
            "    fix        body",
            "hopper.yaml:4:3: link body hangs on nothing: no joint carries it",
            "    expected   a joint with child: body",
            "    found      none",
        ],
    ),
    (
        [(("feet", 0, "link"), "toe")],
        [
            "hopper.yaml:56:9: the link of foot foot is 'toe', and there is no such link",
            "    expected   body, thigh, shank",
            "    found      'toe'",
        ],
    ),
    (
        [(("joints", 1, "name"), "hip")],
        [
            "hopper.yaml:40:9: joint 'hip' is there twice",
            "    expected   another name than joint 1",
            "    found      name: hip",
            "    fix        name: hip_2",
            "hopper.yaml:88:9: a joint in standing is 'knee', and there is no such joint",
            "    expected   hip, hip",
            "    found      'knee'",
        ],
    ),
    (
        [(("links",), None)],
        [
            "hopper.yaml:3:8: the robot: links cannot be nothing",
            "    expected   a list",
            "    found      nothing",
        ],
    ),
    (
        [(("transmission", "motors"), ["a", "a"])],
        [
            "hopper.yaml:72:5: motor 'a' is there twice",
            "    expected   a name of its own for each motor",
            "    found      a",
            "    fix        a_2",
        ],
    ),
    (
        [(("held",), {"knee": 0.7})],
        [
            "hopper.yaml:88:9: joint knee is held at another angle than it stands at",
            "    expected   knee: 0.7, as in held",
            "    found      knee: 0.5",
        ],
    ),
    (
        [(("links", 0, "shapes"), [{"start": [0, 0, 0], "end": [0, 0, 1], "radius": 0}])],
        [
            "hopper.yaml:18:5: shape 1 of link body is no capsule",
            "    expected   finite ends and a positive radius [m]",
            "    found      start [0, 0, 0], end [0, 0, 1], radius 0",
        ],
    ),
    (
        [(("links", 0, "shapes"), [{"corners": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}])],
        [
            "hopper.yaml:18:5: shape 1 of link body is no hull",
            "    expected   four or more finite corners that are 1 mm or more out of one plane",
            "    found      4 corners",
        ],
    ),
    (
        [(("links", 0, "shapes"), [{"corners": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}])],
        [
            "hopper.yaml:19:5: link body, shape 1: corners cannot be [[0, 0, 0], [1, 0, 0], [0, 1, 0]]",
            "    expected   at least 4 values",
            "    found      [[0, 0, 0], [1, 0, 0], [0, 1, 0]]",
        ],
    ),
    (
        [(("links", 0, "shapes"), [{"start": [0, 0, 0], "end": [0, 0, 1], "radios": 0.1}])],
        [
            "hopper.yaml:18:5: link body, shape 1 lacks 'radius'",
            "    expected   a value for 'radius'",
            "    found      nothing",
            "hopper.yaml:26:13: link body, shape 1 has no key 'radios'",
            "    expected   start, end, radius, corners",
            "    found      'radios'",
            "    fix        radius: 0.1",
        ],
    ),
    (
        [(("contacts", 0, "position"), [0, NAN, 0])],
        [
            "hopper.yaml:65:3: contact toe is nowhere",
            "    expected   three finite numbers of m",
            "    found      [0, nan, 0]",
        ],
    ),
    (
        [(("sensors",), {"imu": "maybe"})],
        [
            "hopper.yaml:90:8: sensors: imu cannot be 'maybe'",
            "    expected   true or false",
            "    found      'maybe'",
        ],
    ),
    (
        [(("joints", 0, "name"), "base")],
        [
            "hopper.yaml:26:9: no joint can be called 'base': the models use that name",
            "    expected   another name",
            "    found      name: base",
            "    fix        name: base_joint",
        ],
    ),
    (
        [(("points",), {"top": ["torso", [0, 0, 0]]})],
        [
            "hopper.yaml:91:5: the link of point top is 'torso', and there is no such link",
            "    expected   body, thigh, shank",
            "    found      'torso'",
        ],
    ),
    (
        [(("profiles", "small", "motors"), {"c*": {"peak_torque": 1}})],
        [
            "hopper.yaml:89:9: profile small: no motor is called c*",
            "    expected   a, b",
            "    found      c*",
        ],
    ),
    (
        [(("profiles",), {})],
        [
            "hopper.yaml:78:11: the robot has no actuator profile",
            "    expected   at least one, by name, with peak_torque, corner_speed, no_load_speed, ...",
            "    found      none",
        ],
    ),
    (
        [(("transmission", "joint_to_motor"), [[1, 0], [1, 0]])],
        [
            "hopper.yaml:74:3: no motor moves joint knee",
            "    expected   a value in that joint's column",
            "    found      zeros in column 2",
        ],
    ),
    (
        [
            (("links", 0, "mass"), -1.0),
            (("joints", 1, "axis"), [0, 0, 2]),
            (("links", 2, "inertia"), "none"),
            (("profiles", "small", "friction"), -1),
        ],
        [
            "hopper.yaml:5:9: link body has a mass of -1 kg",
            "    expected   a positive number of kg",
            "    found      -1",
            "    fix        mass: 0.1",
            "hopper.yaml:24:12: link shank: inertia cannot be 'none'",
            "    expected   a list",
            "    found      'none'",
            "hopper.yaml:48:3: the axis of joint knee has length 2",
            "    expected   a vector of length 1",
            "    found      [0, 0, 2]",
            "    fix        axis: [0, 0, 1]",
            "hopper.yaml:85:15: profile small: no motor has a friction of -1",
            "    expected   a finite number from 0",
            "    found      -1",
        ],
    ),
]
