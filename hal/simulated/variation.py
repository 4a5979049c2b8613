"""Differences of the bodies of a simulated robot and its ground from their descriptions, drawn by the seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...mathematics.elementary import cos, sin
from ...robots.description import RobotDescription
from ..random_streams import Purpose, stream
from .effects import CableParameters, JointEffects
from .imu_effects import NOMINAL, ImuPose, draw_imu_pose, draw_spread
from .parameters import SimulatorParameters


@dataclass(frozen=True)
class Variation:
    """The differences from the nominal world.

    ``friction`` is the coefficient of the ground, ``contact_stiffness`` a factor on the stiffness of the
    contacts, ``mass`` a factor on every mass and inertia, ``base_com_offset`` [m, base frame] that of the
    base link's CoM, and ``joint_friction`` a factor on friction and damping of the motors. The others
    have an element for each link (``link_mass``, ``link_inertia`` and ``link_length``, factors, and ``link_com`` [m, link
    frame]), joint (``friction_of_joint`` and ``static_friction``, factors), motor (``rotor_inertia``, a factor) or thruster
    (``thrust``, a factor); empty: all nominal. ``imu`` is where the IMU is. ``rotor_share`` is the share of the
    rotors' inertia that the bodies carry; gears that yield have the rest. ``sole`` is the time constant [s]
    and the damping ratio of the contact points' contacts, ``gravity`` [m/s^2] is seen from the floor.
    """

    friction: float = 0.7
    contact_stiffness: float = 1.0
    mass: float = 1.0
    base_com_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    joint_friction: float = 1.0
    link_mass: tuple[float, ...] = ()
    link_com: tuple[tuple[float, float, float], ...] = ()
    link_inertia: tuple[float, ...] = ()
    friction_of_joint: tuple[float, ...] = ()
    rotor_inertia: tuple[float, ...] = ()
    imu: ImuPose = NOMINAL
    rotor_share: float = 1.0
    sole: tuple[float, float] | None = None
    gravity: tuple[float, float, float] = (0.0, 0.0, -GRAVITY)
    link_length: tuple[float, ...] = ()
    static_friction: tuple[float, ...] = ()
    thrust: tuple[float, ...] = ()

    def factor(self, of: tuple[float, ...], k: int) -> float:
        """Return the factor of a link, joint, motor or thruster."""
        return of[k] if of else 1.0

    def metrics(self) -> dict[str, float]:
        """Return the extremes of the factors that vary from link to link and from joint to joint, if any."""
        found: dict[str, float] = {}
        for name, values in (
            ("link_length", self.link_length), ("static_friction", self.static_friction),
            ("thrust", self.thrust),
        ):  # fmt: skip
            if values:
                found |= {f"robot_least_{name}": min(values), f"robot_largest_{name}": max(values)}
        return found

    def rotors(self, robot: RobotDescription) -> Array:
        """Return the inertias of all rotors at their outputs [kg m^2], (n_motors,)."""
        nominal = np.asarray(robot.motors.rotor_inertia)
        return nominal * np.array(self.rotor_inertia) if self.rotor_inertia else nominal


def _gravity(params: SimulatorParameters) -> tuple[float, float, float]:
    """Gravity [m/s^2] in the frame of a floor that leans."""
    tilt = params.ground.floor_tilt
    if not tilt:
        return 0.0, 0.0, -GRAVITY
    heading = 2.0 * math.pi * float(stream(params.seed, Purpose.FLOOR_TILT).random())
    along, down = GRAVITY * sin(tilt), GRAVITY * cos(tilt)
    return along * cos(heading), along * sin(heading), -down


def _static_friction(joints: JointEffects, seed: int, n: int) -> tuple[float, ...]:
    """Return the static friction of each of ``n`` joints as a multiple of Coulomb friction; empty: no difference."""
    if joints.static_friction == 1.0:
        return ()
    draws = stream(seed, Purpose.STATIC_FRICTION).uniform(-1.0, 1.0, n)
    beyond = (joints.static_friction - 1.0) * (1.0 + joints.static_friction_spread * draws)
    return tuple((1.0 + beyond).tolist())


def draw_pull(
    cable: CableParameters, seed: int, robot: RobotDescription
) -> tuple[float, float, float]:
    """Return the force of a cable [N, world]."""
    pull, hanging = cable.pull * robot.weight, cable.weight * robot.weight
    heading = 2.0 * math.pi * float(stream(seed, Purpose.CABLE).random())
    return pull * cos(heading), pull * sin(heading), -hanging


def draw_variation(params: SimulatorParameters, robot: RobotDescription) -> Variation:
    """Draw the variation of the world from the seed in these parameters."""

    ground, body, actuators = params.ground, params.body, params.actuators

    def uniform(purpose: Purpose) -> float:
        return float(stream(params.seed, purpose).uniform(-1.0, 1.0))

    def factors(purpose: Purpose, spread: float, count: int) -> tuple[float, ...]:
        if not spread:
            return ()
        draws = stream(params.seed, purpose).uniform(-1.0, 1.0, count)
        return tuple((1.0 + spread * draws).tolist())

    friction = ground.friction
    if ground.friction_range is not None:
        low, high = ground.friction_range
        friction = low + (high - low) * 0.5 * (1.0 + uniform(Purpose.FRICTION))
    stiffness = ground.contact_stiffness * ground.contact_stiffness_spread ** uniform(
        Purpose.CONTACT_STIFFNESS
    )
    x, y, z = draw_spread(
        tuple(body.base_com_offset), body.base_com_spread, params.seed, Purpose.BASE_COM
    )
    mass = body.mass_scale * (1.0 + body.mass_spread * uniform(Purpose.MASS))
    links, joints, n = body.links, actuators.joints, len(robot.joints)
    centres: tuple[tuple[float, float, float], ...] = ()
    if links.com_spread:
        draws = stream(params.seed, Purpose.LINK_COM).uniform(-1.0, 1.0, (len(robot.links), 3))
        centres = tuple((a, b, c) for a, b, c in (links.com_spread * draws).tolist())
    rotors = factors(Purpose.ROTOR_INERTIA, joints.rotor_inertia_spread, n)
    if joints.rotor_inertia != 1.0:
        rotors = tuple(joints.rotor_inertia * each for each in rotors or (1.0,) * n)
    return Variation(
        friction, stiffness, mass, (x, y, z), actuators.joint_friction,
        factors(Purpose.LINK_MASS, links.mass_spread, len(robot.links)), centres,
        factors(Purpose.LINK_INERTIA, links.inertia_spread, len(robot.links)),
        factors(Purpose.JOINT_FRICTION, joints.friction_spread, n), rotors,
        draw_imu_pose(params.sensors.imu, params.seed) if params.sensors.imu.moved else NOMINAL,
        1.0 if actuators.gears is None else actuators.gears.output_share,
        None if ground.soles is None else (ground.soles.time_constant, ground.soles.damping_ratio),
        _gravity(params), factors(Purpose.LINK_LENGTH, links.length_spread, len(robot.links)),
        _static_friction(joints, params.seed, n),
        factors(Purpose.THRUST, actuators.thrust_spread, len(robot.thrusters)),
    )  # fmt: skip
