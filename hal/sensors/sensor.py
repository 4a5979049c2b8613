"""The sensors of a robot, and the lookup of those in its description.

A sensor is one class in one file of this folder, or of a user's own module. It declares

* what it measures: the ``signal`` that the robot publishes at an output called as the sensor;
* what the robot's YAML may set for it: ``Settings``, beside where it is mounted;
* how MuJoCo gives the true values: ``add_to_model`` and ``from_mujoco``;
* its errors: a ``NoiseModel`` for each field, from the YAML;
* how a packet of a sensor board carries it: ``to_packet`` and ``from_packet``;
* how ROS 2 and the 3D view show it: ``ros2`` and ``drawn``.

In a robot's YAML a sensor has a name of its own::

    sensors:
      imu: true
      switches: true
      left_sole:
        kind: force_torque
        link: left_foot
        position: [0.0075, 0.0, -0.024]
        noise: {force: {noise: 0.5, bias: 1.0, range: 500.0, resolution: 0.1, delay: 0.002}}
"""

from __future__ import annotations

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import ValidationError

from ...files.validation import describe
from ...mathematics.arrays import Array
from ...mathematics.compiling.call_sequence import Call
from ...robots.description import RobotDescription
from ...robots.robot_description import SensorMount
from ...runtime.language.errors import BlockError
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.registry import find_class
from ...runtime.language.signals import Signal
from .noise import FieldErrors, NoiseModel

if TYPE_CHECKING:
    from mujoco import MjData, MjModel, MjSpec

_PACKAGE = __name__.rpartition(".")[0]


class SensorError(BlockError):
    """A robot's description has a sensor that cannot be; the text names it, and the reason."""


class SensorSettings(Parameters):
    """The settings of a sensor in a robot's YAML, beside its kind and its mounting."""

    noise: dict[str, NoiseModel] = parameter({}, text="the errors of each field, by its name")


@dataclass(frozen=True)
class RosMessage:
    """The ROS 2 message of a sensor: its ``type``, and the path in it of each field, as
    ``{"force": "wrench.force"}``. The header's frame is the link that the sensor is on."""

    type: str
    fields: Mapping[str, str]


@dataclass(frozen=True)
class Arrow:
    """Draws the force [N] in ``field``, in the sensor's axes, as an arrow where the sensor is."""

    field: str


class Sensor(ABC):
    """A sensor of a robot. Class attributes are common to all sensors of a kind.

    Args:
        name: of the sensor, and of the robot's output.
        dimensions: the named sizes of the robot.
    """

    kind: ClassVar[str] = ""
    """The name of the kind in a robot's YAML."""
    signal: ClassVar[type[Signal]]
    """The signal that it measures."""
    averaged: ClassVar[tuple[str, ...]] = ()
    """The fields whose reading is the mean since the last sample, as behind a filter that passes nothing
    faster; the reading of other fields is the value at the instant of the sample."""
    packet_fields: ClassVar[tuple[str, ...]] = ()
    """The fields in a packet, in their order; by default all."""
    ros2: ClassVar[RosMessage | None] = None
    """The message that ROS 2's tools know; none: its numbers only."""
    drawn: ClassVar[Arrow | None] = None
    """Its arrow in the 3D view; none: it is plotted only."""

    def __init__(self, name: str, dimensions: Mapping[str, int] | None = None) -> None:
        self.name = name
        self.sizes = {
            field: prod(each.resolve(dimensions or {}))
            for field, each in self.signal.fields.items()
        }
        """Number of elements of each field."""

    def reading_calls(
        self, true: Mapping[str, Array], errors: Mapping[str, FieldErrors], out: Signal
    ) -> list[Call]:
        """Return the calls that write a sample to ``out``: the ``true`` value of every field, (n,), with its
        ``errors``."""
        found: list[Call] = []
        for field in self.signal.fields:
            found += errors[field].calls(true[field], getattr(out, field))
        return found

    def packet_size(self) -> int:
        """Return the bytes of a sample in a packet."""
        return 4 * sum(self.sizes[name] for name in self.packet_fields or self.signal.fields)

    def to_packet(self, values: Signal) -> bytes:
        """Pack a sample as a packet carries it: float32, little-endian, one field behind the other."""
        fields = self.packet_fields or tuple(self.signal.fields)
        numbers = [x for name in fields for x in np.ravel(getattr(values, name)).tolist()]
        return struct.pack(f"<{len(numbers)}f", *numbers)

    def from_packet(self, data: bytes | bytearray | memoryview, values: Signal) -> None:
        """Write a sample in the bytes of a packet to ``values``."""
        numbers, start = np.frombuffer(data, "<f4"), 0
        for name in self.packet_fields or self.signal.fields:
            out = getattr(values, name)
            out[...] = numbers[start : start + out.size].reshape(out.shape)
            start += out.size


class MountedSensor(Sensor):
    """A sensor that a robot's description mounts on a link.

    Args:
        name: of the sensor, and of the robot's output.
        mount: the sensor's entry in the description.

    Raises:
        SensorError: the entry sets something that this kind of sensor does not have.

    Attributes:
        link, position: where it is [m, link frame].
        orientation: of its axes in the link's, a unit quaternion x, y, z, w.
        settings: what else the description sets.
    """

    Settings: ClassVar[type[SensorSettings]] = SensorSettings

    def __init__(self, name: str, mount: SensorMount) -> None:
        super().__init__(name)
        self.link, self.position = mount.link, mount.position
        length = math.sqrt(sum(x * x for x in mount.orientation))
        if not 0.0 < length < math.inf:
            raise SensorError(
                f"sensor {name}: orientation is a quaternion x, y, z, w that is not zero, not "
                f"{list(mount.orientation)}"
            )
        self.orientation = tuple(x / length for x in mount.orientation)
        try:
            self.settings = self.Settings.model_validate(dict(mount.model_extra or {}))
        except ValidationError as error:
            first = describe(error.errors(include_url=False)[0], self.Settings)
            known = ", ".join(self.Settings.model_fields)
            raise SensorError(
                f"sensor {name}: {first}; {self.kind} has kind, link, position, orientation, {known}"
            ) from error
        for field in self.settings.noise:
            if field not in self.signal.fields:
                raise SensorError(
                    f"sensor {name}: noise of {field!r}; {self.kind} has the fields "
                    + ", ".join(self.signal.fields)
                )

    def noise(self, field: str) -> NoiseModel:
        """Return the errors of a field."""
        return self.settings.noise.get(field, NoiseModel())

    @property
    def site(self) -> str:
        """The name of the sensor's site in MuJoCo's model."""
        return f"sensor/{self.name}"

    @abstractmethod
    def add_to_model(self, spec: MjSpec, body: str) -> None:
        """Add what MuJoCo needs to give the true values. The ``body`` of the link has the ``site`` in
        place already; what is added is called ``{site}/...``."""

    @abstractmethod
    def from_mujoco(self, model: MjModel, data: MjData, out: Mapping[str, Array]) -> list[Call]:
        """Return the calls that write the true value of every field to ``out`` after a physics step. They may keep
        views of the simulator's memory."""


def find_sensor(kind: str, folder: Path | None = None) -> type[MountedSensor]:
    """Find the class of a kind of sensor, or the one that ``module:Class`` names.

    Args:
        folder: a folder in which a user's module is searched for.

    Raises:
        SensorError: there is none, or it is no sensor.
    """
    if ":" in kind:
        found = _found.get(kind) or find_class(kind, folder)
        if not (isinstance(found, type) and issubclass(found, MountedSensor)):
            raise SensorError(f"{kind} is no MountedSensor")
        _found[kind] = found
        return found
    kinds = sensor_kinds()
    if kind not in kinds:
        near = get_close_matches(kind, kinds, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise SensorError(
            f"there is no kind of sensor {kind!r}: {', '.join(kinds)}, or module:Class{hint}"
        )
    return kinds[kind]


_found: dict[str, type[MountedSensor]] = {}
"""The classes of users' own modules that were found before, wherever their folder was."""


def sensor_kinds() -> dict[str, type[MountedSensor]]:
    """Return the kinds of sensors of this folder that a description can mount on a link."""
    names = sorted(path.stem for path in Path(__file__).parent.glob("[!_]*.py"))
    modules = [import_module(f"{_PACKAGE}.{name}") for name in names]
    classes = [each for module in modules for each in vars(module).values()]
    return {
        each.kind: each
        for each in classes
        if isinstance(each, type) and issubclass(each, MountedSensor) and each.kind
    }


def mounted_sensors(
    robot: RobotDescription | None, folder: Path | None = None
) -> tuple[MountedSensor, ...]:
    """Return the sensors that a robot's description mounts on its links, in its order.

    Raises:
        SensorError: there is no such kind or link, or a setting is wrong.
    """
    found: list[MountedSensor] = []
    for name, mount in robot.sensors.mounted.items() if robot is not None else ():
        assert robot is not None
        links = [link.name for link in robot.links]
        if mount.link not in links:
            near = get_close_matches(mount.link, links, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise SensorError(f"sensor {name}: {robot.name} has no link {mount.link!r}{hint}")
        try:
            kind = find_sensor(mount.kind, folder)
        except SensorError as error:
            raise SensorError(f"sensor {name}: {error}") from error
        found.append(kind(name, mount))
    return tuple(found)
