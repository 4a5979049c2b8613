"""Signals between the blocks of a controller: the robot's state, its model, targets, torques.

Units, frames and orders are those of the package ``signals``.
"""

from __future__ import annotations

from enum import IntEnum

from ...runtime.language.signals import Field, Signal


class ContactState(Signal):
    """Contact points that carry load, after debouncing."""

    active = Field("n_contacts", dtype="bool", text="each point is in contact")


class FootLoad(Signal):
    """Load on each foot, by the torques of the legs."""

    force = Field("n_feet", unit="N", text="upward force on each foot")
    centre = Field(("n_feet", 3), unit="m", frame="world", text="place on the sole where it acts")
    loaded = Field("n_feet", dtype="bool", text="the foot carries load")


class SwitchFault(IntEnum):
    """Fault of a foot switch."""

    NONE = 0
    """Nothing was noticed."""
    STUCK_CLOSED = 1
    """It stayed closed in the air."""
    STUCK_OPEN = 2
    """It stayed open under a foot that stands."""
    BOUNCING = 3
    """It opened and closed too often."""
    HEAVY = 4
    """No fault: it needs more than its share of the weight, and its point stands although it is open."""


class SwitchHealth(Signal):
    """Foot switches that are not to be believed now, and whether the robot should stop for that."""

    fault = Field("n_contacts", dtype="int64", values=SwitchFault, text="see SwitchFault")
    stop = Field(dtype="bool", text="one of them is at fault, and the robot is not in the air")


class BaseState(Signal):
    """The floating base: its pose and velocity."""

    position = Field(3, unit="m", frame="world", text="base origin")
    orientation = Field(
        4, unit="", quaternion=True, text="quaternion x, y, z, w from body to world"
    )
    linear_velocity = Field(3, unit="m/s", frame="world", text="velocity of the base origin")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="angular velocity of the base")


class MotorCondition(Signal):
    """Present condition of motors and pack. Shares are of the description's values, in the motors' order."""

    torque_constant = Field("n_joints", text="share of the torque constant")
    corner_speed = Field("n_joints", text="share of the speed up to which there is peak torque")
    no_load_speed = Field("n_joints", text="share of the speed at which there is no torque left")
    open_voltage = Field(unit="V", text="of the pack without load; zero: not known")
    pack_resistance = Field(unit="ohm", text="of the pack and its leads")


class PoseMeasurement(Signal):
    """Place of the base, as measured from outside."""

    number = Field(dtype="int64", text="counts the measurements, from 1; zero: none yet")
    time = Field(unit="s", text="time of the measurement")
    position = Field(3, unit="m", frame="world", text="base origin")
    heading = Field(unit="rad", frame="world", text="heading of the base")


class EstimatorHealth(Signal):
    """An estimator's own uncertainty, and the quality of its measurements.

    A standard deviation here is that of the error's norm: the root of the covariance's trace.
    """

    position_std = Field(unit="m", text="standard deviation of the position's error")
    velocity_std = Field(unit="m/s", text="standard deviation of the velocity's error")
    tilt_std = Field(unit="rad", text="standard deviation of the error about the horizontal axes")
    yaw_std = Field(unit="rad", text="standard deviation of the error about the vertical axis")
    trusted = Field("n_contacts", dtype="bool", text="points that correct the estimate now")
    gyro_saturated = Field(dtype="bool", text="an axis of the gyroscope is at the end of its range")
    accelerometer_saturated = Field(dtype="bool", text="an axis of it is at the end of its range")
    saturated_ticks = Field(dtype="int64", text="ticks so far in which any of the two was")


class MassEstimate(Signal):
    """Mass of the robot and its place, as its model should have them."""

    mass = Field(unit="kg", text="mass of the robot; zero where it is not known")
    mass_std = Field(unit="kg", text="standard deviation of its error")
    com_offset = Field(3, unit="m", frame="body", text="of the torso's CoM from the description's")
    com_offset_std = Field(3, unit="m", frame="body", text="standard deviation of its error")


class DelayEstimate(Signal):
    """The delay from sensing to torque."""

    delay = Field(unit="s", text="the delay to compensate")
    measured = Field(unit="s", text="as measured; zero while it is not known")
    known = Field(dtype="bool", text="it has been measured")
    ahead = Field(unit="s", text="lead time of the controller")


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


class WholeBodyTarget(Signal):
    """The targets of the whole-body controller at the present instant."""

    com = Field(3, unit="m", frame="world", text="centre of mass")
    com_velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    com_acceleration = Field(3, unit="m/s^2", frame="world", text="its feedforward acceleration")
    orientation = Field(4, unit="", quaternion=True, text="base quaternion x, y, z, w")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="base angular velocity")
    angular_acceleration = Field(
        3, unit="rad/s^2", frame="body", text="its feedforward acceleration"
    )
    angular_momentum = Field(3, unit="N m s", frame="world", text="k about the com")
    angular_momentum_rate = Field(3, unit="N m", frame="world", text="its feedforward rate")
    joint_position = Field("n_joints", unit="rad", text="planned angles, for feet that roll")
    joint_velocity = Field("n_joints", unit="rad/s", text="their velocities")
    joint_acceleration = Field("n_joints", unit="rad/s^2", text="their accelerations")


class PointTarget(Signal):
    """Target of a point of the robot at the present instant."""

    position = Field(3, unit="m", frame="world", text="place of the point")
    velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    acceleration = Field(3, unit="m/s^2", frame="world", text="its acceleration")


class WholeBodyCommand(Signal):
    """The whole-body controller's solution: torques, accelerations and contact forces."""

    torque = Field("n_joints", unit="N m", text="feedforward joint torques")
    acceleration = Field("n_velocities", text="generalised acceleration")
    force = Field(("n_contacts", 3), unit="N", frame="world", text="contact forces on the robot")
    solved = Field(dtype="bool", text="the quadratic program was solved")
    failures = Field(dtype="int64", text="solver failures so far")


class FootTarget(Signal):
    """Targets of the feet, seen from the base: the landing controller's output."""

    position = Field(("n_feet", 3), unit="m", frame="body", text="sole centres")
    velocity = Field(("n_feet", 3), unit="m/s", frame="body", text="their velocities")
    rotation = Field(("n_feet", 3, 3), unit="", text="rotations from foot to body")
    landing = Field(("n_feet", 3), unit="m", frame="world", text="landing places, from the com")


class JointTarget(Signal):
    """Joint angles and velocities to track."""

    position = Field("n_joints", unit="rad", text="joint angles")
    velocity = Field("n_joints", unit="rad/s", text="joint velocities")
    reachable = Field("n_feet", dtype="bool", text="the leg reaches the foot's target")


class JointTorque(Signal):
    """Torques of the joints; for a slide it is a force [N]."""

    torque = Field("n_joints", unit="N m", text="joint torques")
