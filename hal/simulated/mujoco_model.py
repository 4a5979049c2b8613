"""The simulator's model, built from the robot's description.

One body and one hinge for every joint of the description, so the two rigid-body models (this one
and the controller's) have the same links. Rotor inertia is exact: its diagonal is joint armature
and every off-diagonal pair a fixed tendon with armature, because a motor that is geared to two
joints couples their accelerations.

Contact: spheres at the contact points and capsules for the rest of the robot. The capsules collide
with the ground and with other legs, not with their own leg and not with the base; anything they
touch is a forbidden contact. Cones are elliptic.

Names in the model: links, joints and contact points as in the description (a contact point is a
geom and a site), motors ``motor/<joint>``, named points sites ``point/<name>``, and the sensors
``com``, ``com_velocity``, ``angular_momentum``, ``accelerometer``, ``contacts`` (how many contacts
there are at all), ``load/<contact point>`` (how many with the ground, and their net force on it).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...robots.description import ActuatorProfile, RobotDescription
from .scenes import Scene

if TYPE_CHECKING:
    from mujoco import MjModel, MjSpec

GROUND_BIT = 1
CONTACT_TIME_CONSTANT = 0.004
CONTACT_IMPEDANCE = (0.95, 0.99, 0.001, 0.5, 2.0)


@dataclass(frozen=True)
class Variation:
    """What differs from the nominal world: friction coefficient, factor on the contacts' stiffness,
    factor on every mass and inertia, offset of the base link's CoM [m, base frame]."""

    friction: float = 0.7
    contact_stiffness: float = 1.0
    mass: float = 1.0
    base_com_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


def build_mujoco_model(
    robot: RobotDescription,
    *,
    profile: str = "koala",
    scene: Scene | None = None,
    timestep: float = 0.0005,
    variation: Variation | None = None,
) -> MjModel:
    """The compiled model of the robot with that actuator profile in that scene.

    Raises:
        KeyError: the robot has no actuator profile of that name.
        ValueError: the description's joints are not in depth-first order, or its transmission
            couples a joint more strongly to others than fixed tendons can express.
    """
    spec = mujoco_spec(robot, profile=profile, scene=scene, timestep=timestep, variation=variation)
    model = spec.compile()
    names = [model.joint(k).name for k in range(1, model.njnt)]
    if names != [joint.name for joint in robot.joints]:
        raise ValueError(f"{robot.name}: the joints must be listed depth first: {', '.join(names)}")
    return model


def mujoco_spec(
    robot: RobotDescription,
    *,
    profile: str = "koala",
    scene: Scene | None = None,
    timestep: float = 0.0005,
    variation: Variation | None = None,
) -> MjSpec:
    """The same before it is compiled, for who adds to it, such as colours.

    Raises:
        KeyError, ValueError: as ``build_mujoco_model``, but for the order of the joints.
    """
    import mujoco

    variation = variation or Variation()
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.compiler.degree = False
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    _add_ground(spec, scene or Scene(), variation)
    _add_robot(spec, robot, robot.profiles[profile], variation)
    _add_sensors(spec, robot)
    return spec


def rotor_inertia(robot: RobotDescription, profile: ActuatorProfile) -> NDArray[np.float64]:
    """The inertia (n_joints, n_joints) that equal rotors add to the joint-space inertia."""
    matrix = robot.joint_to_motor
    return np.asarray(profile.rotor_inertia * matrix.T @ matrix)


def _surface(variation: Variation) -> dict[str, Any]:
    """The contact parameters of every geom; stiffness goes with the inverse square of time."""
    time_constant = CONTACT_TIME_CONSTANT / float(np.sqrt(variation.contact_stiffness))
    return {
        "condim": 3,
        "friction": [variation.friction, 0.005, 0.0001],
        "solref": [time_constant, 1.0],
        "solimp": CONTACT_IMPEDANCE,
    }


def _add_ground(spec: MjSpec, scene: Scene, variation: Variation) -> None:
    import mujoco

    surface = {**_surface(variation), "contype": GROUND_BIT, "conaffinity": 0}
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1], pos=[0, 0, scene.floor],
        **surface,
    )  # fmt: skip
    for k, box in enumerate(scene.boxes):
        low = np.array([box.x[0], box.y[0], box.bottom])
        high = np.array([box.x[1], box.y[1], box.top])
        spec.worldbody.add_geom(
            name=f"box/{k}", type=mujoco.mjtGeom.mjGEOM_BOX, size=(high - low) / 2,
            pos=(high + low) / 2, **surface,
        )  # fmt: skip


def _leg_of_link(robot: RobotDescription) -> dict[str, int]:
    """For every link the number of its leg, 0 for the base; a leg is what hangs on one joint."""
    leg = {robot.base: 0}
    for joint in robot.joints:
        on_base = joint.parent == robot.base
        leg[joint.child] = max(leg.values()) + 1 if on_base else leg[joint.parent]
    return leg


def _add_robot(
    spec: MjSpec, robot: RobotDescription, profile: ActuatorProfile, variation: Variation
) -> None:
    import mujoco

    leg = _leg_of_link(robot)
    bodies: dict[str, Any] = {}

    def add_link(name: str, parent: Any, position: tuple[float, float, float]) -> None:
        link = robot.link(name)
        com = np.array(link.com)
        if name == robot.base:
            com = com + variation.base_com_offset
        body = parent.add_body(
            name=name, pos=position, mass=link.mass * variation.mass, ipos=com,
            fullinertia=np.array(link.inertia) * variation.mass, explicitinertial=True,
        )  # fmt: skip
        bodies[name] = body
        # A leg's geoms carry the leg's bit and accept those of legs before it: every pair once.
        bits = {"contype": 0, "conaffinity": GROUND_BIT}
        if leg[name]:
            bits["contype"] = 1 << leg[name]
            bits["conaffinity"] |= (1 << leg[name]) - 1
        for k, shape in enumerate(link.shapes):
            body.add_geom(
                name=f"{name}/{k}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, mass=0.0,
                size=[shape.radius, 0, 0], fromto=[*shape.start, *shape.end],
                **bits, **_surface(variation),
            )  # fmt: skip
        for foot in robot.feet:
            if foot.link != name:
                continue
            for contact in robot.contacts:
                if contact.foot != foot.name:
                    continue
                centre = np.add(contact.position, (0.0, 0.0, contact.radius))
                body.add_geom(
                    name=contact.name, type=mujoco.mjtGeom.mjGEOM_SPHERE, mass=0.0,
                    size=[contact.radius, 0, 0], pos=centre, **bits, **_surface(variation),
                )  # fmt: skip
                body.add_site(name=contact.name, pos=contact.position)
        for point, (owner, place) in robot.points.items():
            if owner == name:
                body.add_site(name=f"point/{point}", pos=place)

    add_link(robot.base, spec.worldbody, (0.0, 0.0, 0.0))
    bodies[robot.base].add_freejoint(name="base")
    bodies[robot.base].add_site(name="imu")
    inertia = rotor_inertia(robot, profile)
    coupling = inertia - np.diag(np.diag(inertia))
    armature = np.diag(inertia) - np.abs(coupling).sum(axis=1)
    for k, joint in enumerate(robot.joints):
        if armature[k] < -1e-12:
            raise ValueError(
                f"{robot.name}: the transmission couples {joint.name} to other joints by more "
                f"than its own reflected inertia, which fixed tendons cannot express"
            )
        add_link(joint.child, bodies[joint.parent], joint.origin)
        bodies[joint.child].add_joint(
            name=joint.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis,
            limited=mujoco.mjtLimited.mjLIMITED_TRUE, range=joint.limits,
            solref_limit=[CONTACT_TIME_CONSTANT, 1.0], armature=max(armature[k], 0.0),
            frictionloss=profile.friction, damping=[profile.damping, 0.0, 0.0],
        )  # fmt: skip
        motor = spec.add_actuator(
            name=f"motor/{joint.name}", target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        motor.set_to_motor()
    for i, j in zip(*np.nonzero(np.triu(coupling)), strict=True):
        first, second = robot.joints[i].name, robot.joints[j].name
        tendon = spec.add_tendon(
            name=f"rotor/{first}/{second}", armature=abs(float(coupling[i, j]))
        )
        tendon.wrap_joint(first, 1.0)
        tendon.wrap_joint(second, float(np.sign(coupling[i, j])))


def _add_sensors(spec: MjSpec, robot: RobotDescription) -> None:
    import mujoco

    kind, thing = mujoco.mjtSensor, mujoco.mjtObj
    for name, sensor in (
        ("com", kind.mjSENS_SUBTREECOM),
        ("com_velocity", kind.mjSENS_SUBTREELINVEL),
        ("angular_momentum", kind.mjSENS_SUBTREEANGMOM),
    ):
        spec.add_sensor(name=name, type=sensor, objtype=thing.mjOBJ_BODY, objname=robot.base)
    spec.add_sensor(
        name="accelerometer", type=kind.mjSENS_ACCELEROMETER, objtype=thing.mjOBJ_SITE,
        objname="imu",
    )  # fmt: skip
    field = mujoco.mjtConDataField
    found = 1 << int(field.mjCONDATA_FOUND)
    net_force = 3
    spec.add_sensor(
        name="contacts", type=kind.mjSENS_CONTACT, intprm=[found, 0, 1],
    )  # fmt: skip
    for contact in robot.contacts:
        spec.add_sensor(
            name=f"load/{contact.name}", type=kind.mjSENS_CONTACT,
            objtype=thing.mjOBJ_GEOM, objname=contact.name,
            reftype=thing.mjOBJ_BODY, refname="world",
            intprm=[found | 1 << int(field.mjCONDATA_FORCE), net_force, 1],
        )  # fmt: skip
