"""Estimates the base's pose and velocity by an invariant Kalman filter with contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.constants import GRAVITY
from ...mathematics.invariant_filter import error_transition
from ...robots.contact_kinematics import (
    ContactKinematics,
    Measured,
    contact_motion,
    differentiate_contacts,
)
from ...robots.description import RobotDescription
from ...robots.kinematics import ball_feet
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters
from ..signals import BaseState, ContactState, EstimatorHealth, ImuReading, JointState
from .invariant_estimate import InvariantEstimate, InvariantFilterParameters
from .invariant_records import Base, Estimate, Health, Points, Samples, Tuning, Work
from .invariant_steps import take_samples, use_contacts


def tracked_points(robot: RobotDescription) -> tuple[Array, Array]:
    """The points of the feet that stand still on the ground, and their heights above it.

    A foot that rolls over its toe by the angle a moves the centre of the toe's rubber, of radius r, by
    r a. The point of the foot that was lowest moves by r (a - sin a) only, a hundredth of that. So the
    filter tracks this point. A foot that is a ball has no such point: there it is the centre.

    Returns:
        (n_contacts, 3) [m, link frame] and (n_contacts,) [m].
    """
    points = np.array([contact.position for contact in robot.contacts], np.float64).reshape(-1, 3)
    heights = np.zeros(len(robot.contacts))
    for ball in ball_feet(robot):
        points[ball.point], heights[ball.point] = ball.centre, ball.radius
    return points, heights


class InvariantKalmanFilter(KernelBlock):
    """A contact-aided right-invariant extended Kalman filter (Hartley et al. 2020).

    Same ports as ``StateEstimator``: ``set: {estimator.use: blocks.InvariantKalmanFilter}``.

    **State.** X = (R, v, p, d_1 .. d_N) on SE_{2+N}(3): the base's orientation, velocity and
    position and the contact points that stand on the ground; the biases of gyroscope and
    accelerometer; and the offsets of the joint encoders, which limit the accuracy on a robot whose
    offsets are larger than its encoder noise. The error is xi = log(X_est X^-1).

    **Prediction.** The state is propagated by the IMU, as in ``StateEstimator``, and the covariance
    by a transition that does not depend on the trajectory (``invariant_propagation``). In flight
    there is only the prediction.

    **Contacts.** A point that is reported active, while the IMU measures support, is added to the
    state at the position that leg kinematics measure: the point of the foot that is lowest while the
    foot is flat, or the centre of a foot that is a ball. From then on it stands still except for the
    process noise ``contact_noise`` of the point and that of its foot,
    sqrt(slide_noise^2 + (impact_slide (|f| - g))^2), because feet slide a little at impacts and
    hard pushes. The measurement update is R h(q) + p - d = 0. If a residual is too unlikely
    (``gate``, chi-squared with three degrees of freedom) the point has slipped or lifted: it is
    removed from the state and added again at its present position, so that nothing is learnt from
    it. While all points are rejected, process noise is added to the velocity until one is accepted.

    **Ground.** With ``level`` all points that stand are at one height, with ``flat`` at the height
    zero of the start; ``unknown`` assumes nothing. Errors of the height are correlated in time, so
    the heights count as one measurement per ``ground_time``, not per tick.

    **Saturation.** A sample at the end of the given range is a bound, not a value. Its axis has the
    standard deviation ``saturated_rate`` or ``saturated_force``, so the covariance grows as it
    should, and other measurements get more weight. A rate that is saturated in flight is not known
    at all; ``health`` reports that.

    It starts at the first sample, with the robot standing on level ground: the world's origin is
    midway between the soles and x is the heading of the feet. Yaw and horizontal position drift
    from jump to jump. The block never waits and raises no errors in a run.
    """

    Params = InvariantFilterParameters
    needs = ("floating base", "imu", "feet")
    params: InvariantFilterParameters

    imu = Input(ImuReading, text="gyroscope, and accelerometer as the mean over the tick")
    joints = Input(JointState, text="joint angles and velocities")
    contacts = Input(ContactState, text="which points carry load; a short hold serves best")
    base = Output(BaseState, text="pose and velocity of the base")
    health = Output(EstimatorHealth, text="standard deviations of the estimate")
    estimate = State(InvariantEstimate, text="the filter")

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """The vectors of the state and the size of the error."""
        assert robot is not None
        n = len(robot.contacts)
        return {"n_vectors": 2 + n, "n_errors": 15 + 3 * n + len(robot.joints)}

    def setup(self) -> None:
        """The robot's kinematics, constant matrices and scratch memory."""
        robot, estimate = (
            self.robot,
            Estimate(*(getattr(self.estimate, name) for name in Estimate._fields)),
        )
        seen, points = ContactKinematics(robot), len(robot.contacts)
        joints, size = len(robot.joints), self.estimate.covariance.shape[0]
        tuning, work = self._tuning(), self._work(points, size, joints)
        foot = np.array(robot.foot_of_contact(), np.int64)
        samples = Samples(*(np.zeros(n) for n in (3, 3, 6, joints, joints)))
        health = Health(*(getattr(self.health, name) for name in Health._fields))
        tracked, radius = tracked_points(robot)
        rolling = seen.contacts._replace(centre=tracked)
        self.kernel_calls = (
            KernelCall(
                take_samples, self.imu.angular_velocity, self.imu.specific_force,
                self.joints.position, foot, estimate, tuning, samples, work, health,
            ),
            KernelCall(
                contact_motion, seen.rigid, seen.contacts,
                Measured(
                    estimate.orientation, estimate.angular_velocity, samples.angles,
                    np.zeros(joints),
                ),
                seen.seen,
            ),
            KernelCall(
                differentiate_contacts, seen.rigid, rolling, seen.centres, seen.jacobians
            ),
            KernelCall(
                use_contacts, self.contacts.active, estimate, tuning, samples,
                Points(
                    foot, radius, seen.points, seen.centres, seen.jacobians, seen.soles,
                    seen.forward, seen.heading_levers,
                ),
                work, health, Base(*(getattr(self.base, name) for name in Base._fields)),
            ),
        )  # fmt: skip
        self.seen = seen
        """What the legs' kinematics see, between the third call and the last."""

    def _tuning(self) -> Tuning:
        """The parameters as kernels take them."""
        params = self.params
        given = {name: getattr(params, name, None) for name in Tuning._fields[:-3]}
        numbers = [math.inf if value is None else float(value) for value in given.values()]
        ground = params.ground
        return Tuning._make([*numbers, ground == "level", ground == "flat", self.period])

    def _work(self, points: int, size: int, joints: int) -> Work:
        """The constant transition, and scratch memory."""
        transition = np.zeros((size, size))
        error_transition(GRAVITY, self.period, transition)
        shapes: tuple[tuple[int, ...], ...] = (
            (size, 6), (size, 6), (size, size), (size,), (3, size), (3, size), (size, 3),
            (size, 3), (3, 3), (3, 3), (3,), (3, 3), (3, 3), (3, 3), (2 + points, 3), (3, joints),
            (3,), (3,), (3,), (4,), (4,), (3,), (joints,),
        )  # fmt: skip
        work = Work._make([
            transition, *(np.zeros(shape) for shape in shapes), np.zeros(points, np.bool_),
            np.zeros(points, np.int64),
        ])  # fmt: skip
        work.place_noise[...] = self.params.kinematics_noise**2 * np.eye(3)
        return work
