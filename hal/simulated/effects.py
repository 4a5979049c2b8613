"""Effects of a simulated robot beyond its description: the parameters of all of them.

How each effect is computed stands in the file that uses its parameters: ``imu_effects.py``, ``drive_effects.py``,
``gears.py``, ``battery.py``, ``windings.py``, ``switch_effects.py``, ``gantry.py``, ``stribeck.py`` and ``variation.py``. A check of a graph needs none
of them. A *spread* is half the width of a uniform distribution around the nominal value, drawn by the seed.
"""

from __future__ import annotations

import math

from ...mathematics.arrays import Array
from ...mathematics.constants import COPPER, MAGNETS
from ...robots.robot_description import PowerSupply, RobotDescription
from ...runtime.language.parameters import Parameters, ThreeNumbers, TwoNumbers, parameter


class ImuEffects(Parameters):
    """Imperfections of a simulated IMU, besides noise, bias and range; by default none."""

    gyro_delay: float = parameter(
        0.0,
        unit="s",
        ge=0.0,
        le=0.05,
        text="age of the gyroscope's reading, in whole physics steps",
    )
    accelerometer_delay: float = parameter(
        0.0, unit="s", ge=0.0, le=0.05, text="age of the accelerometer's reading, likewise"
    )
    delay_spread: float = parameter(
        0.0, unit="s", ge=0.0, le=0.02, text="spread of both delays, which are drawn together"
    )
    bandwidth: float | None = parameter(
        None, unit="Hz", gt=0.0,
        text="cutoff of the unit's own filter (second order, maximally flat); none: no filter",
    )  # fmt: skip
    mount_frequency: float | None = parameter(
        None, unit="Hz", gt=0.0, text="at which the mount rings; none: it is rigid"
    )
    mount_damping: float = parameter(0.1, gt=0.0, le=2.0, text="damping ratio of the mount")
    position: ThreeNumbers = parameter(
        (0.0, 0.0, 0.0), unit="m", text="offset of the unit from its nominal place, base frame"
    )
    position_spread: float = parameter(0.0, unit="m", ge=0.0, text="spread of it, per axis")
    rotation: ThreeNumbers = parameter(
        (0.0, 0.0, 0.0), unit="rad",
        text="rotation vector from the base's axes to the unit's, which nobody told",
    )  # fmt: skip
    rotation_spread: float = parameter(0.0, unit="rad", ge=0.0, text="spread of it, per axis")
    gyro_scale_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor on each axis of the gyroscope"
    )
    accelerometer_scale_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor on each axis of the accelerometer"
    )
    acceleration_sensitivity: float = parameter(
        0.0, unit="rad s/m", ge=0.0,
        text="spread of the rate that the gyroscope reads for each m/s^2 along the same axis",
    )  # fmt: skip

    @property
    def moved(self) -> bool:
        """True if the unit is not at its nominal place and angle."""
        return any((*self.position, *self.rotation, self.position_spread, self.rotation_spread))

    @property
    def filters(self) -> int:
        """The number of filters that a reading passes."""
        return (self.mount_frequency is not None) + (self.bandwidth is not None)

    @property
    def ideal(self) -> bool:
        """True if the reading is the motion of the base itself."""
        return self == ImuEffects()


class EncoderEffects(Parameters):
    """Imperfections of the joint encoders, besides offset and resolution; by default none."""

    delay: float = parameter(
        0.0, unit="s", ge=0.0, le=0.05, text="age of angle and velocity, in whole physics steps"
    )
    velocity_filter: float = parameter(
        0.0, unit="s", ge=0.0, le=0.05,
        text="time constant of the drive's own filter of the velocity; 0: the true velocity",
    )  # fmt: skip
    eccentricity: float = parameter(
        0.0, unit="rad", ge=0.0, text="amplitude of an error once a turn, with a drawn phase"
    )
    compliance: float = parameter(
        0.0, unit="rad/(N m)", ge=0.0, text="compliance of the gear before the encoder"
    )
    backlash: float = parameter(
        0.0, ge=0.0,
        text="width of the gear's play before the encoder, as a multiple of the description's `gear_play`",
    )  # fmt: skip


class MotorEffects(Parameters):
    """Imperfections of the motors and their current loops; by default none."""

    torque_constant: float = parameter(
        1.0, gt=0.0, text="factor on the torque constants of all motors"
    )
    torque_constant_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor, per motor"
    )
    saturation: float = parameter(
        0.0, ge=0.0, lt=1.0,
        text="share of the torque that the iron loses at the peak torque; it grows with its square",
    )  # fmt: skip
    current_bandwidth: float | None = parameter(
        None, unit="Hz", gt=0.0, text="of the current loop (first order); none: it follows at once"
    )
    torque_limit: float | None = parameter(
        None, unit="N m", gt=0.0,
        text="limit of a motor's torque by its current, below its peak; none: its peak",
    )  # fmt: skip
    ripple: float = parameter(
        0.0, ge=0.0, lt=0.5,
        text="amplitude of the torque ripple, as a share of a motor's peak torque; with a drawn phase",
    )  # fmt: skip
    ripple_periods: int = parameter(60, ge=1, text="periods of the ripple in a turn of the output")
    cogging: float = parameter(
        0.0, ge=0.0, lt=0.5,
        text="amplitude of the torque of magnets on teeth, which acts at rest and without current, too, as a "
        "share of a motor's peak torque; with a drawn phase",
    )  # fmt: skip
    cogging_periods: int = parameter(
        72, ge=1, text="periods of the cogging in a turn of the output"
    )
    load_friction: float = parameter(
        0.0, ge=0.0, lt=1.0, text="share of the torque that the gear loses to friction under load"
    )


class GearParameters(Parameters):
    """Gears between rotors and joints, at the output."""

    stiffness: float = parameter(unit="N m/rad", gt=0.0, text="of every gear")
    damping: float = parameter(0.0, unit="N m s/rad", ge=0.0, text="of every gear")
    backlash: float = parameter(0.0, unit="rad", ge=0.0, text="width of the play")
    output_share: float = parameter(
        0.1, gt=0.0, lt=1.0, text="share of the rotor's inertia that sits behind the gear"
    )


class LinkEffects(Parameters):
    """Differences of the links from the description, besides a common factor on all masses."""

    mass_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor on the mass of every link"
    )
    com_spread: float = parameter(
        0.0, unit="m", ge=0.0, text="spread of the offset of every link's CoM, per axis"
    )
    inertia_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of a further factor on the inertia of every link"
    )
    length_spread: float = parameter(
        0.0, ge=0.0, le=0.1,
        text="spread of the factor by which every link is longer in all directions: the joints, contact points, "
        "shapes and CoM on it lie as much further from its own joint",
    )  # fmt: skip


class JointEffects(Parameters):
    """Differences of joints and rotors from the description, besides the common factor ``joint_friction``."""

    friction_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor on friction and damping of every joint"
    )
    static_friction: float = parameter(
        1.0, ge=1.0, le=5.0,
        text="friction at rest as a multiple of that of a joint that moves, to which it falls with speed "
        "(Stribeck); 1: no difference",
    )  # fmt: skip
    static_friction_spread: float = parameter(
        0.0,
        ge=0.0,
        lt=1.0,
        text="spread of the factor on what friction at rest has more, per joint",
    )
    stribeck_velocity: float = parameter(
        0.2, unit="rad/s", gt=0.0, text="at which 1/e of what friction at rest has more is left"
    )
    rotor_inertia: float = parameter(1.0, gt=0.0, text="factor on the inertia of all rotors")
    rotor_inertia_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor, per motor"
    )


class SoleParameters(Parameters):
    """Rubber under the contact points: contacts with this softness and bounce."""

    time_constant: float = parameter(
        0.008, unit="s", gt=0.0, le=0.1, text="in which a contact settles; stiff ones take 4 ms"
    )
    damping_ratio: float = parameter(1.0, gt=0.0, le=2.0, text="below 1 the soles bounce")


class CableParameters(Parameters):
    """A cable to the robot's base, which pulls from the first tick on."""

    pull: float = parameter(
        ge=0.0, text="its horizontal force in a drawn direction, as a share of the robot's weight"
    )
    weight: float = parameter(0.0, ge=0.0, text="weight of it that hangs on the robot, likewise")


class GantryParameters(Parameters):
    """A gantry: the robot hangs from a rope at its base when the run begins, and is let down."""

    height: float = parameter(0.04, unit="m", ge=0.0, le=1.0, text="of the soles above the ground")
    lower_after: float | None = parameter(
        0.5, unit="s", ge=0.0,
        text="time at which it is let down, from the first command on; none: on a person's word",
    )  # fmt: skip
    speed: float | None = parameter(
        0.08, unit="m/s", gt=0.0, text="at which it is let down; none: it is dropped"
    )
    slack: float = parameter(
        0.5,
        unit="m",
        ge=0.0,
        text="length of the rope beyond that at which it pulls, once the robot stands",
    )
    rope: float = parameter(1.0, unit="m", gt=0.0, text="length of the rope while the robot hangs")
    above_com: float = parameter(
        0.15, unit="m", ge=0.0, text="height of its fixing to the base above the robot's CoM"
    )
    stretch: float = parameter(0.005, unit="m", gt=0.0, text="stretch by the robot's weight")


class BatteryParameters(Parameters):
    """A pack, or the supply of a bench; what is none is as under ``supply`` in the robot's description."""

    open_voltage: float | None = parameter(
        None, unit="V", gt=0.0, text="without load, at the start"
    )
    resistance: float | None = parameter(
        None, unit="ohm", ge=0.0, text="resistance that a load sees at once"
    )
    recovery_resistance: float | None = parameter(
        None,
        unit="ohm",
        ge=0.0,
        text="resistance whose voltage builds up under load and recovers after it",
    )
    recovery_time: float = parameter(
        10.0, unit="s", gt=0.0, text="time constant of building up and recovering"
    )
    capacity: float | None = parameter(None, unit="A s", gt=0.0, text="charge of the full pack")
    fall: float | None = parameter(
        None, unit="V", ge=0.0, text="fall of the open voltage from full to empty"
    )
    board_power: float | None = parameter(
        None, unit="W", ge=0.0, text="power of computer and boards"
    )

    def of(self, robot: RobotDescription) -> PowerSupply:
        """Return the supply of a robot whose description has one, with these parameters in place of its values."""
        assert robot.supply is not None
        changes = self.model_dump(exclude_none=True, exclude={"recovery_time"})
        return robot.supply.model_copy(update=changes)


class WindingParameters(Parameters):
    """Windings that warm, and their effect on the motors; what is none is as under ``supply`` in the robot's
    description."""

    temperature: float = parameter(
        25.0, ge=-40.0, le=150.0, text="of all windings at the start [deg C]"
    )
    ambient: float = parameter(25.0, ge=-40.0, le=100.0, text="of what cools them [deg C]")
    magnets: float = parameter(
        MAGNETS,
        unit="1/K",
        ge=0.0,
        le=0.01,
        text="share of the torque constant at 25 deg C that is lost",
    )
    copper: float = parameter(
        COPPER,
        unit="1/K",
        ge=0.0,
        le=0.01,
        text="share of the resistance at 25 deg C that is gained",
    )
    heat_capacity: float | None = parameter(None, unit="J/K", gt=0.0, text="of a winding")
    thermal_resistance: float | None = parameter(
        None, unit="K/W", gt=0.0, text="from a winding to what cools it"
    )

    def of(self, robot: RobotDescription) -> PowerSupply:
        """Return the supply of a robot whose description has one, with these parameters in place of its windings'
        values."""
        assert robot.supply is not None
        given = {"heat_capacity": self.heat_capacity, "thermal_resistance": self.thermal_resistance}
        changes = {f"winding_{name}": value for name, value in given.items() if value is not None}
        return robot.supply.model_copy(update=changes)


class SwitchEffects(Parameters):
    """Delay and force threshold of the foot switches; by default none."""

    threshold: TwoNumbers | None = parameter(
        None,
        text="lowest and highest force that closes a switch, drawn per switch, as shares of the weight that stands on "
        "each contact point; none: `switch_threshold`",
    )  # fmt: skip
    debounce: float = parameter(
        0.0, unit="s", ge=0.0, le=0.1,
        text="time for which a switch must be pressed or free before the board reports it",
    )  # fmt: skip
    sticking: float = parameter(
        0.0, unit="s", ge=0.0, le=0.1, text="for how long a switch stays closed that is free again"
    )


def longest_gear_step(params: GearParameters, inertia: Array) -> float:
    """Return the longest step [s] at which rotors of this ``inertia`` [kg m^2] against their gears' output stages are
    integrated well: a tenth of the shortest period."""
    least = float(inertia[inertia > 0.0].min())
    share = params.output_share
    fastest = math.sqrt(params.stiffness / (least * share * (1.0 - share)))
    return 0.2 * math.pi / fastest


def longest_stribeck_step(joints: JointEffects, friction: Array, inertia: Array) -> float:
    """Return the longest step [s] at which static friction that falls with speed is followed: a fifth of the time in
    which it would let the speed of a bare rotor grow by e.

    Args:
        friction: Coulomb friction of the joints [N m], (n_joints,), with its factors.
        inertia: of the rotors [kg m^2], (n_joints,); joints without any are left out.
    """
    beyond = (joints.static_friction - 1.0) * (1.0 + joints.static_friction_spread) * friction
    falling = math.sqrt(2.0 / math.e) * beyond / joints.stribeck_velocity
    turning = (inertia > 0.0) & (falling > 0.0)
    if not turning.any():
        return math.inf
    return 0.2 * float((inertia[turning] / falling[turning]).min())
