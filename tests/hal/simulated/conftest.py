"""Robots of other kinds than BRUCE, as descriptions that a test may change first."""

from __future__ import annotations

from typing import Any

import pytest

PROFILE = {
    "peak_torque": 30.0, "corner_speed": 20.0, "no_load_speed": 30.0, "continuous_torque": 10.0,
    "rotor_inertia": 0.003, "friction": 0.05, "damping": 0.02,
}  # fmt: skip


def _transmission(joints: list[dict[str, Any]]) -> dict[str, Any]:
    n = len(joints)
    rows = [[float(i == j) for j in range(n)] for i in range(n)]
    return {"motors": [f"{joint['name']}_motor" for joint in joints], "joint_to_motor": rows}


@pytest.fixture
def quadruped() -> dict[str, Any]:
    """12 kg on four point feet; the shanks are tilted by 0.8 rad in the standing pose."""
    links: list[dict[str, Any]] = [
        {"name": "trunk", "mass": 8.0, "com": [0, 0, 0], "inertia": [0.05, 0.2, 0.22, 0, 0, 0],
         "shapes": [{"start": [-0.15, 0, 0], "end": [0.15, 0, 0], "radius": 0.07}]}
    ]  # fmt: skip
    joints: list[dict[str, Any]] = []
    feet, contacts, standing = [], [], {}
    radius, length = 0.02, 0.2
    for name, x, y in (
        ("front_left", 0.2, 0.1), ("front_right", 0.2, -0.1),
        ("rear_left", -0.2, 0.1), ("rear_right", -0.2, -0.1),
    ):  # fmt: skip
        parent = "trunk"
        for part, mass, origin, axis in (
            ("hip", 0.4, [x, y, 0.0], [1, 0, 0]),
            ("thigh", 0.4, [0.0, 0.06 if y > 0 else -0.06, 0.0], [0, 1, 0]),
            ("shank", 0.2, [0.0, 0.0, -length], [0, 1, 0]),
        ):
            child = f"{name}_{part}"
            com = [0, 0, 0] if part == "hip" else [0, 0, -0.5 * length]
            inertia = [0.0015, 0.0015, 0.0004, 0, 0, 0]
            links.append({"name": child, "mass": mass, "com": com, "inertia": inertia})
            joints.append({"name": f"{child}_joint", "parent": parent, "child": child,
                           "origin": origin, "axis": axis, "limits": [-2.7, 2.7]})  # fmt: skip
            parent = child
        links[-1]["shapes"] = [{"start": [0, 0, -0.02], "end": [0, 0, -0.15], "radius": 0.01}]
        standing |= {f"{name}_thigh_joint": 0.8, f"{name}_shank_joint": -1.6}
        lowest = [0.0, 0.0, -length - radius]  # with the shank upright, as at the zero pose
        feet.append({"name": name, "link": parent, "sole": lowest})
        contacts.append({"name": f"{name}_ball", "foot": name, "position": lowest,
                         "radius": radius})  # fmt: skip
    return {
        "name": "quadruped", "base": "trunk", "points": {"trunk": ("trunk", [0, 0, 0])}, "links": links, "joints": joints, "feet": feet,
        "contacts": contacts, "standing": standing, "transmission": _transmission(joints),
        "profiles": {"motor": dict(PROFILE)},
    }  # fmt: skip


@pytest.fixture
def arm() -> dict[str, Any]:
    """A shoulder and an elbow on a fixed base, without feet, IMU or joint limits."""
    slim = [0.02, 0.02, 0.002, 0, 0, 0]
    links = [
        {"name": "world", "mass": 1.0, "com": [0, 0, 0], "inertia": [0.01, 0.01, 0.01, 0, 0, 0]},
        {"name": "upper", "mass": 1.0, "com": [0, 0, 0.2], "inertia": slim,
         "shapes": [{"start": [0, 0, 0], "end": [0, 0, 0.4], "radius": 0.03}]},
        {"name": "lower", "mass": 0.6, "com": [0, 0, 0.15], "inertia": slim,
         "shapes": [{"start": [0, 0, 0], "end": [0, 0, 0.3], "radius": 0.03}]},
    ]  # fmt: skip
    joints = [
        {"name": "shoulder", "parent": "world", "child": "upper", "origin": [0, 0, 0.01],
         "axis": [0, 1, 0]},
        {"name": "elbow", "parent": "upper", "child": "lower", "origin": [0, 0, 0.4],
         "axis": [0, 0.6, 0.8]},
    ]  # fmt: skip
    return {
        "name": "arm", "base": "world", "base_joint": "fixed", "links": links, "joints": joints,
        "transmission": _transmission(joints), "profiles": {"motor": dict(PROFILE)},
        "standing": {"shoulder": 0.5, "elbow": 0.7}, "sensors": {"imu": False, "switches": False},
    }  # fmt: skip


@pytest.fixture
def cart_pole() -> dict[str, Any]:
    """A slide that is driven and a hinge without a motor, without limits."""
    links = [
        {"name": "rail", "mass": 1.0, "com": [0, 0, 0], "inertia": [0.01, 0.01, 0.01, 0, 0, 0]},
        {"name": "cart", "mass": 1.0, "com": [0, 0, 0], "inertia": [0.01, 0.01, 0.01, 0, 0, 0]},
        {"name": "pole", "mass": 0.2, "com": [0, 0, 0.25], "inertia": [0.004, 0.004, 1e-4, 0, 0, 0]},
    ]  # fmt: skip
    joints = [
        {"name": "slide", "kind": "slide", "parent": "rail", "child": "cart", "origin": [0, 0, 0],
         "axis": [1, 0, 0], "limits": [-2, 2]},
        {"name": "hinge", "parent": "cart", "child": "pole", "origin": [0, 0, 0], "axis": [0, 1, 0]},
    ]  # fmt: skip
    passive = {"peak_torque": 0.0, "continuous_torque": 0.0, "rotor_inertia": 0.0, "friction": 0.0,
               "damping": 0.0}  # fmt: skip
    motor = {**PROFILE, "friction": 0.0, "damping": 0.0, "rotor_inertia": 0.0,
             "motors": {"hinge_motor": passive}}  # fmt: skip
    return {
        "name": "cart_pole", "base": "rail", "base_joint": "fixed", "links": links,
        "joints": joints, "transmission": _transmission(joints), "profiles": {"motor": motor},
        "standing": {"hinge": 0.1}, "sensors": {"imu": False, "switches": False},
    }  # fmt: skip
