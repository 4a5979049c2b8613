"""The vocabulary every block speaks: the signals that travel between blocks and the robot.

Conventions, the same everywhere:

* SI units. World frame: z up. Body frame: the base link's, x forward, y left, z up.
* Orientation: unit quaternion x, y, z, w (Hamilton) that takes body vectors to the world.
* Generalised velocity (n_velocities): base linear velocity in the body frame, base angular
  velocity in the body frame, joint velocities (Pinocchio's order).
* Joints, feet and contact points in the order of the robot's description; BRUCE: right leg first,
  per leg hip yaw, hip pitch, hip roll, knee, ankle; toe before heel.
* Six-vectors (momentum): linear part first.
"""

from __future__ import annotations

from enum import IntEnum

from ...runtime.language.signals import Field, Signal


class Phase(IntEnum):
    """What the robot is doing, in the order of a jump."""

    STAND = 0
    SQUAT = 1
    THRUST = 2
    FLIGHT = 3
    LANDING = 4
    RECOVER = 5
    FAULT = 6


class CommandMode(IntEnum):
    """What a drive does with a joint command."""

    OFF = 0
    """No torque."""
    ACTIVE = 1
    """Feedforward torque plus joint feedback at the drive's rate."""
    DAMPING = 2
    """Joint damping only: how every run ends."""


class ImuReading(Signal):
    """One sample of the inertial measurement unit, at the base's origin."""

    angular_velocity = Field(3, unit="rad/s", frame="body", text="gyroscope")
    specific_force = Field(3, unit="m/s^2", frame="body", text="accelerometer; at rest +g upwards")


class JointState(Signal):
    """What the joint encoders and drives report."""

    position = Field("n_joints", unit="rad", text="joint angles")
    velocity = Field("n_joints", unit="rad/s", text="joint velocities")
    torque = Field("n_joints", unit="N m", text="joint torques from measured motor current")


class ContactSwitches(Signal):
    """The raw tactile switches under the feet."""

    closed = Field("n_contacts", dtype="bool", text="whether each switch is pressed")


class ContactState(Signal):
    """Which contact points carry load, after debouncing."""

    active = Field("n_contacts", dtype="bool", text="whether each point is in contact")


class BaseState(Signal):
    """The floating base: its pose and velocity."""

    position = Field(3, unit="m", frame="world", text="base origin")
    orientation = Field(4, unit="", text="quaternion x, y, z, w from body to world")
    linear_velocity = Field(3, unit="m/s", frame="world", text="velocity of the base origin")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="angular velocity of the base")


class EstimatorHealth(Signal):
    """How far an estimator believes itself, and what it has to live with.

    A standard deviation here is that of the error's norm: the root of the covariance's trace.
    """

    position_std = Field(unit="m", text="standard deviation of the position's error")
    velocity_std = Field(unit="m/s", text="of the velocity's error")
    tilt_std = Field(unit="rad", text="of the orientation's error about the horizontal axes")
    yaw_std = Field(unit="rad", text="of the orientation's error about the vertical axis")
    trusted = Field("n_contacts", dtype="bool", text="points that the estimate leans on now")
    gyro_saturated = Field(dtype="bool", text="an axis of the gyroscope is at the end of its range")
    accelerometer_saturated = Field(dtype="bool", text="the same of the accelerometer")
    saturated_ticks = Field(dtype="int64", text="ticks so far in which any of the two was")


class DynamicsTerms(Signal):
    """The whole-body model at the present state: everything the controllers need, once a tick."""

    velocity = Field("n_velocities", text="generalised velocity")
    mass_matrix = Field(("n_velocities", "n_velocities"), text="joint-space inertia with rotors")
    nonlinear_effects = Field("n_velocities", text="Coriolis, centrifugal and gravity terms")
    contact_position = Field(("n_contacts", 3), unit="m", frame="world", text="contact points")
    contact_velocity = Field(("n_contacts", 3), unit="m/s", frame="world", text="their velocities")
    contact_jacobian = Field(
        ("n_contacts", 3, "n_velocities"), frame="world", text="linear velocity Jacobians"
    )
    contact_drift = Field(
        ("n_contacts", 3), unit="m/s^2", frame="world", text="point acceleration at qdd = 0"
    )
    com = Field(3, unit="m", frame="world", text="centre of mass")
    com_velocity = Field(3, unit="m/s", frame="world", text="velocity of the centre of mass")
    linear_momentum = Field(3, unit="kg m/s", frame="world", text="l: mass times com velocity")
    angular_momentum = Field(3, unit="N m s", frame="world", text="k: about the com")
    centroidal_matrix = Field((6, "n_velocities"), frame="world", text="centroidal momentum matrix")
    centroidal_drift = Field(6, frame="world", text="momentum rate at qdd = 0")
    base_position = Field(3, unit="m", frame="world", text="base origin")
    base_rotation = Field((3, 3), unit="", text="rotation matrix from body to world")
    foot_position = Field(("n_feet", 3), unit="m", frame="world", text="sole centres")
    foot_rotation = Field(("n_feet", 3, 3), unit="", text="rotations from foot to world")


class JumpReference(Signal):
    """A planned jump at the present instant; positions relative to where the robot stood."""

    time = Field(unit="s", text="time since the plan began")
    phase = Field(dtype="int64", values=Phase, text="planned phase, see Phase")
    lift_off_time = Field(unit="s", text="planned lift-off in plan time")
    touchdown_time = Field(unit="s", text="planned touchdown in plan time")
    com = Field(3, unit="m", frame="world", text="centre of mass")
    com_velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    com_acceleration = Field(3, unit="m/s^2", frame="world", text="its acceleration")
    orientation = Field(4, unit="", text="base quaternion x, y, z, w")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="base angular velocity")
    angular_momentum = Field(3, unit="N m s", frame="world", text="k about the com")
    angular_momentum_rate = Field(3, unit="N m", frame="world", text="its rate")
    contact = Field("n_contacts", dtype="bool", text="which points are planned to carry load")
    foot_position = Field(("n_feet", 3), unit="m", frame="world", text="sole centres")
    foot_velocity = Field(("n_feet", 3), unit="m/s", frame="world", text="their velocities")
    foot_yaw = Field("n_feet", unit="rad", frame="world", text="heading of each foot")
    foot_pitch = Field("n_feet", unit="rad", frame="world", text="of each foot, toes down positive")
    joint_position = Field("n_joints", unit="rad", text="planned joint angles")
    joint_velocity = Field("n_joints", unit="rad/s", text="planned joint velocities")
    joint_acceleration = Field("n_joints", unit="rad/s^2", text="planned; zero if not known")
    joint_torque = Field("n_joints", unit="N m", text="planned joint torques; zero if not known")


class PhaseState(Signal):
    """The phase the robot is really in, by plan time and measured contact."""

    phase = Field(dtype="int64", values=Phase, text="see Phase")
    time_in_phase = Field(unit="s", text="time since the phase began")
    time_to_touchdown = Field(unit="s", text="predicted; zero outside flight")
    time_since_touchdown = Field(unit="s", text="zero before the first touchdown")
    stance = Field("n_contacts", dtype="bool", text="points the controller may push with")


class WholeBodyTarget(Signal):
    """What the whole-body controller is to achieve now."""

    com = Field(3, unit="m", frame="world", text="centre of mass")
    com_velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    com_acceleration = Field(3, unit="m/s^2", frame="world", text="its feedforward acceleration")
    orientation = Field(4, unit="", text="base quaternion x, y, z, w")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="base angular velocity")
    angular_momentum = Field(3, unit="N m s", frame="world", text="k about the com")
    angular_momentum_rate = Field(3, unit="N m", frame="world", text="its feedforward rate")
    joint_position = Field("n_joints", unit="rad", text="planned angles, for feet that roll")
    joint_velocity = Field("n_joints", unit="rad/s", text="their velocities")
    joint_acceleration = Field("n_joints", unit="rad/s^2", text="their accelerations")


class FootTarget(Signal):
    """Where the feet should be, seen from the base: the landing controller's output."""

    position = Field(("n_feet", 3), unit="m", frame="body", text="sole centres")
    velocity = Field(("n_feet", 3), unit="m/s", frame="body", text="their velocities")
    rotation = Field(("n_feet", 3, 3), unit="", text="rotations from foot to body")
    landing = Field(("n_feet", 3), unit="m", frame="world", text="landing places, from the com")


class JointTarget(Signal):
    """Joint angles and velocities to track."""

    position = Field("n_joints", unit="rad", text="joint angles")
    velocity = Field("n_joints", unit="rad/s", text="joint velocities")
    reachable = Field("n_feet", dtype="bool", text="whether the leg reaches the foot's target")


class WholeBodyCommand(Signal):
    """The whole-body controller's answer."""

    torque = Field("n_joints", unit="N m", text="feedforward joint torques")
    acceleration = Field("n_velocities", text="generalised acceleration")
    force = Field(("n_contacts", 3), unit="N", frame="world", text="contact forces on the robot")
    solved = Field(dtype="bool", text="whether the quadratic program was solved")
    failures = Field(dtype="int64", text="solver failures so far")


class JointCommand(Signal):
    """What the drives execute: mode, feedforward torque, joint targets and gains."""

    mode = Field(dtype="int64", values=CommandMode, text="see CommandMode")
    torque = Field("n_joints", unit="N m", text="feedforward joint torques")
    position = Field("n_joints", unit="rad", text="joint angle targets")
    velocity = Field("n_joints", unit="rad/s", text="joint velocity targets")
    stiffness = Field("n_joints", unit="N m/rad", text="joint feedback gain on position")
    damping = Field("n_joints", unit="N m s/rad", text="joint feedback gain on velocity")


class ExternalForce(Signal):
    """A force that something outside puts on the robot."""

    force = Field(3, unit="N", frame="world", text="force")
    point = Field(dtype="int64", text="index of the named point it acts at, in file order")


class RobotTruth(Signal):
    """What only a simulator knows. Peaks and minima are over the physics steps of the last tick."""

    base_position = Field(3, unit="m", frame="world", text="base origin")
    base_orientation = Field(4, unit="", text="quaternion x, y, z, w from body to world")
    base_linear_velocity = Field(3, unit="m/s", frame="world", text="velocity of the base origin")
    base_angular_velocity = Field(3, unit="rad/s", frame="body", text="angular velocity")
    joint_position = Field("n_joints", unit="rad", text="joint angles")
    joint_velocity = Field("n_joints", unit="rad/s", text="joint velocities")
    com = Field(3, unit="m", frame="world", text="centre of mass")
    com_velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    angular_momentum = Field(3, unit="N m s", frame="world", text="k about the com")
    contact_position = Field(("n_contacts", 3), unit="m", frame="world", text="contact points")
    contact_force = Field(
        ("n_contacts", 3), unit="N", frame="world", text="mean force on each point over the tick"
    )
    contact_touched = Field("n_contacts", dtype="bool", text="loaded in any physics step")
    ground_height = Field("n_contacts", unit="m", frame="world", text="ground under each point")
    forbidden_contacts = Field(
        dtype="int64", text="physics steps with any contact but toe or heel on the ground"
    )
    joint_limit_violation = Field(unit="rad", text="largest violation of a joint limit")
    motor_torque = Field("n_joints", unit="N m", text="motor torque of largest magnitude")
    motor_speed = Field("n_joints", unit="rad/s", text="motor speed of largest magnitude")
    motor_overload = Field(
        unit="N m", text="largest excess of a motor torque over what its speed allows"
    )
    saturated_share = Field(unit="", text="share of motor samples at the torque limit")
