"""The sensors that a URDF or MJCF file mounts on links, and those of which a description has no kind.

An MJCF file has them as sensors on sites: a gyroscope and an accelerometer of one site are one inertial measurement unit, a
force and a torque sensor one six-axis sensor. A URDF tells Gazebo: ``<gazebo reference="LINK"><sensor type="imu">``, whose
``<pose>`` is relative to the link; a ``force_torque`` sensor refers to a joint. Encoders, motor torques and switches
of contact points every robot has, so that nothing is said of them.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...files.problems import listing
from ...mathematics.arrays import Array
from ...mathematics.rotations import from_euler, matrices_of_quaternions
from .looks import numbers
from .raw_model import RawSensor
from .urdf_text import XmlFile

RESERVED = ("imu", "switches")
"""Names that mean something else under ``sensors``."""
GAZEBO = {"imu": "imu", "imu_sensor": "imu", "force_torque": "force_torque"}
"""The kinds of a description, by the types of Gazebo's sensors."""
GAZEBO_BUILT_IN = ("contact",)


def file_sensors(model: Any, file: XmlFile) -> dict[str, RawSensor]:
    """Return the file's sensors by name, each a word that may name an output."""
    found: dict[str, RawSensor] = {}
    for written, sensor in _of_urdf(file) if file.is_urdf else _of_mjcf(model):
        name = re.sub(r"\W", "_", written)
        if not name.isidentifier() or name in RESERVED or name in found:
            name = f"{name}_sensor" if f"{name}_sensor".isidentifier() else f"sensor_{name}"
        while name in found:
            name += "_"
        found[name] = sensor
    return found


def unknown_sensors(model: Any, file: XmlFile) -> Iterator[str]:
    """Yield a sentence that names the sensors of which a description has no kind; none where there are none."""
    found: dict[str, list[str]] = defaultdict(list)
    for kind, name in _unknown_of_urdf(file) if file.is_urdf else _unknown_of_mjcf(model):
        found[kind].append(name)
    if found:
        kinds = [f"{kind} ({listing(names, 4)})" for kind, names in found.items()]
        yield (
            f"left out: sensors {listing(kinds, 8)}; a class of your own makes a new kind "
            "(docs/robots.md#a-sensor-of-a-new-kind)"
        )


def _of_mjcf(model: Any) -> Iterator[tuple[str, RawSensor]]:
    import mujoco

    kind = mujoco.mjtSensor
    fields = {
        int(kind.mjSENS_GYRO): ("imu", "angular_velocity"),
        int(kind.mjSENS_ACCELEROMETER): ("imu", "specific_force"),
        int(kind.mjSENS_FORCE): ("force_torque", "force"),
        int(kind.mjSENS_TORQUE): ("force_torque", "torque"),
    }
    noise: dict[tuple[str, int], dict[str, float]] = defaultdict(dict)
    for k in range(model.nsensor):
        which = fields.get(int(model.sensor_type[k]))
        if which is not None:
            noise[which[0], int(model.sensor_objid[k])][which[1]] = float(model.sensor_noise[k])
    for (kind_here, site), given in noise.items():
        body = model.body(int(model.site_bodyid[site])).name
        w, x, y, z = model.site_quat[site].tolist()
        rotation = matrices_of_quaternions(np.array([x, y, z, w]))
        name = model.site(site).name or f"{body}_{kind_here}"
        deviations = {field: value for field, value in given.items() if value > 0.0}
        yield name, RawSensor(kind_here, body, np.array(model.site_pos[site]), rotation, deviations)


def _unknown_of_mjcf(model: Any) -> Iterator[tuple[str, str]]:
    import mujoco

    kind = mujoco.mjtSensor
    known = {
        int(each)
        for each in (
            kind.mjSENS_GYRO, kind.mjSENS_ACCELEROMETER, kind.mjSENS_FORCE, kind.mjSENS_TORQUE,
            kind.mjSENS_TOUCH, kind.mjSENS_JOINTPOS, kind.mjSENS_JOINTVEL, kind.mjSENS_ACTUATORPOS,
            kind.mjSENS_ACTUATORVEL, kind.mjSENS_ACTUATORFRC, kind.mjSENS_JOINTACTFRC,
        )
    }  # fmt: skip
    for k in range(model.nsensor):
        if int(model.sensor_type[k]) not in known:
            word = kind(int(model.sensor_type[k])).name.removeprefix("mjSENS_").lower()
            yield word, model.sensor(k).name or f"number {k + 1}"


def _gazebo(file: XmlFile) -> Iterator[tuple[str, str, Any]]:
    """Yield every sensor declared for Gazebo: its reference, type and element."""
    for gazebo in file.root.findall("gazebo"):
        for sensor in gazebo.findall("sensor"):
            yield gazebo.get("reference", ""), sensor.get("type", ""), sensor


def _of_urdf(file: XmlFile) -> Iterator[tuple[str, RawSensor]]:
    children = {
        joint.get("name", ""): child.get("link", "")
        for joint in file.root.findall("joint")
        if (child := joint.find("child")) is not None
    }
    for reference, written, sensor in _gazebo(file):
        kind = GAZEBO.get(written)
        body = children.get(reference, reference) if kind == "force_torque" else reference
        if kind is None or not file.has("link", body):
            continue
        pose = numbers(sensor.findtext("pose"), [0.0] * 6)
        name = sensor.get("name") or f"{body}_{kind}"
        yield name, RawSensor(kind, body, pose[:3], _of_angles(pose[3:]), {})


def _unknown_of_urdf(file: XmlFile) -> Iterator[tuple[str, str]]:
    for reference, written, sensor in _gazebo(file):
        if written not in GAZEBO and written not in GAZEBO_BUILT_IN:
            yield written or "without a type", sensor.get("name") or reference


def _of_angles(angles: Array) -> Array:
    """Return the rotation (3, 3) of roll, pitch and yaw [rad], as SDF and URDF have them."""
    quaternion = np.empty(4)
    from_euler(angles, quaternion)
    return matrices_of_quaternions(quaternion)
