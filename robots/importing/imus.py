"""Where a URDF or MJCF file has inertial measurement units.

An MJCF file has them as sites with a gyroscope or an accelerometer, a URDF as what it says to Gazebo:
``<gazebo reference="LINK"><sensor type="imu">``, whose ``<pose>`` is relative to the link.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from .looks import numbers
from .raw_model import RawImu
from .urdf_text import XmlFile

SAME_DIRECTION = 1e-6
"""rad, or nearly; sensors turned by less are parallel to their body."""
RESERVED = ("imu", "switches")
"""Names that mean something else under ``sensors``."""


def imus(model: Any, file: XmlFile) -> dict[str, RawImu]:
    """The file's inertial measurement units by name, each a word that may name an output."""
    found: dict[str, RawImu] = {}
    for written, imu in _of_urdf(file) if file.is_urdf else _of_mjcf(model):
        name = re.sub(r"\W", "_", written)
        if not name.isidentifier() or name in RESERVED or name in found:
            name = f"{name}_sensor" if f"{name}_sensor".isidentifier() else f"sensor_{name}"
        while name in found:
            name += "_"
        found[name] = imu
    return found


def _of_mjcf(model: Any) -> Iterator[tuple[str, RawImu]]:
    import mujoco

    kinds = int(mujoco.mjtSensor.mjSENS_GYRO), int(mujoco.mjtSensor.mjSENS_ACCELEROMETER)
    sites = {
        int(model.sensor_objid[k]): None  # a gyroscope and an accelerometer of one site are one IMU
        for k in range(model.nsensor)
        if int(model.sensor_type[k]) in kinds
    }
    for site in sites:
        body = model.body(int(model.site_bodyid[site])).name
        place, turn = np.array(model.site_pos[site]), model.site_quat[site]
        name = model.site(site).name or f"{body}_imu"
        yield name, RawImu(body, place, bool(np.abs(turn[1:]).max() > SAME_DIRECTION))


def _of_urdf(file: XmlFile) -> Iterator[tuple[str, RawImu]]:
    for gazebo in file.root.findall("gazebo"):
        body = gazebo.get("reference", "")
        for sensor in gazebo.findall("sensor"):
            if sensor.get("type") not in ("imu", "imu_sensor") or not file.has("link", body):
                continue
            pose = numbers(sensor.findtext("pose"), [0.0] * 6)
            turned = bool(np.abs(pose[3:]).max() > SAME_DIRECTION)
            yield sensor.get("name") or f"{body}_imu", RawImu(body, pose[:3], turned)
