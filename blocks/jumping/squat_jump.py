"""A squat jump as a motion of the whole body: squat, thrust, flight, landing, recovery.

In the squat the lean of the torso is prescribed. From the thrust on the pitching momentum is
prescribed instead, and the torso swings as that demands. The momentum at lift-off is found by
integrating the motion, so that the torso lands as it should; a torso held upright in the thrust
would leave the ground with a spin, and fall. Roll and yaw of the torso stay prescribed while the
feet stand, because a thigh that is level has the yaw and roll axes of its hip in line.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...mathematics.interpolation import minimum_jerk, quintic
from ...planner.library.jump_table import JumpTable
from ...robots.description import RobotDescription
from ...robots.pinocchio_model import PinocchioModel, build_pinocchio_model
from ...runtime.language.parameters import parameter
from .guided_motion import (
    GuidedBody,
    GuidedMotion,
    GuidedParameters,
    GuidedReference,
    MotionRecorder,
    check_limits,
)


class SquatJumpParameters(GuidedParameters):
    """A jump. Drops and depths are heights of the centre of mass below that in standing."""

    rise: float = parameter(
        0.09, unit="m", gt=0.0, le=1.0, text="apex of the centre of mass above standing"
    )
    distance: float = parameter(
        0.0, unit="m", ge=-1.0, le=1.0, text="distance of the landing ahead of the start"
    )
    lean: float = parameter(
        0.8, unit="rad", ge=0.0, le=1.3, text="forward pitch of the torso in the squat"
    )
    touchdown_pitch: float = parameter(
        -0.06, unit="rad", ge=-0.5, le=0.5, text="forward pitch of the torso at touchdown"
    )
    squat_depth: float = parameter(
        0.094, unit="m", gt=0.0, le=0.5, text="bottom of the squat below standing"
    )
    lift_off_drop: float = parameter(
        0.029, unit="m", ge=-0.1, le=0.3, text="height at lift-off below standing"
    )
    touchdown_drop: float = parameter(
        0.009, unit="m", ge=-0.1, le=0.3, text="height at touchdown below standing"
    )
    landing_depth: float = parameter(
        0.06,
        unit="m",
        ge=0.0,
        le=0.5,
        text="depth below standing at which the landing comes to rest",
    )
    unloading: float = parameter(
        0.7, ge=0.0, le=1.0, text="share of the weight taken off the feet at lift-off"
    )
    settle_time: float = parameter(
        0.1, unit="s", gt=0.02, le=0.5, text="from lift-off to the legs' landing posture"
    )
    stand_time: float = parameter(
        0.4, unit="s", gt=0.0, text="standing, for the estimator to settle"
    )
    squat_time: float = parameter(0.5, unit="s", gt=0.1, text="going down")
    pause_time: float = parameter(0.15, unit="s", gt=0.0, text="waiting at the bottom")
    landing_time: float = parameter(0.35, unit="s", gt=0.05, text="coming to rest")
    recover_time: float = parameter(0.6, unit="s", gt=0.05, text="rising to standing")


class SquatJumpReference(GuidedReference):
    """A squat, thrust, flight and landing of the whole body, planned from a few numbers.

    It serves any robot whose feet stand level in its standing pose and that has joints enough to
    move its centre of mass and base with all feet on the ground: bipeds with line or flat feet,
    quadrupeds with point feet. The defaults are BRUCE's.

    The take-off speed is that of a ballistic rise, V^2 = 2 g (rise + lift_off_drop); the thrust
    goes from the squat's bottom to lift-off with, over u from 0 to 1 in its time T,

        v(u) = V (3 u^2 - 2 u^3) - unloading g T (u^3 - u^2),

    so that it begins without a jerk and ends with nearly unloaded feet. All joints follow from
    the feet, the centre of mass and the pitching momentum (see ``guided_motion``); the momentum
    at lift-off is solved for so that the torso touches down at ``touchdown_pitch``. Leaving the
    ground early, well before the legs are straight and with the torso still leaning, is what
    keeps the hips slow: their speed, not torque, limits the height.

    Torque follows its command with a delay, so acceleration and the rate of angular momentum, which
    are fed forward, are published ``lead`` ahead of time.

    The plan is made at load (about 0.2 s) and read by the time since the run began; after its end
    the reference stands still. The block knows nothing of what the robot really does, plans no
    lateral jump and no twist, and leaves forces and torque limits to the controller. The load
    report names a robot with too few joints; ``setup`` raises ``BlockError`` where a joint would
    exceed its limit or a motor its speed.
    """

    Params = SquatJumpParameters
    params: SquatJumpParameters

    def make_table(self) -> JumpTable:
        """Compute the squat, the jump and the landing."""
        return _plan(self.robot.model_dump_json(), self.params)

    def setup(self) -> None:
        super().setup()
        self.hold = self.period


@lru_cache(maxsize=8)
def _plan(robot: str, task: SquatJumpParameters) -> JumpTable:
    """Plan for a robot given as JSON, once for all runs of a process."""
    description = RobotDescription.model_validate_json(robot)
    return plan_squat_jump(build_pinocchio_model(description), description, task)


def plan_squat_jump(
    built: PinocchioModel, robot: RobotDescription, task: SquatJumpParameters
) -> JumpTable:
    """Plan the whole jump, from standing to standing.

    Raises:
        BlockError: the legs or the motors cannot do it; the message says which, and what to ask
            for instead.
    """
    body = GuidedBody(built, robot)
    table = MotionRecorder(body, body.standing(robot.standing_position))
    jump = _Jump(task, body, table.q)
    table.run(task.stand_time, jump.rest)
    table.run(task.squat_time, jump.squat)
    table.run(task.pause_time, jump.pause)
    bottom, start = table.q, table.now
    momentum = _lift_off_momentum(jump, body, bottom, start)
    table.run(jump.thrust_time, lambda t: jump.thrust(t, momentum))
    lift_off = table.now
    table.run(jump.flight_time, lambda t: jump.flight(t, momentum))
    touchdown = table.now
    pitch = body.pitch(table.q)
    table.run(task.landing_time, lambda t: jump.landing(t, pitch))
    recover = table.now
    table.run(task.recover_time, jump.recover)
    columns = {name: np.array(rows) for name, rows in table.rows.items()}
    check_limits(robot, columns)
    return JumpTable(
        np.array(table.time), columns, task.stand_time, start, lift_off, touchdown, recover
    )


def _lift_off_momentum(jump: _Jump, body: GuidedBody, bottom: Array, start: float) -> float:
    """Find the pitching momentum at lift-off with which the torso lands as asked, by secant steps."""

    def error(momentum: float) -> float:
        trial = MotionRecorder(body, bottom)
        trial.now = start
        trial.run(jump.thrust_time, lambda t: jump.thrust(t, momentum), keep=False)
        trial.run(jump.flight_time, lambda t: jump.flight(t, momentum), keep=False)
        return body.pitch(trial.q) - jump.task.touchdown_pitch

    last, momentum = 0.0, 0.005
    last_error, present = error(last), error(momentum)
    for _ in range(8):
        if abs(present) < 1e-4:
            break
        slope = (present - last_error) / (momentum - last)
        last, last_error = momentum, present
        momentum -= present / slope
        present = error(momentum)
    return momentum


class _Jump:
    """The motion of every phase, as functions of the time in it."""

    def __init__(self, task: SquatJumpParameters, body: GuidedBody, q: Array) -> None:
        self.task = task
        self.feet = body.feet(q)
        self.home = body.com(q)
        standing = float(self.home[2])
        self.low = standing - task.squat_depth
        self.high = standing - task.lift_off_drop
        self.touch = standing - task.touchdown_drop
        self.rest_height = standing - task.landing_depth
        self.speed = math.sqrt(2.0 * GRAVITY * (task.rise + task.lift_off_drop))
        # v(u) = V (3u^2 - 2u^3) - unloading g T (u^3 - u^2): its integral is the stroke.
        quarter, stroke = task.unloading * GRAVITY / 12.0, self.high - self.low
        half = 0.5 * self.speed
        if quarter > 0.0:
            self.thrust_time = (math.sqrt(half * half + 4.0 * quarter * stroke) - half) / (
                2.0 * quarter
            )
        else:
            self.thrust_time = stroke / half
        fall = math.sqrt(2.0 * GRAVITY * (task.rise + task.touchdown_drop))
        self.flight_time = (self.speed + fall) / GRAVITY
        self.fall = fall
        self._aim()
        self._plan_legs()

    def _aim(self) -> None:
        """Compute the forward take-off speed, and the forward offset of the squat that it needs.

        At lift-off the body has moved by half the thrust's duration times its speed. At touchdown
        it is behind its feet by the capture distance v sqrt(z/g), which stops it. The offset of the
        squat keeps the centre of pressure in the middle of the feet, within 30 mm.
        """
        height = 0.5 * (self.low + self.high)
        lift = GRAVITY + self.speed / self.thrust_time
        way = 0.5 * self.thrust_time + self.flight_time + math.sqrt(self.touch / GRAVITY)
        lead = height / (self.thrust_time * lift) - 0.15 * self.thrust_time
        speed = self.task.distance / (way + lead)
        self.offset = min(max(lead * speed, -0.03), 0.03)
        self.forward = (self.task.distance - self.offset) / way

    def _plan_legs(self) -> None:
        """Plan the feet relative to the centre of mass in flight: from lift-off to landing posture."""
        self.bottom = np.array([self.offset, 0.0, self.low])
        self.take_off = np.array([self.forward, 0.0, self.speed])
        travel = 0.5 * self.thrust_time * self.forward
        self.lift_off_com = np.array([self.offset + travel, 0.0, self.high])
        self.touch_com = np.array(
            [self.offset + travel + self.flight_time * self.forward, 0.0, self.touch]
        )
        landed = self.feet + np.array([self.task.distance, 0.0, 0.0])
        start, end = self.feet - self.lift_off_com, landed - self.touch_com
        push = np.array([0.0, 0.0, self.task.unloading * GRAVITY])
        self.legs = [
            [
                quintic(
                    self.task.settle_time,
                    (float(start[i, k]), -float(self.take_off[k]), float(push[k])),
                    (float(end[i, k]), 0.0, 0.0),
                )
                for k in range(3)
            ]
            for i in range(self.feet.shape[0])
        ]

    def _motion(self, com: Array) -> GuidedMotion:
        return GuidedMotion(
            com, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), (False, False, False),
            np.zeros(self.feet.shape),
        )  # fmt: skip

    def rest(self, t: float) -> GuidedMotion:
        """Stand still."""
        return self._motion(self.home)

    def squat(self, t: float) -> GuidedMotion:
        """Go down and lean forward, with minimum jerk."""
        motion = self._rise_or_sink(self.home, self.bottom, t / self.task.squat_time,
                                    self.task.squat_time)  # fmt: skip
        rate = minimum_jerk(t / self.task.squat_time)[1] / self.task.squat_time
        motion.rotation = np.array([0.0, rate * self.task.lean, 0.0])
        return motion

    def pause(self, t: float) -> GuidedMotion:
        """Wait at the bottom."""
        return self._motion(self.bottom)

    def thrust(self, t: float, momentum: float) -> GuidedMotion:
        """Go up, while the pitching momentum grows to that of lift-off."""
        total = self.thrust_time
        u = t / total
        share, rate, way = 3.0 * u**2 - 2.0 * u**3, 6.0 * u * (1.0 - u), u**3 - 0.5 * u**4
        brake = np.array([0.0, 0.0, -self.task.unloading * GRAVITY])
        motion = self._motion(
            self.bottom + total * way * self.take_off + total**2 * (u**4 / 4 - u**3 / 3) * brake
        )
        motion.com_velocity = share * self.take_off + total * (u**3 - u**2) * brake
        motion.com_acceleration = rate / total * self.take_off + (3.0 * u**2 - 2.0 * u) * brake
        motion.by_momentum = (False, True, False)
        motion.rotation = np.array([0.0, share * momentum, 0.0])
        motion.rotation_rate = np.array([0.0, rate / total * momentum, 0.0])
        return motion

    def flight(self, t: float, momentum: float) -> GuidedMotion:
        """Fly, while the legs go to their landing posture."""
        fall = np.array([0.0, 0.0, -GRAVITY])
        motion = self._motion(self.lift_off_com + t * self.take_off + 0.5 * t**2 * fall)
        motion.com_velocity = self.take_off + t * fall
        motion.com_acceleration = fall
        motion.by_momentum = (True, True, True)
        motion.rotation = np.array([0.0, momentum, 0.0])
        motion.flying = True
        motion.foot_velocity = np.tile(motion.com_velocity, (self.feet.shape[0], 1))
        if t < self.task.settle_time:
            motion.foot_velocity += [[leg.velocity(t) for leg in foot] for foot in self.legs]
        return motion

    def landing(self, t: float, pitch: float) -> GuidedMotion:
        """Go down to rest over the feet, while the torso turns upright from ``pitch``."""
        duration = self.task.landing_time
        speed = np.array([self.forward, 0.0, -self.fall])
        goal = np.array([self.task.distance, 0.0, self.rest_height])
        # A quintic with an initial velocity overshoots unless its duration is this short.
        stop = min(duration, 2.5 * (float(self.touch_com[2]) - self.rest_height) / self.fall)
        times = (duration, duration, max(stop, 0.02))
        paths = [
            quintic(
                times[k],
                (float(self.touch_com[k]), float(speed[k]), 0.0),
                (float(goal[k]), 0.0, 0.0),
            )
            for k in range(3)
        ]
        motion = self._motion(goal)
        for k, path in enumerate(paths):
            if t < times[k]:
                motion.com[k] = path.position(t)
                motion.com_velocity[k] = path.velocity(t)
                motion.com_acceleration[k] = path.acceleration(t)
        rate = minimum_jerk(t / duration)[1] / duration
        motion.rotation = np.array([0.0, -rate * pitch, 0.0])
        return motion

    def recover(self, t: float) -> GuidedMotion:
        """Go up to standing height, with minimum jerk."""
        low = np.array([self.task.distance, 0.0, self.rest_height])
        high = np.array([self.task.distance, 0.0, float(self.home[2])])
        duration = self.task.recover_time
        return self._rise_or_sink(low, high, t / duration, duration)

    def _rise_or_sink(
        self, start: Array, end: Array, share: float, duration: float
    ) -> GuidedMotion:
        way, rate, bend = minimum_jerk(share)
        motion = self._motion(start + way * (end - start))
        motion.com_velocity = rate / duration * (end - start)
        motion.com_acceleration = bend / duration**2 * (end - start)
        return motion
