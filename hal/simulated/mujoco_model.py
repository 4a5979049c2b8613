"""The simulator's model, built from the robot's description.

Every joint of the description has one body and one joint, so this rigid-body model and the
controller's have the same links. Rotor inertia is exact: a rotor that is geared to one joint is
that joint's armature, and a rotor that is geared to several is a fixed tendon with armature
(``add_rotors``).

Contact: spheres at the contact points, and capsules and hulls for the rest of the robot. These shapes collide
with the ground and with other limbs, but not with their own limb or the base; a limb consists of
all links that one joint of the base carries. Shapes of two limbs that overlap in the standing
pose do not collide with each other, as they only approximate the links' shapes. Every contact of a
shape is a forbidden contact. Friction cones are elliptic.

MuJoCo scales the stiffness of a contact with the mass that it carries: a time constant and a
damping ratio are given, so robots of any mass sink in by the same fraction of a millimetre.

Names in the model: links, joints and contact points are called as in the description. A contact
point is a geom and a site; if it is a foot's only point the site is at the centre of its ball. A
link called ``world`` is the body ``link/world``. Motors are ``motor/<joint>``, thrusters are actuators
and sites ``thruster/<name>``, named points are sites ``point/<name>``, and the sensors are ``com``, ``com_velocity``,
``angular_momentum``, ``accelerometer``, ``contacts`` (how many contacts there are at all),
``sole/<link>`` (on uneven ground, how many contacts a sole and its points have with it),
``load/<contact point>`` (how many with the ground, and their net force on it). A sensor that the
description mounts has a site ``sensor/<name>``.
"""

from __future__ import annotations

import math
from collections import deque
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import Hull, RobotDescription
from ...robots.kinematics import ball_feet, contact_centres
from ...robots.terrain import Ground, HeightField, Terrain
from ..sensors.sensor import mounted_sensors
from .base import BASES
from .parameters import SimulatorParameters
from .thrusters import add_thrusters
from .unsupported import shared_motors, unsupported_motor
from .variation import Variation

if TYPE_CHECKING:
    from mujoco import MjModel, MjSpec


GROUND_BIT = 1
MAX_LIMBS = 30
"""The number of limbs that collision bits can distinguish; further limbs do not collide with the
last of these."""
CONTACT_TIME_CONSTANT = 0.004
LEAST_RISE = 1e-4
"""A level height field is stored as one of so many metres."""
FIELD_THICKNESS = 0.1
"""Depth of a height field below its lowest corner [m]."""
CONTACT_IMPEDANCE = (0.95, 0.99, 0.001, 0.5, 2.0)


def build_mujoco_model(
    robot: RobotDescription,
    *,
    scene: Terrain | None = None,
    timestep: float = 0.0005,
    variation: Variation | None = None,
) -> MjModel:
    """Return the compiled model of the robot, with the actuator profile in use, in that scene.

    Raises:
        ValueError: the description's joints are not in depth-first order, or its transmission
            gears one motor to joints of different limbs, which the simulator cannot express.
    """
    spec = mujoco_spec(robot, scene=scene, timestep=timestep, variation=variation)
    model = spec.compile()
    first = model.njnt - len(robot.joints)
    names = [model.joint(k).name for k in range(first, model.njnt)]
    if names != [joint.name for joint in robot.joints]:
        raise ValueError(f"{robot.name}: the joints must be listed depth first: {', '.join(names)}")
    overlaps = _overlaps(model, robot)
    for first_body, second_body in overlaps:
        spec.add_exclude(bodyname1=first_body, bodyname2=second_body)
    return spec.compile() if overlaps else model


def mujoco_spec(
    robot: RobotDescription,
    *,
    scene: Terrain | None = None,
    timestep: float = 0.0005,
    variation: Variation | None = None,
) -> MjSpec:
    """Return the model before it is compiled, so that callers can add to it, such as colours.

    In this model limbs that overlap in the standing pose do collide.

    Raises:
        ValueError: the transmission gears one motor to joints of different limbs.
    """
    import mujoco

    variation = variation or Variation()
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.compiler.degree = False
    spec.option.timestep = timestep
    spec.option.gravity = variation.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    _add_ground(spec, scene or Terrain(), variation)
    _add_robot(spec, robot, variation)
    _add_mounted_sensors(spec, robot, variation)
    _add_sensors(spec, robot, uneven=scene is not None and scene.uneven > 0.0)
    return spec


def body_name(link: str) -> str:
    """Return the name of a link's body in the model; the name ``world`` is reserved by MuJoCo."""
    return "link/world" if link == "world" else link


def _overlaps(model: MjModel, robot: RobotDescription) -> list[tuple[str, str]]:
    """Return the pairs of bodies whose shapes overlap in the standing pose.

    For a robot on a fixed base they include pairs with the world, on which it is mounted.
    """
    import mujoco

    data = mujoco.MjData(model)
    base = BASES[robot.base_joint](data)
    base.place()
    base.shift(np.array([0.0, 0.0, 1e3]))  # away from the ground
    data.qpos[base.positions :] = robot.standing_position
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    pairs: dict[tuple[str, str], None] = {}
    for first, second in data.contact.geom.tolist():
        bodies = [model.body(int(model.geom_bodyid[geom])).name for geom in (first, second)]
        pairs[(bodies[0], bodies[1])] = None
    return list(pairs)


def _surface(variation: Variation) -> dict[str, Any]:
    """Return the contact parameters of every geom; stiffness varies as 1 (time constant)^2."""
    time_constant = CONTACT_TIME_CONSTANT / float(np.sqrt(variation.contact_stiffness))
    return {
        "condim": 3,
        "friction": [variation.friction, 0.005, 0.0001],
        "solref": [time_constant, 1.0],
        "solimp": CONTACT_IMPEDANCE,
    }


def _sole(variation: Variation) -> dict[str, Any]:
    """Return the settings of a contact point: rubber decides alone how soft its contacts are."""
    surface = _surface(variation)
    if variation.sole is not None:
        surface |= {"solref": list(variation.sole), "priority": 1}
    return surface


def _add_ground(spec: MjSpec, scene: Terrain, variation: Variation) -> None:
    import mujoco

    bits = {"contype": GROUND_BIT, "conaffinity": 0}
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1], pos=[0, 0, scene.floor],
        **bits, **_surface(variation),
    )  # fmt: skip
    for k, block in enumerate(scene.blocks):
        low, high = np.array(block.least), np.array(block.most)
        place: dict[str, Any] = {"size": (high - low) / 2, "pos": (high + low) / 2}
        if not block.level:
            x, y, z, w = block.quaternion
            place = {"size": block.half_sizes, "pos": block.middle, "quat": [w, x, y, z]}
        spec.worldbody.add_geom(
            name=f"box/{k}", type=mujoco.mjtGeom.mjGEOM_BOX, **place, **bits,
            **_piece(block, variation),
        )  # fmt: skip
    for k, field in enumerate(scene.fields):
        heights = np.array(field.heights)
        low, high = np.array(field.least), np.array(field.most)
        rise = max(field.highest - field.lowest, LEAST_RISE)
        spec.add_hfield(
            name=f"field/{k}", nrow=len(heights), ncol=len(heights[0]),
            size=[*(high - low) / 2, rise, FIELD_THICKNESS],
            userdata=((heights - field.lowest) / rise).ravel(),
        )  # fmt: skip
        spec.worldbody.add_geom(
            name=f"field/{k}", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=f"field/{k}",
            pos=[*(high + low) / 2, field.lowest], **bits, **_piece(field, variation),
        )  # fmt: skip


def _piece(piece: Ground | HeightField, variation: Variation) -> dict[str, Any]:
    """Return the contact parameters of a piece of ground; what has its own decides alone."""
    surface = _surface(variation)
    if piece.friction is None and piece.stiffness == 1.0:
        return surface
    time_constant, damping = variation.sole or surface["solref"]
    surface |= {"solref": [time_constant / math.sqrt(piece.stiffness), damping], "priority": 2}
    if piece.friction is not None:
        surface["friction"] = [piece.friction, *surface["friction"][1:]]
    return surface


def _limb_of_link(robot: RobotDescription) -> dict[str, int]:
    """Return the number of every link's limb, 0 for the base; one joint of the base carries a limb."""
    limb = {robot.base: 0}
    for joint in robot.joints:
        on_base = joint.parent == robot.base
        following = min(max(limb.values()) + 1, MAX_LIMBS)
        limb[joint.child] = following if on_base else limb[joint.parent]
    return limb


def _add_robot(spec: MjSpec, robot: RobotDescription, variation: Variation) -> None:
    import mujoco

    limb = _limb_of_link(robot)
    centres = contact_centres(robot)
    balls = [robot.contacts[ball.point].name for ball in ball_feet(robot)]
    bodies: dict[str, Any] = {}
    names = [link.name for link in robot.links]

    def add_link(name: str, parent: Any, position: tuple[float, float, float]) -> None:
        link, number = robot.link(name), names.index(name)
        longer = variation.factor(variation.link_length, number)
        com = longer * np.array(link.com)
        if name == robot.base:
            com = com + variation.base_com_offset
        if variation.link_com:
            com = com + variation.link_com[number]
        mass = variation.mass * variation.factor(variation.link_mass, number)
        inertial: dict[str, Any] = {
            "mass": link.mass * mass, "ipos": com, "explicitinertial": True,
            "fullinertia": np.array(link.inertia)
            * mass * variation.factor(variation.link_inertia, number) * longer**2,
        }  # fmt: skip
        # A base that is bolted to the world may have no mass.
        inertial = inertial if link.mass > 0.0 else {}
        body = parent.add_body(name=body_name(name), pos=position, **inertial)
        bodies[name] = body
        # A limb's geoms have the limb's bit and accept those of earlier limbs: each pair once.
        bits = {"contype": 0, "conaffinity": GROUND_BIT}
        if limb[name]:
            bits["contype"] = 1 << limb[name]
            bits["conaffinity"] |= (1 << limb[name]) - 1
        for k, shape in enumerate(link.shapes):
            corners = [longer * x for corner in shape.corners for x in corner]
            place: dict[str, Any] = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "fromto": corners}
            if isinstance(shape, Hull):
                place = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": f"{name}/{k}"}
                spec.add_mesh(name=f"{name}/{k}", uservert=corners)
            elif shape.start == shape.end:
                place = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "pos": corners[:3]}
            body.add_geom(
                name=f"{name}/{k}", mass=0.0, size=[shape.radius, 0, 0],
                **place, **bits, **_surface(variation),
            )  # fmt: skip
        for foot in robot.feet:
            if foot.link != name:
                continue
            for contact, centre in zip(robot.contacts, centres, strict=True):
                if contact.foot != foot.name:
                    continue
                centre = centre + (longer - 1.0) * np.array(contact.position)
                body.add_geom(
                    name=contact.name, type=mujoco.mjtGeom.mjGEOM_SPHERE, mass=0.0,
                    size=[contact.radius, 0, 0], pos=centre, **bits, **_sole(variation),
                )  # fmt: skip
                is_ball = contact.name in balls
                at = centre if is_ball else longer * np.array(contact.position)
                body.add_site(name=contact.name, pos=at)
        for point, (owner, at) in robot.points.items():
            if owner == name:
                body.add_site(name=f"point/{point}", pos=longer * np.array(at))

    add_link(robot.base, spec.worldbody, (0.0, 0.0, 0.0))
    BASES[robot.base_joint].add_joints(bodies[robot.base])
    x, y, z, w = variation.imu.quaternion.tolist()
    bodies[robot.base].add_site(name="imu", pos=variation.imu.position, quat=[w, x, y, z])
    armature, motors = joint_armature(robot, variation), robot.motors
    hinge, slide = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
    yes, no = mujoco.mjtLimited.mjLIMITED_TRUE, mujoco.mjtLimited.mjLIMITED_FALSE
    for k, joint in enumerate(robot.joints):
        longer = variation.factor(variation.link_length, names.index(joint.parent))
        x, y, z = joint.origin
        add_link(joint.child, bodies[joint.parent], (longer * x, longer * y, longer * z))
        friction = variation.joint_friction * variation.factor(variation.friction_of_joint, k)
        bodies[joint.child].add_joint(
            name=joint.name, type=slide if joint.kind == "slide" else hinge, axis=joint.axis,
            limited=no if joint.limits is None else yes, range=joint.limits or (0.0, 0.0),
            solref_limit=[CONTACT_TIME_CONSTANT, 1.0], armature=armature[k],
            frictionloss=motors.friction[k] * friction,
            damping=[motors.damping[k] * friction, 0.0, 0.0],
        )  # fmt: skip
        motor = spec.add_actuator(
            name=f"motor/{joint.name}", target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        motor.set_to_motor()
    add_rotors(spec, robot, variation)
    add_thrusters(spec, bodies, robot, variation)


def _add_mounted_sensors(spec: MjSpec, robot: RobotDescription, variation: Variation) -> None:
    """Add a site for every sensor that the description mounts on a link, and what gives its true values."""
    names = [link.name for link in robot.links]
    for sensor in mounted_sensors(robot):
        body = body_name(sensor.link)
        longer = variation.factor(variation.link_length, names.index(sensor.link))
        place = longer * np.array(sensor.position)
        x, y, z, w = sensor.orientation
        spec.body(body).add_site(name=sensor.site, pos=place, quat=[w, x, y, z])
        sensor.add_to_model(spec, body)


def _add_sensors(spec: MjSpec, robot: RobotDescription, *, uneven: bool) -> None:
    import mujoco

    kind, thing = mujoco.mjtSensor, mujoco.mjtObj
    for name, sensor in (
        ("com", kind.mjSENS_SUBTREECOM),
        ("com_velocity", kind.mjSENS_SUBTREELINVEL),
        ("angular_momentum", kind.mjSENS_SUBTREEANGMOM),
    ):
        spec.add_sensor(
            name=name, type=sensor, objtype=thing.mjOBJ_BODY, objname=body_name(robot.base)
        )
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
    for link in _soles(robot) if uneven else ():
        spec.add_sensor(
            name=f"sole/{link}", type=kind.mjSENS_CONTACT,
            objtype=thing.mjOBJ_BODY, objname=body_name(link),
            reftype=thing.mjOBJ_BODY, refname="world", intprm=[found, 0, 1],
        )  # fmt: skip
    for contact in robot.contacts:
        spec.add_sensor(
            name=f"load/{contact.name}", type=kind.mjSENS_CONTACT,
            objtype=thing.mjOBJ_GEOM, objname=contact.name,
            reftype=thing.mjOBJ_BODY, refname="world",
            intprm=[found | 1 << int(field.mjCONDATA_FORCE), net_force, 1],
        )  # fmt: skip


def _soles(robot: RobotDescription) -> list[str]:
    """Return the links of feet with several contact points, between which they may touch uneven ground."""
    owners = [contact.foot for contact in robot.contacts]
    return [foot.link for foot in robot.feet if owners.count(foot.name) > 1]


def number_of_soles(model: MjModel) -> int:
    """Return the number of soles that may touch the ground between their contact points."""
    return sum(model.sensor(k).name.startswith("sole/") for k in range(model.nsensor))


def build_world(
    params: SimulatorParameters, robot: RobotDescription, variation: Variation
) -> MjModel:
    """Return the simulator's model of the robot in the scene these parameters describe.

    Raises:
        ValueError: the simulator cannot express the robot; see ``build_mujoco_model``.
    """
    scene = params.build_scene(robot)
    for cached in _model_cache:
        if cached.robot is robot and cached[1:4] == (scene, params.timestep, variation):
            return copy(cached.model)
    import mujoco

    model = build_mujoco_model(robot, scene=scene, timestep=params.timestep, variation=variation)
    # A state that has become NaN must be noticed, and not be replaced by the initial state.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    _model_cache.append(_CachedModel(robot, scene, params.timestep, variation, copy(model)))
    return model


class _CachedModel(NamedTuple):
    """A model that has been built, and what it was built from."""

    robot: RobotDescription
    scene: Terrain
    timestep: float
    variation: Variation
    model: MjModel


_model_cache: deque[_CachedModel] = deque(maxlen=4)
"""The models built last. The runs of a study mostly differ by what is not in the model, and building
it takes longer than anything else before a run. Callers get copies."""


def joint_armature(robot: RobotDescription, variation: Variation | None = None) -> Array:
    """Return the armature [kg m^2] (n_joints,) of the joints, from all motors without a tendon."""
    armature, shared = np.zeros(len(robot.joints)), shared_motors(robot)
    for motor, inertia in enumerate(_carried(robot, variation)):
        if motor not in shared:
            armature += inertia * robot.joint_to_motor[motor] ** 2
    return armature


def add_rotors(spec: MjSpec, robot: RobotDescription, variation: Variation | None = None) -> None:
    """Add a fixed tendon for every motor whose rotor couples joints.

    With ``A`` the transmission's ``joint_to_motor`` and ``I_m`` the motors' rotor inertias at the
    gearbox output, the rotors add ``A^T diag(I_m) A`` to the joint-space inertia. MuJoCo can express
    that in two ways: by the armature of a joint, which is a term on the diagonal, and by the armature
    of a fixed tendon whose length is a weighted sum of joint positions, which is a term of rank one. A
    motor's row of ``A`` is such a weighted sum, so one tendon for each motor that is geared to several
    joints is exact for any transmission, as long as each of these joints carries the next: the
    simulator's inertia matrix has no entries for other pairs of joints.

    Raises:
        ValueError: a motor couples two joints neither of which carries the other.
    """
    complaint = unsupported_motor(robot)
    if complaint:
        raise ValueError(f"{robot.name}: {complaint}")
    inertia = _carried(robot, variation)
    for motor in shared_motors(robot):
        tendon = spec.add_tendon(
            name=f"rotor/{robot.transmission.motors[motor]}",
            armature=inertia[motor],
        )
        for joint, weight in zip(robot.joints, robot.joint_to_motor[motor].tolist(), strict=True):
            if weight:
                tendon.wrap_joint(joint.name, weight)


def _carried(robot: RobotDescription, variation: Variation | None) -> list[float]:
    """Return the rotor inertia of every motor that the bodies carry [kg m^2]."""
    variation = variation or Variation()
    found: list[float] = (variation.rotor_share * variation.rotors(robot)).tolist()
    return found
