"""The common base of the estimators of the floating base that integrate the IMU."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, Literal

import numpy as np

from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.inertial_filter import StandingPoints
from ...robots.contact_kinematics import ContactKinematics, Measured
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, ContactState, ImuReading, JointState
from .base_filter import (
    Base,
    Estimator,
    Filter,
    Fixed,
    Learning,
    Legs,
    Sample,
    Scratch,
    Settings,
)


class BaseEstimate(Signal):
    """The state of an estimator of the base."""

    position = Field(3, unit="m", frame="world", text="base origin")
    orientation = Field(4, unit="", text="quaternion x, y, z, w from body to world")
    velocity = Field(3, unit="m/s", frame="world", text="velocity of the base origin")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="at the last tick, without bias")
    gyro_bias = Field(3, unit="rad/s", frame="body", text="learnt while standing still")
    accelerometer_bias = Field(3, unit="m/s^2", frame="body", text="learnt while standing still")
    mean_rate = Field(3, unit="rad/s", frame="body", text="low-passed gyroscope")
    mean_joint_rate = Field("n_joints", unit="rad/s", text="low-passed joint velocities")
    anchor = Field(("n_contacts", 3), unit="m", frame="world", text="where the points stand")
    anchored = Field("n_contacts", dtype="bool", text="which points have an anchor")
    ballistic_velocity = Field(
        3, unit="m/s", frame="world", text="velocity of the CoM at the start of the free fall"
    )
    flight_ticks = Field(dtype="int64", text="ticks since the last trusted contact")
    started = Field(dtype="bool", text="whether the first sample has been seen")


class BiasSamples(Signal):
    """Means that are being formed: sums over the present block of samples and the one before."""

    samples = Field(dtype="int64", text="samples the mean is made of")
    filled = Field(dtype="int64", text="samples in the block being filled")
    held = Field(dtype="int64", text="samples in the block before, none or a full block")
    filling_sum = Field(3, frame="body", text="sum of the samples whose mean is the learnt bias")
    held_sum = Field(3, frame="body", text="the same sum of the block before")


class InertialParameters(Parameters):
    """The parameters of estimators that integrate the IMU."""

    flight: Literal["imu", "ballistic"] = parameter(
        "imu", text="the prediction in flight: by the IMU, or by a free fall of the CoM"
    )
    velocity_gain: float = live_parameter(
        0.03, gt=0.0, le=1.0, text="gain of the legs' velocity correction, per tick"
    )
    position_gain: float = live_parameter(
        0.05, gt=0.0, le=1.0, text="gain of the legs' position correction, per tick"
    )
    tilt_gain: float = live_parameter(
        0.002, ge=0.0, le=1.0, text="gain of the accelerometer's tilt correction, per tick"
    )
    still_rate: float = live_parameter(
        0.08,
        unit="rad/s",
        gt=0.0,
        text="rate of base and joints below which the robot stands still",
    )


class InertialEstimator(KernelBlock):
    """The base of estimators that integrate the IMU and are corrected by the legs (paper, II-B).

    ``StateEstimator`` has the equations of prediction and of the correction by the legs.

    **Flight.** While no point is trusted there is only the prediction. ``flight: imu`` integrates
    the IMU. ``flight: ballistic`` averages the CoM's velocity by the IMU over the first 20 ms; from
    then on the CoM falls freely, and the base follows from the joints. That does not drift, but it
    also does not notice a push.

    It starts at the first sample, with the robot standing on level ground: the world's origin is
    midway between the soles, and x is the heading of the feet; for feet of one contact point it is
    the heading of the pattern in which they stand.

    A derived class says how the orientation is corrected and how far each point is trusted.
    """

    Params = InertialParameters
    needs = ("floating base", "imu", "feet")
    starts_level: ClassVar[bool]
    """Whether the first tilt is taken from the contact points; otherwise from the accelerometer."""

    params: InertialParameters

    imu = Input(ImuReading, text="gyroscope, and accelerometer as the mean over the tick")
    joints = Input(JointState, text="joint angles and velocities")
    contacts = Input(ContactState, text="which points carry load; a short hold serves best")
    base = Output(BaseState, text="pose and velocity of the base")
    estimate = State(BaseEstimate, text="the filter")
    learning = State(BiasSamples, text="what a bias is learnt from")

    @abstractmethod
    def make_call(self, estimator: Estimator) -> KernelCall:
        """What takes a sample, corrects the orientation, weighs the points, and publishes."""

    def setup(self) -> None:
        robot, estimate, base = self.robot, self.estimate, self.base
        kinematics, n, n_joints = ContactKinematics(robot), len(robot.contacts), len(robot.joints)
        sample = Sample(
            self.imu.angular_velocity, self.imu.specific_force, self.joints.velocity,
            np.zeros(3), np.zeros(3), np.zeros(n_joints),
        )  # fmt: skip
        points = StandingPoints(
            np.zeros((n, 3)), np.zeros((n, 3)), self.contacts.active, np.zeros(n),
            estimate.anchor, estimate.anchored,
        )  # fmt: skip
        measured = Measured(
            estimate.orientation, estimate.angular_velocity, self.joints.position,
            sample.joint_rates,
        )  # fmt: skip
        self.settings = Settings(*(np.zeros(1) for _ in Settings._fields))
        period = self.period
        tick = self.make_call(
            Estimator(
                sample,
                Filter(*(getattr(estimate, name) for name in Filter._fields)),
                Learning(*(getattr(self.learning, name) for name in Learning._fields)),
                Legs(kinematics.rigid, kinematics.contacts, measured, kinematics.seen, points),
                self.settings,
                Fixed(
                    period, min(period / 0.02, 1.0), max(round(0.03 / period), 1),
                    self.params.flight == "ballistic", self.starts_level,
                ),
                Scratch(*(np.zeros(size) for size in (3, 3, 3, 4, 3))),
                Base(*(getattr(base, name) for name in Base._fields)),
            )
        )  # fmt: skip
        self.kernel_calls = (tick,)
        self.on_parameters()

    def on_parameters(self) -> None:
        for name, value in zip(Settings._fields, self.settings, strict=True):
            value[0] = getattr(self.params, name)
