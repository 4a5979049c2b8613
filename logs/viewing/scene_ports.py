"""What of a graph can be drawn in 3D. A recording does not say which signal a port carries, so
ports are known by their fields' names: whoever calls his ``com`` and ``contact_force`` is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..file.format import Header, RecordedField

POSE_FIELDS = ("base_position", "base_orientation", "joint_position")


@dataclass(frozen=True)
class PoseSource:
    """The full names of the fields that say where every link is."""

    base_position: str
    base_orientation: str
    joint_position: str


@dataclass(frozen=True)
class ScenePorts:
    """Full names, as ``block.port.field`` or ``block.port``; ``None`` where the graph has none.

    Attributes:
        pose: of the robot that is drawn solid: the true one, or else the estimated one.
        estimate: of the robot that is drawn beside it, where ``pose`` is the true one.
        com: centre of mass [m].
        contact_position: contact points [m], (n_contacts, 3).
        contact_force: the forces that act on them [N]: true ones, or else the commanded ones.
        ground_height: of the ground below each contact point [m].
        plan: a port with the planned ``com``, ``foot_position`` and ``foot_yaw``.
        feet: a port with the feet's target ``position`` and ``rotation``, seen from the base.
        push: a port with a ``force`` from outside and the ``point`` it acts at.
        friction: the coefficient that the block counts with which commands the forces.
    """

    pose: PoseSource
    estimate: PoseSource | None = None
    com: str | None = None
    contact_position: str | None = None
    contact_force: str | None = None
    ground_height: str | None = None
    plan: str | None = None
    feet: str | None = None
    push: str | None = None
    friction: float | None = None


def ports_of(header: Header) -> dict[str, dict[str, RecordedField]]:
    """Every output as ``block.port``, with its fields by their own names, in file order."""
    ports: dict[str, dict[str, RecordedField]] = {}
    for field in header.bus.fields:
        if not field.constant:
            ports.setdefault(field.name.rpartition(".")[0], {})[field.field_name] = field
    return ports


def port_with(ports: Mapping[str, Mapping[str, RecordedField]], *fields: str) -> str | None:
    """The first port that has all these fields; ``name:dimension`` also asks for a dimension."""
    wanted = [field.partition(":")[::2] for field in fields]
    return next(
        (
            port
            for port, known in ports.items()
            if all(
                name in known and (not size or size in known[name].dimensions)
                for name, size in wanted
            )
        ),
        None,
    )


def port_with_pose(header: Header) -> str | None:
    """The first output, as ``block.port``, whose signal says where every link is."""
    return port_with(ports_of(header), *POSE_FIELDS) if header.robot is not None else None


def scene_ports(header: Header) -> ScenePorts | None:
    """What can be drawn; ``None`` if nothing says where the robot is."""
    if header.robot is None:
        return None
    ports = ports_of(header)
    truth = port_with_pose(header)
    base = port_with(ports, "position", "orientation", "linear_velocity")
    # measured joints: a command has gains, too
    measured = {port: fields for port, fields in ports.items() if "stiffness" not in fields}
    joints = port_with(measured, "position:n_joints", "velocity", "torque")
    estimate = None
    if base is not None and joints is not None:
        estimate = PoseSource(f"{base}.position", f"{base}.orientation", f"{joints}.position")
    pose = PoseSource(*(f"{truth}.{name}" for name in POSE_FIELDS)) if truth else estimate
    if pose is None:
        return None
    loads = port_with(ports, "contact_position", "contact_force")
    terms = port_with(ports, "com", "contact_position")
    command = port_with(ports, "force:n_contacts")
    if loads is not None:
        position, force = f"{loads}.contact_position", f"{loads}.contact_force"
    elif terms is not None and command is not None:
        position, force = f"{terms}.contact_position", f"{command}.force"
    else:
        position = force = ""
    has_com = truth if truth is not None and "com" in ports[truth] else terms
    ground = port_with(ports, "ground_height")
    return ScenePorts(
        pose=pose,
        estimate=estimate if truth else None,
        com=f"{has_com}.com" if has_com else None,
        contact_position=position or None,
        contact_force=force or None,
        ground_height=f"{ground}.ground_height" if ground else None,
        plan=port_with(ports, "com", "foot_position", "foot_yaw"),
        feet=port_with(ports, "position:n_feet", "rotation:n_feet"),
        push=port_with(ports, "force", "point"),
        friction=_number(header, f"{block_of(command)}.friction") if command else None,
    )


def block_of(port: str) -> str:
    """``wbc.command`` -> ``wbc``."""
    return port.rpartition(".")[0]


def _number(header: Header, parameter: str) -> float | None:
    value = header.parameters.get(parameter)
    return float(value) if isinstance(value, int | float) else None
