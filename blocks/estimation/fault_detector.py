"""Compares a legged robot's sensors and motors with each other, and warns of those that disagree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...mathematics.constants import GRAVITY
from ...mathematics.joint_feedback import expected_torques
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import product, solve_positive
from ...robots.description import RobotDescription
from ...robots.limb import leg_joints
from ...runtime.language.block import Block, Clock, Input, Metric, State
from ...runtime.language.parameters import Parameters
from ..signals import (
    ContactState,
    ContactSwitches,
    DynamicsTerms,
    FootLoad,
    ImuReading,
    JointCommand,
    JointState,
    Phase,
    PhaseState,
)
from .fault_detector_state import (
    FaultDetectorConstants,
    FaultDetectorParams,
    FaultDetectorScratch,
    FaultDetectorState,
    Stop,
    Suspect,
)
from .gross_errors import find_gross_errors, stop_text, weigh

_SLIGHT = 0.05
"""The share of a joint's peak torque that is added to its commanded torque."""
_SPREAD = 0.05
"""Points whose three moments of inertia, as shares of half their sum, have a smaller product are in a line, or nearly."""


class FaultDetector(Block):
    """Warns of a sensor or motor that disagrees with the others, from what a real robot measures.

    Each check is a law that two measurements must agree with. A difference d is summed up and forgotten with
    the time constant ``window`` T, x' = d - x / T, so that a steady one ends at T d. It may reach T times the check's
    ``..._error``, and in addition what a measurement that is ``lateness`` late gives: this times the change of
    what is measured, against its mean over T.

    * **Gyroscope.** Points that stand do not move. From their velocities u_i against the base, J_i q', follows the
      base's rate over its feet as that of a rigid body, -I^-1 sum r_i x u_i, with r_i from the points' mean and I
      their inertia as unit masses. It is the gyroscope's. Points stand that are in contact, have their
      switch closed, and may push by the phase, for ``settle_time``; three or more that are not in a line, no
      faster against each other than ``slip_speed``.
    * **Accelerometer.** At rest, with the measured specific force a of the base, the base rows b and joint rows j of
      the equations of motion are M_b a = J_b' f and M_j a = tau + J_j' f. The legs' torques tau give the
      forces f (as in ``FootLoadEstimator``), and these must push along a. Neither the estimated attitude nor the ground's slope is in
      it. Judged is what is lacking across the weight, along the base's x and y, over ``force_window``. A steady
      push from outside, or torques that are wrong, look the same.
    * **Torque.** A joint's measured torque is what its command asked for, within ``torque_error`` of it and of 5 %
      of its peak. Before lift-off at any time, afterwards at rest: hard landings and gains in flight make good
      drives differ by as much.
    * **Encoder.** The change of a joint's angle is the integral of its speed. A slip that both show is not found.
    * **Switches.** By the legs' torques the feet carry more than ``open_load`` weights, and no switch is closed
      for ``open_time``. One foot across an edge may stand so, and does not count.

    Most of it only warns, for a robot often survives what is found, and damping would make it fall. It ends the run, which puts the
    robot in damping, where a fall follows:

    * **Before lift-off** a suspect but an encoder ends squat and thrust (``suspects_end``): a robot that still stands need not jump. The
      gyroscope, by which it balances, ends the run whenever the feet stand, and switches that are all open end the stand, in which the estimate would
      take the robot for airborne.
    * An axis of the gyroscope differs by more than ``gross_rate`` from the base's rate over its feet before lift-off; in the thrust, where rates change by
      350 rad/s in a second and either may be late, by five times as much.
    * A reading of the gyroscope beyond ``largest_rate``, which is beyond the range of any, ends the run at once, in every phase: in degrees per second
      a thrust's 2.7 rad/s are 155, and within 4 ms the base would turn three times as fast.
    * In the stand, while joints are slow, the accelerometer differs by more than ``gross_gravity`` from 1 g away from the plane of the points that
      carry the robot. Neither the estimated attitude nor the switches are in it; the slope of the ground is, so it is a coarse check.
    * In squat and thrust, and after touchdown, while points stand and the legs' torques carry more than ``open_load``, the accelerometer reads less than ``gross_push`` of
      what they push, along the same normal. In healthy runs it read 0.56 to 1.5 times as much.
    * In squat and thrust, under the same load, the accelerometer's x or y differs from what the legs push by more than ``gross_across`` weights, and fits with
      the other sign.
    * Before lift-off the plane of the points that stand has turned by more than ``gross_lean`` in the estimate since the robot first stood. Ground does not
      turn; the attitude is wrong, as by a bias of the gyroscope that is below ``gross_rate``, and the robot is pushed over an edge of its feet. With a suspected encoder it is not judged.
    * In squat and thrust no switch is closed for ``gross_open`` under feet that carry more than ``open_load``: its lift-off would be missed.
    * In flight, from 50 ms before the touchdown is due, the accelerometer's z reads more than ``gross_landing`` while no switch is closed: the robot has landed
      with switches that stay open, and its legs still hold the pose of the flight.
    * After touchdown the base leans over by more than ``falling_rate`` for ``falling_time``, 40 ms after the impact or later: the robot
      falls, whatever the cause, and damped legs break less.

    Gravity must be off for ``gross_time``, what has no time of its own for ``lateness`` more. The sign of the accelerometer's x and y cannot be seen in an upright stand: turn the robot by hand
    (``aloft bring-up`` asks for it).

    The first suspect is kept in the state, in
    the metrics ``suspect`` and ``suspect_time_s`` and in the result's warnings. ``SafetyMonitor`` judges what must end a run.
    ``largest_disagreement`` is how near a run came to a warning, as a share of the limit.

    Not found are motors whose torque constant is less than the drive believes, for their current is as commanded; what begins in the
    air before the robot stands again; and sensors that are late while nothing moves.
    """

    Params = FaultDetectorParams
    Constants = FaultDetectorConstants
    Scratch = FaultDetectorScratch
    needs = ("floating base", "feet")
    params: FaultDetectorParams
    constants: FaultDetectorConstants
    imu = Input(ImuReading, text="the IMU's readings")
    joints = Input(JointState, text="the measured joints")
    terms = Input(DynamicsTerms, text="the model's terms")
    load = Input(FootLoad, text="the load on each foot, by the legs' torques")
    contacts = Input(ContactState, text="points in contact")
    switches = Input(ContactSwitches, text="the raw switches")
    phase = Input(PhaseState, text="the phase the robot is in")
    command = Input(JointCommand, text="command to the drives")
    state = State(FaultDetectorState, text="sums, and the first suspect")

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Return the number of joints of the longest leg."""
        assert robot is not None
        return {"n_leg_joints": leg_joints(robot).shape[1]}

    def setup(self) -> None:
        robot, constants = self.robot, self.constants
        constants.foot_of_point[:] = robot.foot_of_contact()
        constants.leg_joints[:] = leg_joints(robot)
        constants.peak[:] = product(np.abs(robot.joint_to_motor).T, robot.motors.peak_torque)
        constants.weight = robot.weight

    def prepare(self) -> None:
        p, constants, period = self.params, self.constants, self.period
        constants.fading[:] = min(1.0, period / p.window), min(1.0, period / p.force_window)
        constants.settling = round(p.settle_time / period)
        constants.open_ticks = round(p.open_time / period)
        constants.gross_ticks[:] = (
            round((p.lateness + p.gross_time) / period), round(p.gross_time / period),
            round(p.gross_open / period), round(p.falling_time / period),
        )  # fmt: skip

    @kernel
    @staticmethod
    def step(
        imu: ImuReading,
        joints: JointState,
        terms: DynamicsTerms,
        load: FootLoad,
        contacts: ContactState,
        switches: ContactSwitches,
        phase: PhaseState,
        command: JointCommand,
        state: FaultDetectorState,
        params: FaultDetectorParams,
        constants: FaultDetectorConstants,
        scratch: FaultDetectorScratch,
        clock: Clock,
        period: float,
    ) -> bool:
        before, stopped = state.suspect, state.stop != Stop.NONE
        compare_encoders(joints, state, params, constants, period)
        find_standing(contacts, switches, phase, scratch)
        rigid = turn_over_feet(joints, terms, params.slip_speed, scratch)
        on_the_ground = phase.phase >= Phase.STAND and phase.phase <= Phase.THRUST
        if state.stop == Stop.NONE:
            find_gross_errors(
                rigid, imu, joints, terms, load, switches, phase, state, params, constants, scratch,
            )  # fmt: skip
        state.standing = state.standing + 1 if rigid else 0
        stands = state.standing > constants.settling
        compare_gyroscope(stands, imu, state, params, constants, scratch, period)
        rests = stands and is_slow(state, params.rest_speed)
        compare_torques(rests or on_the_ground, joints, state, params, constants)
        expected_torques(
            command.torque, command.stiffness, command.damping, command.position, command.velocity,
            joints.position, joints.velocity, constants.peak, state.expected,
        )  # fmt: skip
        if rests:
            weigh(imu, joints, terms, constants, scratch)
            compare_forces(state, params, constants, scratch)
        else:
            state.lacking[:] = 0.0
        compare_switches(load, switches, state, params, constants)
        state.started = True
        if before == Suspect.NONE and state.suspect != Suspect.NONE:
            state.tick = clock.tick
        ends: bool = not stopped and state.stop != Stop.NONE
        if ends:
            state.stop_tick = clock.tick
        return ends

    def on_event(self) -> None:
        self.request_stop(self._stop_reason())

    def metrics(self) -> Mapping[str, Metric]:
        """Return the first suspect, and how near the run came to one."""
        state = self.state
        result: dict[str, Metric] = {"largest_disagreement": float(state.share.max())}
        if state.suspect != Suspect.NONE:
            result["suspect"] = Suspect(int(state.suspect)).name.lower()
            result["suspect_time_s"] = self._time()
        if self.state.stop != Stop.NONE:
            result["stopped_for"] = Stop(int(self.state.stop)).name.lower()
            result["stopped_time_s"] = int(self.state.stop_tick) * self.context.clock.base_period
            result["success"] = False
            result["reason"] = f"{self.context.path}: {self._stop_reason()}"
        return result

    def warnings(self) -> Sequence[str]:
        """Describe the first suspect in words."""
        if self.state.suspect == Suspect.NONE:
            return ()
        return (f"from {self._time():g} s on: {self._reason()}",)

    def _time(self) -> float:
        return int(self.state.tick) * self.context.clock.base_period

    def _stop_reason(self) -> str:
        """Describe in words what ended the run."""
        suspect = "" if self.state.suspect == Suspect.NONE else self._reason()
        return stop_text(self.state, self.params, suspect)

    def _reason(self) -> str:
        """Describe the suspect in words, by its measured value and its limit."""
        suspect, value, p = Suspect(int(self.state.suspect)), float(self.state.value), self.params
        place, joints = int(self.state.place), self.robot.joints
        if suspect == Suspect.GYROSCOPE:
            return (
                f"the gyroscope's axis {'xyz'[place]} turns by {value / p.window:+.2f} rad/s otherwise than the base over the feet that "
                f"stand; gyroscope_error is {p.gyroscope_error:g} rad/s"
            )
        if suspect == Suspect.ACCELEROMETER:
            off = value / self.constants.weight * GRAVITY
            return (
                f"the accelerometer's axis {'xyz'[place]} is {off:+.2f} m/s^2 off the force of the legs, or something pushes the robot "
                f"steadily; acceleration_error is {p.acceleration_error * GRAVITY:.2f} m/s^2"
            )
        if suspect == Suspect.TORQUE:
            return (
                f"joint {joints[place].name}: its torque is {value:+.2f} N m off its command; torque_error is "
                f"{100.0 * p.torque_error:g} %"
            )
        if suspect == Suspect.ENCODER:
            return (
                f"joint {joints[place].name}: its angle has changed by {1e3 * value:+.0f} mrad otherwise than its speed says; "
                f"encoder_error is {p.encoder_error:g} rad/s"
            )
        return (
            f"no foot switch has been closed for {1e3 * p.open_time:g} ms under feet that carry more than "
            f"{100.0 * p.open_load:g} % of the weight"
        )


@kernel
def judge(state: FaultDetectorState, suspect: int, place: int, value: float, limit: float) -> None:
    """Note how far a disagreement is of its limit, and the first that is beyond."""
    if not limit > 0.0:
        return
    share = abs(value) / limit
    state.share[suspect] = max(state.share[suspect], share)
    if share > 1.0 and state.suspect == Suspect.NONE:
        state.suspect = suspect
        state.place = place
        state.value = value


@kernel
def allowance(error: float, change: float, params: FaultDetectorParams) -> float:
    """Return the largest sum that is allowed where the measured value is ``change`` off its mean; zero: not judged."""
    return error * params.window + params.lateness * abs(change) if error > 0.0 else 0.0


# The joints


@kernel
def compare_encoders(
    joints: JointState,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    period: float,
) -> None:
    """Compare the change of every angle with its speed."""
    fading = constants.fading[0]
    for k in range(joints.position.shape[0]):
        angle, speed = joints.position[k], joints.velocity[k]
        if state.started:
            state.slip[k] += angle - state.position[k] - period * speed - fading * state.slip[k]
            state.speed[k] += fading * (speed - state.speed[k])
            limit = allowance(params.encoder_error, speed - state.speed[k], params)
            judge(state, Suspect.ENCODER, k, state.slip[k], limit)
        else:
            state.speed[k] = speed
        state.position[k] = angle


@kernel
def compare_torques(
    judged: bool,
    joints: JointState,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
) -> None:
    """Compare every measured torque with what the command before asks for; begin anew where it is not ``judged``."""
    fading, late = constants.fading[0], params.lateness / params.window
    for k in range(joints.torque.shape[0]):
        expected = state.expected[k]
        state.level[k] += fading * (expected - state.level[k])
        state.asked[k] += fading * (abs(expected) - state.asked[k])
        if judged and state.started:
            state.missing[k] += fading * (joints.torque[k] - expected - state.missing[k])
            limit = params.torque_error * (state.asked[k] + _SLIGHT * constants.peak[k])
            if limit > 0.0:
                limit += late * abs(expected - state.level[k])
            judge(state, Suspect.TORQUE, k, state.missing[k], limit)
        else:
            state.missing[k] = 0.0


# The base over its feet


@kernel
def find_standing(
    contacts: ContactState,
    switches: ContactSwitches,
    phase: PhaseState,
    scratch: FaultDetectorScratch,
) -> None:
    """Find the points that stand by contact, switch and phase."""
    on_the_ground = phase.phase != Phase.FLIGHT and phase.phase != Phase.HANG
    for point in range(scratch.stands.shape[0]):
        touches = contacts.active[point] and switches.closed[point]
        scratch.stands[point] = on_the_ground and touches and phase.stance[point]


@kernel
def turn_over_feet(
    joints: JointState, terms: DynamicsTerms, slip_speed: float, scratch: FaultDetectorScratch
) -> bool:
    """Compute the base's rate from the points that stand; return whether there are enough, and do not slide."""
    mean, arm, moved = scratch.mean, scratch.arm, scratch.moved
    count, first = 0, terms.velocity.shape[0] - joints.velocity.shape[0]
    mean[:] = 0.0
    for point in range(arm.shape[0]):
        if scratch.stands[point]:
            count += 1
            for axis in range(3):
                speed = 0.0
                for k in range(joints.velocity.shape[0]):
                    speed += terms.contact_jacobian[point, axis, first + k] * joints.velocity[k]
                moved[point, axis] = speed
                arm[point, axis] = terms.contact_position[point, axis] - terms.base_position[axis]
                mean[0, axis] += arm[point, axis]
                mean[1, axis] += speed
    if count < 3:
        return False
    mean[:] /= count
    if not fit_rate(scratch):
        return False
    rate, off = scratch.turning[0], 0.0
    for point in range(arm.shape[0]):
        if scratch.stands[point]:
            x, y, z = arm[point, 0], arm[point, 1], arm[point, 2]
            u = moved[point, 0] + rate[1] * z - rate[2] * y
            v = moved[point, 1] + rate[2] * x - rate[0] * z
            w = moved[point, 2] + rate[0] * y - rate[1] * x
            off += u * u + v * v + w * w
    for axis in range(3):
        total = 0.0
        for k in range(3):
            total += terms.base_rotation[k, axis] * rate[k]
        scratch.turning[1, axis] = total
    return off < count * slip_speed * slip_speed


@kernel
def fit_rate(scratch: FaultDetectorScratch) -> bool:
    """Fit the rate of a rigid body to the points that stand; false where they are in a line.

    Leaves ``arm`` and ``moved`` less their means.
    """
    mean, arm, moved, inertia = scratch.mean, scratch.arm, scratch.moved, scratch.inertia
    rate = scratch.turning[0]
    inertia[:] = 0.0
    rate[:] = 0.0
    for point in range(arm.shape[0]):
        if scratch.stands[point]:
            for axis in range(3):
                arm[point, axis] -= mean[0, axis]
                moved[point, axis] -= mean[1, axis]
            x, y, z = arm[point, 0], arm[point, 1], arm[point, 2]
            u, v, w = moved[point, 0], moved[point, 1], moved[point, 2]
            inertia[0, 0] += y * y + z * z
            inertia[1, 1] += x * x + z * z
            inertia[2, 2] += x * x + y * y
            inertia[1, 0] -= x * y
            inertia[2, 0] -= x * z
            inertia[2, 1] -= y * z
            rate[0] -= y * w - z * v
            rate[1] -= z * u - x * w
            rate[2] -= x * v - y * u
    a, b, c = inertia[0, 0], inertia[1, 1], inertia[2, 2]
    d, e, f = inertia[1, 0], inertia[2, 0], inertia[2, 1]
    inertia[0, 1], inertia[0, 2], inertia[1, 2] = d, e, f
    half = 0.5 * (a + b + c)
    determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    if determinant < _SPREAD * half * half * half:
        return False
    solve_positive(inertia, rate)
    return True


@kernel
def compare_gyroscope(
    stands: bool,
    imu: ImuReading,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
    period: float,
) -> None:
    """Compare the gyroscope with the base's rate over its feet, while these stand."""
    fading, begins = constants.fading[0], state.standing == constants.settling + 1
    for axis in range(3):
        rate = imu.angular_velocity[axis]
        state.turn[axis] -= fading * state.turn[axis]
        state.rate[axis] = rate if begins else state.rate[axis] + fading * (rate - state.rate[axis])
        if stands:
            state.turn[axis] += period * (rate - scratch.turning[1, axis])
            limit = allowance(params.gyroscope_error, rate - state.rate[axis], params)
            judge(state, Suspect.GYROSCOPE, axis, state.turn[axis], limit)


# The weight over the feet


@kernel
def is_slow(state: FaultDetectorState, rest_speed: float) -> bool:
    """Check whether no joint moves fast for long."""
    slow = True
    for k in range(state.speed.shape[0]):
        slow = slow and abs(state.speed[k]) < rest_speed
    return slow


@kernel
def compare_forces(
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Judge the force across the weight that the legs lack."""
    for k in range(3):
        state.lacking[k] += constants.fading[1] * (scratch.lacking[k] - state.lacking[k])
    for axis in range(2):
        limit = params.acceleration_error * constants.weight
        judge(state, Suspect.ACCELEROMETER, axis, state.lacking[axis], limit)


@kernel
def compare_switches(
    load: FootLoad,
    switches: ContactSwitches,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
) -> None:
    """Count the ticks in which the feet carry load and no switch is closed."""
    carried, closed = 0.0, False
    for foot in range(load.force.shape[0]):
        carried += load.force[foot]
    for point in range(switches.closed.shape[0]):
        closed = closed or bool(switches.closed[point])
    missing = not closed and carried > params.open_load * constants.weight
    state.open = state.open + 1 if missing else 0
    judge(state, Suspect.SWITCHES, 0, float(state.open), float(constants.open_ticks))
