"""Every fault of a description is found and reported exactly: place, expected, found, fix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.validation import RobotError, find_faults

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

WRONG: list[tuple[list[Change], list[str]]] = [
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
            "    expected   name, text, base, base_joint, links, joints, feet, contacts, transmission, profiles, profile, sensors, standing, held, points",
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
            "    expected   true or false, unable to interpret input",
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


def changed(changes: list[Change]) -> dict[str, Any]:
    data = hopper()
    for path, value in changes:
        place: Any = data
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
    return data


def report(data: object, folder: Path) -> RobotError:
    (folder / "hopper.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(RobotError) as error:
        find_robot("hopper.yaml", folder)
    return error.value


@pytest.mark.parametrize(("changes", "lines"), WRONG, ids=[str(w[0][0][0]) for w in WRONG])
def test_every_wrong_robot_has_its_report(
    changes: list[Change], lines: list[str], tmp_path: Path
) -> None:
    error = report(changed(changes), tmp_path)
    assert str(error).replace(f"{tmp_path}/", "").splitlines()[:-1] == lines
    assert error.file == str(tmp_path / "hopper.yaml")
    assert len(error.faults) == sum(not line.startswith(" ") for line in lines)


def test_joints_are_listed_branch_by_branch(tmp_path: Path) -> None:
    data = hopper()
    data["joints"].reverse()
    text = str(report(data, tmp_path)).replace(f"{tmp_path}/", "")
    assert text.splitlines()[:3] == [
        "hopper.yaml:26:3: joint knee is listed where joint hip belongs: joints are listed branch by branch, each behind the joint that carries its parent",
        "    expected   the order hip, knee",
        "    found      the order knee, hip",
    ]


@pytest.mark.parametrize("data", [None, 3, [1, 2], "robot"])
def test_a_file_that_holds_no_mapping(data: object, tmp_path: Path) -> None:
    assert "this describes no robot" in str(report(data, tmp_path))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"name: a\nname: b\n", "hopper.yaml:2:1: key 'name' stands twice"),
        (b"name: [a\n", "hopper.yaml:2:1: this is no YAML: "),
        (b"name: gr\xf6sse\n", "hopper.yaml: this is no text in UTF-8"),
    ],
)
def test_a_file_that_is_no_yaml(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "hopper.yaml").write_bytes(content)
    with pytest.raises(RobotError) as error:
        find_robot("hopper.yaml", tmp_path)
    assert message in str(error.value)


def test_the_headline_counts(tmp_path: Path) -> None:
    error = report(changed([(("links", 0, "mass"), 0), (("base",), "bodi")]), tmp_path)
    count = len(error.faults)
    assert str(error).endswith(f"hopper.yaml: {count} faults in the robot's description")


def test_what_has_no_fault_can_be_read() -> None:
    assert find_faults(hopper()) == ()
    assert RobotDescription.model_validate(hopper()).name == "hopper"
