"""Observer of a quadrotor's state: its IMU, corrected by a motion capture system."""

import math

from aloft import Block, Field, Input, Output, Parameters, Signal, State, live_parameter
from aloft.blocks.signals import BaseState, ImuReading, PoseMeasurement
from aloft.mathematics.elementary import atan2
from aloft.mathematics.kernel import kernel
from aloft.mathematics.rotations import from_euler, integrate, rotate, rotate_back, tilt, wrap, yaw
from aloft.runtime.language.context import Clock

GRAVITY = 9.81
PAST = 64
"""Estimates that are remembered."""
STEEPEST = math.radians(60.0)
"""Beyond this tilt a heading says little, and the measured one is not used."""


class Observed(Signal):
    """The observer's present and past estimates."""

    started = Field(dtype="bool", text="whether there was a first measurement")
    position = Field(3, unit="m", frame="world", text="base origin")
    velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    orientation = Field(4, text="quaternion x, y, z, w")
    gyro_bias = Field(3, unit="rad/s", frame="body", text="of the gyroscope")
    past_position = Field((PAST, 3), unit="m", frame="world", text="positions of the last ticks")
    past_heading = Field(PAST, unit="rad", frame="world", text="headings of the last ticks")
    past_tilt = Field(PAST, unit="rad", text="tilts of the last ticks")
    last = Field(dtype="int64", text="number of the last measurement that was used")
    last_time = Field(unit="s", text="when that was taken")


class ObserverScratch(Signal):
    """Scratch memory of one tick."""

    rate = Field(3, text="angular velocity without bias")
    force = Field(3, text="specific force in the world")
    turn = Field(3, text="a correction of the orientation, world")
    body = Field(3, text="the same in the body's frame")
    error = Field(3, text="measured less estimated position")
    quaternion = Field(4, text="an orientation")


class Observer(Block):
    """Integrates the IMU, and takes its drift off with places and headings measured from outside.

    In every tick p' = v, v' = R f + g, R' = R [w - b]x. A measurement is compared with the estimate of
    its own time, in which the error r of the position says with constant gains, all poles at
    ``bandwidth`` W, what else is wrong: p by 4 W r, v by 6 W^2 r, the tilt by 4 W^3 (f x r) / f^2 and the
    gyroscope's bias by a quarter of W of that, each for a second. So tilt is only corrected while there is
    a specific force f, and not in free fall. Headings are corrected at ``heading_rate``, unless the
    robot is tilted by more than 60 deg.

    It waits level for the first measurement. The accelerometer's bias is not estimated: it is a tilt.
    """

    class Params(Parameters):
        bandwidth: float = live_parameter(4.0, unit="rad/s", gt=0, text="of the corrections")
        heading_rate: float = live_parameter(2.0, unit="1/s", gt=0, text="of the heading")

    Scratch = ObserverScratch
    needs = ("robot", "imu")
    params: Params
    scratch: ObserverScratch
    imu = Input(ImuReading, text="gyroscope and accelerometer")
    pose = Input(PoseMeasurement, text="what is measured from outside")
    base = Output(BaseState, text="pose and velocity of the base")
    observed = State(Observed, text="the estimate")

    @kernel
    @staticmethod
    def step(
        imu: ImuReading, pose: PoseMeasurement, base: BaseState, observed: Observed,
        params: Params, scratch: ObserverScratch, clock: Clock, period: float,
    ) -> None:  # fmt: skip
        if pose.number > 0 and not observed.started:
            observed.started = True
            observed.last, observed.last_time = pose.number, pose.time
            observed.position[:] = pose.position
            # At rest the accelerometer says what is level.
            x, y, z = imu.specific_force[0], imu.specific_force[1], imu.specific_force[2]
            scratch.turn[0] = atan2(y, z)
            scratch.turn[1] = atan2(-x, math.sqrt(y * y + z * z))
            scratch.turn[2] = pose.heading
            from_euler(scratch.turn, observed.orientation)
        if observed.started:
            scratch.rate[:] = imu.angular_velocity - observed.gyro_bias
            integrate(observed.orientation, scratch.rate, 0.5 * period, scratch.quaternion)
            rotate(scratch.quaternion, imu.specific_force, scratch.force)
            integrate(scratch.quaternion, scratch.rate, 0.5 * period, observed.orientation)
            observed.position[:] += period * observed.velocity
            observed.velocity[:] += period * scratch.force
            observed.velocity[2] -= period * GRAVITY
        here, taken = clock.tick % PAST, round(pose.time / clock.base_period)
        remember(observed, here)
        if pose.number > observed.last and 0 <= clock.tick - taken < PAST:
            correct(pose, observed, params, scratch, taken % PAST)
            remember(observed, here)
        base.position[:] = observed.position
        base.orientation[:] = observed.orientation
        if not observed.started:
            base.orientation[3] = 1.0
        base.linear_velocity[:] = observed.velocity
        base.angular_velocity[:] = imu.angular_velocity - observed.gyro_bias


@kernel
def remember(observed: Observed, here: int) -> None:
    """Note the estimate as that of the present tick."""
    observed.past_position[here, :] = observed.position
    observed.past_heading[here] = yaw(observed.orientation)
    observed.past_tilt[here] = tilt(observed.orientation)


@kernel
def correct(
    pose: PoseMeasurement, observed: Observed, params: Observer.Params,
    scratch: ObserverScratch, then: int,
) -> None:  # fmt: skip
    """Correct the estimate by a measurement that was taken in the remembered tick ``then``."""
    share = min(pose.time - observed.last_time, 0.25 / params.bandwidth)
    observed.last, observed.last_time = pose.number, pose.time
    w, error, turn = params.bandwidth, scratch.error, scratch.turn
    error[:] = pose.position - observed.past_position[then]
    observed.position[:] += 4.0 * w * share * error
    observed.velocity[:] += 6.0 * w**2 * share * error
    force = scratch.force
    size = max(force @ force, 0.25 * GRAVITY**2)
    turn[0] = force[1] * error[2] - force[2] * error[1]
    turn[1] = force[2] * error[0] - force[0] * error[2]
    turn[2] = force[0] * error[1] - force[1] * error[0]
    turn[:] = 4.0 * w**3 * share / size * turn
    if observed.past_tilt[then] < STEEPEST:
        turn[2] += params.heading_rate * share * wrap(pose.heading - observed.past_heading[then])
    rotate_back(observed.orientation, turn, scratch.body)
    observed.gyro_bias[:] -= 0.25 * w * scratch.body
    integrate(observed.orientation, scratch.body, 1.0, observed.orientation)
