"""Signals of a graph that are drawn in 3D.

A port is drawn by the type of its signal: a ``RobotTruth`` poses the solid robot, an
``ExternalForce`` is an arrow, and so on. A signal of a project's own is drawn too if it derives
from one of these types, or if it has the same fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array
from ..file.format import Header, RecordedField


@dataclass(frozen=True)
class Role:
    """The role in which a port is drawn: the name of its signal's type, and fields that tell a
    similar type.

    A field ``name:dimension`` must also have that dimension. A port with one of the fields in
    ``lacks`` has not this role.
    """

    signal: str
    fields: tuple[str, ...]
    lacks: tuple[str, ...] = ()


TRUTH = Role("RobotTruth", ("base_position", "base_orientation", "joint_position"))
LOADS = Role("RobotTruth", ("contact_position", "contact_force"))
GROUND = Role("RobotTruth", ("ground_height",))
BASE = Role("BaseState", ("position", "orientation", "linear_velocity"))
JOINTS = Role("JointState", ("position:n_joints", "velocity", "torque"), lacks=("stiffness",))
TERMS = Role("DynamicsTerms", ("com", "contact_position"))
FORCES = Role("WholeBodyCommand", ("force:n_contacts",))
PLAN = Role("JumpReference", ("com", "foot_position", "foot_yaw"))
FEET = Role("FootTarget", ("position:n_feet", "rotation:n_feet"))
PUSH = Role("ExternalForce", ("force", "point"))
IMU = Role("ImuReading", ("angular_velocity", "specific_force"))
THRUST = Role("ThrusterState", ("thrust:n_thrusters",))
ROLES = (TRUTH, LOADS, GROUND, BASE, JOINTS, TERMS, FORCES, PLAN, FEET, PUSH, IMU, THRUST)
OTHERS = (
    "BodyTwist", "ContactState", "ContactSwitches", "CourseGoal", "DelayEstimate", "EstimatorHealth", "FootLoad",
    "FootholdPose", "JointCommand", "JointTarget", "JointTorque", "JumpCommand", "JumpFrame", "MassEstimate", "MotorCondition",
    "PhaseState", "PoseMeasurement", "PlanSegment", "PlanRequest", "PointTarget", "RobotHealth", "SeenStones",
    "SwitchHealth", "ThrustCommand", "WholeBodyTarget",
)  # fmt: skip
"""Signals of the common vocabulary that have no role: similar fields do not give them one."""


@dataclass(frozen=True)
class PoseSource:
    """The full names of the fields that say where every link is.

    The names for the base are ``None`` for a robot whose base is fixed: it is at the origin.
    """

    base_position: str | None
    base_orientation: str | None
    joint_position: str

    def base(self, values: Callable[[str], Array], count: int) -> tuple[Array, Array]:
        """Return positions (count, 3) and quaternions (count, 4) of the base by a signal's
        ``values``; a fixed one is at the origin."""
        if self.base_position is None or self.base_orientation is None:
            return np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        return values(self.base_position), values(self.base_orientation)

    @property
    def block(self) -> str:
        """The port that poses the robot, ``block.port``: the base's, or the joints'."""
        return block_of(self.base_position or self.joint_position)


@dataclass(frozen=True)
class ScenePorts:
    """The signals that are drawn, by full names ``block.port.field`` or ``block.port``; ``None``
    for nothing.

    Attributes:
        pose: poses the robot that is drawn solid: the true one, or else the estimated one.
        estimate: poses the robot that is drawn as wires beside it, where ``pose`` is the true one.
        com: centre of mass [m].
        contact_position: contact points [m], (n_contacts, 3).
        contact_force: the forces on them [N], true ones or else commanded ones.
        ground_height: height of the ground below each contact point [m].
        plan: a port with the planned ``com``, ``foot_position`` and ``foot_yaw``.
        feet: a port with the feet's target ``position`` and ``rotation``, seen from the base.
        thrust: the thrust [N] of every thruster, (n_thrusters,).
        push: a port with a ``force`` from outside and the ``point`` it acts at.
        friction: the friction coefficient of the block that commands the forces.
    """

    pose: PoseSource
    estimate: PoseSource | None = None
    com: str | None = None
    contact_position: str | None = None
    contact_force: str | None = None
    ground_height: str | None = None
    plan: str | None = None
    feet: str | None = None
    thrust: str | None = None
    push: str | None = None
    friction: float | None = None


Ports = Mapping[str, Mapping[str, RecordedField]]


def ports_of(header: Header) -> dict[str, dict[str, RecordedField]]:
    """Return every output as ``block.port``, with its fields by their own names.

    They have the order in which their blocks are executed, so that what is measured comes before what
    is computed from it, a prediction for example. What a wire has delayed comes last.
    """
    ports: dict[str, dict[str, RecordedField]] = {}
    for field in header.bus.fields:
        if not field.constant:
            ports.setdefault(field.name.rpartition(".")[0], {})[field.field_name] = field
    place = {block: index for index, block in enumerate(header.order)}

    def rank(port: str) -> tuple[bool, int]:
        return "~" in port, place.get(block_of(port), len(place))

    return {port: ports[port] for port in sorted(ports, key=rank)}


def port_of(ports: Ports, role: Role) -> str | None:
    """Return the first port whose signal is of the role's type, or else the first one that is like
    it."""
    known = {role.signal for role in ROLES} | set(OTHERS)
    like = None
    for port, fields in ports.items():
        types = next(iter(fields.values())).signals
        if not _has(fields, role):
            continue
        if role.signal in types:
            return port
        if like is None and known.isdisjoint(types):
            like = port
    return like


def _has(fields: Mapping[str, RecordedField], role: Role) -> bool:
    """Tell whether a port has all fields of a role and none that it lacks."""
    wanted = [field.partition(":")[::2] for field in role.fields]
    return not any(name in fields for name in role.lacks) and all(
        name in fields and (not size or size in fields[name].dimensions) for name, size in wanted
    )


def scene_ports(header: Header) -> ScenePorts | None:
    """Find the ports of a graph that can be drawn; ``None`` where nothing says where the robot is."""
    robot = header.robot
    if robot is None:
        return None
    ports = ports_of(header)
    truth, base, joints = (port_of(ports, role) for role in (TRUTH, BASE, JOINTS))
    estimate = None
    if base is not None and joints is not None:
        estimate = PoseSource(f"{base}.position", f"{base}.orientation", f"{joints}.position")
    elif joints is not None and robot.base_joint == "fixed":
        estimate = PoseSource(None, None, f"{joints}.position")
    pose = PoseSource(*(f"{truth}.{name}" for name in TRUTH.fields)) if truth else estimate
    if pose is None:
        return None
    terms, command = port_of(ports, TERMS), port_of(ports, FORCES)
    has_com = truth if truth is not None and "com" in ports[truth] else terms
    position, force = _contacts(ports, terms, command) if robot.contacts else (None, None)
    ground = port_of(ports, GROUND) if robot.contacts else None
    thrust = port_of(ports, THRUST)
    return ScenePorts(
        pose=pose,
        estimate=estimate if truth and base else None,
        com=f"{has_com}.com" if has_com else None,
        contact_position=position,
        contact_force=force,
        ground_height=f"{ground}.ground_height" if ground else None,
        plan=port_of(ports, PLAN) if robot.feet else None,
        feet=port_of(ports, FEET) if robot.feet else None,
        thrust=f"{thrust}.thrust" if thrust and robot.thrusters else None,
        push=port_of(ports, PUSH),
        friction=_number(header, f"{block_of(command)}.friction") if command else None,
    )


def _contacts(
    ports: Ports, terms: str | None, command: str | None
) -> tuple[str, str] | tuple[None, None]:
    """Return the contact points and the forces on them: true ones, or else computed and commanded
    ones."""
    loads = port_of(ports, LOADS)
    if loads is not None:
        return f"{loads}.contact_position", f"{loads}.contact_force"
    if terms is not None and command is not None:
        return f"{terms}.contact_position", f"{command}.force"
    return None, None


def block_of(port: str) -> str:
    """Return the block of a port: ``wbc`` of ``wbc.command``."""
    return port.rpartition(".")[0]


def _number(header: Header, parameter: str) -> float | None:
    value = header.parameters.get(parameter)
    return float(value) if isinstance(value, int | float) else None
