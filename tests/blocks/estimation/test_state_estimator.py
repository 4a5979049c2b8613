"""The estimator against motions known exactly, and in the simulator with the standard noise."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.estimation.complementary_filter import ComplementaryFilter
from aloft.blocks.estimation.state_estimator import StateEstimator
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.mathematics import rotations
from aloft.robots import five_joint_leg
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

from ...simulator_settings import grouped
from ...turns import quaternion_of, turn_between

ROBOT = find_robot("bruce")
LEGS = [five_joint_leg.read_leg(ROBOT, foot) for foot in range(2)]
PERIOD = 0.002
STANDING_HEIGHT = 0.3796


class Motion:
    """A base motion given as functions of time, with the feet where ``feet`` says, and what
    perfect sensors read of it."""

    def __init__(self, position, attitude, feet, heading=lambda time: 0.0, rise=0.0):
        self.position, self.attitude, self.feet = position, attitude, feet
        self.heading, self.rise = heading, rise

    def joints(self, time):
        matrix = np.empty((3, 3))
        rotations.to_matrix(quaternion_of(self.attitude(time)), matrix)
        joints, heading = np.empty(10), self.heading(time)
        line = matrix.T @ [np.cos(heading), np.sin(heading), self.rise]
        line /= np.linalg.norm(line)
        for leg, foot in zip(LEGS, self.feet(time), strict=True):
            out = np.empty(5)
            sole = matrix.T @ (foot - self.position(time))
            level = five_joint_leg.LEVEL
            assert five_joint_leg.inverse(leg, sole, line, 0.0, 0.0, level, out)[0]
            joints[list(leg.joints)] = out
        return joints

    def velocity(self, time, step=1e-5):
        return (self.position(time + step) - self.position(time - step)) / (2 * step)

    def rate(self, time, step=1e-5):
        before, after = (quaternion_of(self.attitude(time + d)) for d in (-step, step))
        inverse, product, out = np.empty(4), np.empty(4), np.empty(3)
        rotations.conjugate(before, inverse)
        rotations.multiply(inverse, after, product)
        rotations.logarithm(product, out)
        return out / (2 * step)

    def force(self, time):
        """The mean specific force over the tick that ends now."""
        change = (self.velocity(time) - self.velocity(time - PERIOD)) / PERIOD
        out = np.empty(3)
        middle = quaternion_of(self.attitude(time - PERIOD / 2))
        rotations.rotate_back(middle, change + np.array([0.0, 0.0, 9.81]), out)
        return out


class Run:
    """An estimator that follows a motion; ``gyro`` and ``accelerometer`` are added biases."""

    def __init__(
        self, motion, gyro=(0.0, 0.0, 0.0), accelerometer=(0.0, 0.0, 0.0), kind=StateEstimator,
        **params,
    ):  # fmt: skip
        self.motion = motion
        self.gyro, self.accelerometer = np.array(gyro), np.array(accelerometer)
        self.bench = BlockBench(kind, params, robot="bruce")
        self.tick = 0

    def to(self, end, active=True):
        motion = self.motion
        while self.tick * PERIOD < end - 1e-9:
            time = self.tick * PERIOD
            joints, after = motion.joints(time), motion.joints(time + 1e-6)
            self.bench.set("joints", position=joints, velocity=(after - joints) / 1e-6)
            self.bench.set(
                "imu",
                angular_velocity=motion.rate(time) + self.gyro,
                specific_force=motion.force(time) + self.accelerometer,
            )
            self.bench.set("contacts", active=active)
            self.bench.step()
            self.tick += 1
        return self

    def errors(self):
        """Position [m], velocity [m/s] and attitude [rad] errors."""
        time, base = (self.tick - 1) * PERIOD, self.bench.get("base")
        return (
            np.linalg.norm(base.position - self.motion.position(time)),
            np.linalg.norm(base.linear_velocity - self.motion.velocity(time)),
            np.linalg.norm(
                turn_between(base.orientation, quaternion_of(self.motion.attitude(time)))
            ),
        )


def smooth(start, end, time):
    """From 0 to 1 with zero velocity and acceleration at both ends."""
    u = min(max((time - start) / (end - start), 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


FEET = np.array([[0.0, -0.0758555, 0.0], [0.0, 0.0758555, 0.0]])
HIP_TO_SOLE = -0.0348
"""Where the base is over the middle of the soles when standing [m]."""

still = Motion(
    lambda t: np.array([HIP_TO_SOLE, 0.0, STANDING_HEIGHT]), lambda t: np.zeros(3), lambda t: FEET
)
squat = Motion(
    lambda t: np.array(
        [HIP_TO_SOLE, 0.01 * smooth(0.5, 1.0, t), 0.38 - 0.08 * smooth(0.5, 1.0, t)]
    ),
    lambda t: np.array([0.02, 0.4, 0.05]) * smooth(0.5, 1.0, t),
    lambda t: FEET,
)
SLOPE = (0.1, -0.08)
"""rad; of the ground ahead and to the left."""
LIFT_OFF = 0.6


def jump_height(time):
    """Stand, push off with 1 m/s at LIFT_OFF, fall freely."""
    push = 0.15
    u = min(max((time - LIFT_OFF + push) / push, 0.0), 1.0)
    pushed = 0.30 + push * (u**3 - 0.5 * u**4)
    after = max(time - LIFT_OFF, 0.0)
    return pushed + after - 0.5 * 9.81 * after**2


def jump_feet(time):
    """The feet rise with the base as soon as it has left, and are drawn up 3 cm."""
    after = max(time - LIFT_OFF, 0.0)
    lift = after - 0.5 * 9.81 * after**2 + 0.03 * smooth(0.0, 0.1, after)
    return FEET + np.array([0.0, 0.0, lift])


jump = Motion(
    lambda t: np.array([HIP_TO_SOLE, 0.0, jump_height(t)]),
    lambda t: np.array([0.0, 0.5, 0.0]) * max(t - LIFT_OFF, 0.0),
    jump_feet,
)

# The whole robot stiff in the air, so that its centre of mass falls exactly as its base does.
stiff_jump = Motion(
    jump.position,
    lambda t: np.zeros(3),
    lambda t: FEET + np.array([0.0, 0.0, jump_height(t) - jump_height(min(t, LIFT_OFF))]),
)


def test_starts_at_the_truth():
    position, velocity, attitude = Run(still).to(PERIOD).errors()
    assert position < 1e-12
    assert velocity < 1e-12
    assert attitude < 1e-12


def test_starts_from_the_feet_not_from_a_biased_accelerometer():
    bias = (0.1, -0.1, 0.1)
    assert Run(still, accelerometer=bias).to(PERIOD).errors()[2] < 1e-9


def test_stands_where_the_ground_leans_as_it_is_told():
    ahead, left = np.tan(SLOPE)
    feet = np.array([[x, y, ahead * x + left * y] for x, y, _ in FEET])
    motion = Motion(still.position, still.attitude, lambda t: feet, rise=ahead)
    assert max(Run(motion, slope=SLOPE).to(PERIOD).errors()) < 1e-3
    position, velocity, attitude = Run(motion, slope=SLOPE).to(0.4).errors()
    assert position < 1e-3
    assert velocity < 1e-6
    assert attitude < 1e-6
    assert Run(motion).to(0.4).errors()[2] > 0.1


@pytest.mark.parametrize("kind", [StateEstimator, ComplementaryFilter])
def test_follows_a_squat(kind):
    run = Run(squat, kind=kind)
    for end in np.arange(0.1, 1.2, 0.1):
        position, velocity, attitude = run.to(end).errors()
        assert position < 1e-3
        assert velocity < 3e-3
        assert attitude < 2e-3


def test_learns_the_biases_while_standing():
    run = Run(still, gyro=(0.01, -0.01, 0.005), accelerometer=(0.1, -0.1, 0.05)).to(0.6)
    estimate = run.bench.get("estimate")
    assert estimate.gyro_bias == pytest.approx([0.01, -0.01, 0.005], abs=4e-4)
    assert estimate.accelerometer_bias == pytest.approx([0.1, -0.1, 0.05], abs=5e-3)
    position, velocity, attitude = run.errors()
    assert position < 1e-3 and velocity < 1e-3 and attitude < 5e-4


def test_does_not_learn_from_a_motion():
    run = Run(squat).to(1.2)
    estimate = run.bench.get("estimate")
    assert np.abs(estimate.gyro_bias).max() < 1e-3
    assert np.abs(estimate.accelerometer_bias).max() < 0.02


@pytest.mark.parametrize(
    ("flight", "motion"), [("imu", jump), ("imu", stiff_jump), ("ballistic", stiff_jump)]
)
def test_flies_without_freezing(flight, motion):
    run = Run(motion, flight=flight).to(LIFT_OFF)
    position, velocity, attitude = run.to(LIFT_OFF + 0.2, active=False).errors()
    assert position < 2e-3
    assert velocity < 0.01
    assert attitude < 1e-3


def test_a_latch_that_holds_after_lift_off_does_not_spoil_the_flight():
    """The feet leave with the robot, but the contacts are said to last 30 ms longer."""

    def velocity_error(kind):
        run = Run(jump, kind=kind).to(LIFT_OFF)
        run.to(LIFT_OFF + 0.03, active=True)
        return run.to(LIFT_OFF + 0.1, active=False).errors()[1]

    assert velocity_error(StateEstimator) < 0.02
    assert velocity_error(ComplementaryFilter) > 0.2


def test_ballistic_flight_does_not_drift_and_imu_flight_does():
    """With an accelerometer bias that there was no time to learn."""

    def growth(flight):
        run = Run(stiff_jump, flight=flight).to(LIFT_OFF)
        run.bench.set("estimate", accelerometer_bias=[0.3, 0.0, 0.0])
        early = run.to(LIFT_OFF + 0.03, active=False).bench.get("base").linear_velocity[0]
        return abs(
            run.to(LIFT_OFF + 0.2, active=False).bench.get("base").linear_velocity[0] - early
        )

    assert growth("imu") == pytest.approx(0.3 * 0.17, rel=0.1)
    assert growth("ballistic") < 0.005


def test_recovers_from_a_wrong_velocity():
    """All contacts at odds with the prediction: the gate opens until they are believed."""
    run = Run(still).to(0.3)
    run.bench.set("estimate", velocity=[0.6, 0.0, 0.0])
    assert run.to(1.3).errors()[1] < 0.01


def test_a_slipping_foot_does_not_move_the_base():
    def feet(time):
        return FEET + np.array([[0.1 * max(time - 0.3, 0.0), 0.0, 0.0], [0.0, 0.0, 0.0]])

    run = Run(Motion(still.position, still.attitude, feet)).to(0.5)
    assert run.errors()[0] < 4e-3  # half of 20 mm if both feet counted the same


@pytest.mark.parametrize("level_ground", [True, False])
def test_a_twist_keeps_its_heading_after_landing(level_ground):
    """The feet's heading before the jump is not where they must point after it."""

    def yaw(time):
        return 0.4 * smooth(0.4, 0.6, time)

    def hop(time):
        return np.array([0.0, 0.0, 0.03 * smooth(0.4, 0.5, time) * (1.0 - smooth(0.5, 0.6, time))])

    def turned(vector, time):
        c, s = np.cos(yaw(time)), np.sin(yaw(time))
        return np.asarray(vector) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    twist = Motion(
        lambda t: turned(still.position(t), t) + hop(t),
        lambda t: np.array([0.0, 0.0, yaw(t)]),
        lambda t: turned(FEET, t) + hop(t),
        yaw,
    )
    run = Run(twist, gyro=(0.005, -0.005, 0.005), level_ground=level_ground).to(0.4)
    run.to(0.6, active=False)
    assert run.to(0.62).errors()[2] < 2e-3
    assert run.to(1.2).errors()[2] < 2e-3
    assert run.errors()[0] < 5e-3


def test_point_feet_stand_and_show_their_heading_by_their_pattern():
    """BRUCE on its toes alone, seen from a base that has turned since it stood."""
    toes = tuple(contact for contact in ROBOT.contacts if contact.name.endswith("toe"))
    bench = BlockBench(StateEstimator, robot=ROBOT.changed(contacts=toes))
    bench.set("joints", position=ROBOT.standing_position)
    bench.set("imu", specific_force=[0.0, 0.0, 9.81])
    bench.set("contacts", active=True)
    bench.step(200)
    base = bench.get("base")
    assert np.abs(base.linear_velocity).max() < 1e-6
    assert base.orientation == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-3)
    assert base.position[2] == pytest.approx(STANDING_HEIGHT, abs=2e-3)


def test_restores_exactly():
    run = Run(squat).to(0.7)
    half = run.bench.snapshot()
    first = run.to(0.75).bench.snapshot()
    run.bench.restore(half)
    run.tick -= 25
    assert run.to(0.75).bench.snapshot().state == first.state


def test_needs_a_robot():
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(StateEstimator, dimensions=dict(ROBOT.dimensions))


# In the simulator: an open-loop hop, that is joint targets followed by stiff drives.

STANDARD_NOISE = {
    "gyro_noise": 0.02, "gyro_bias": 0.01, "accelerometer_noise": 0.1, "accelerometer_bias": 0.1,
    "encoder_offset": 0.003, "joint_velocity_noise": 0.05, "switch_threshold": [0.5, 3.0],
    "switch_bounce": 0.002, "initial_attitude_error": 0.01, "latency": 0.002, "jitter": 0.0005,
    "random_start_phase": True,
}  # fmt: skip
HOP_START, HOP_END = 1.1, 1.23


def pose(flexion, lean=0.0):
    """Joint targets with flat feet under the robot: knee flexion and forward lean [rad]."""
    hip = np.interp(flexion, [0.0, 0.4, 0.8, 1.2, 1.6], [-0.04, 0.19, 0.42, 0.65, 0.9])
    return np.tile([0.0, hip + lean, 0.0, -flexion, flexion - hip], 2)


def hop(time):
    """Stand, squat with a lean, stretch fast, land a little flexed."""
    if time < HOP_START:
        u = smooth(0.5, HOP_START, time)
        return pose(0.8 + 0.7 * u, 0.55 * u)
    if time < HOP_END:
        u = ((time - HOP_START) / (HOP_END - HOP_START)) ** 2
        return pose(1.5 - 1.1 * u, 0.55 - 0.75 * u)
    u = smooth(HOP_END, HOP_END + 0.1, time)
    return pose(0.4 + 0.45 * u, -0.2 + 0.1 * u)


def simulate(seed, kind=StateEstimator, **params):
    """Errors of the estimator while a robot hops: velocity and attitude at lift-off and touchdown,
    then position at touchdown."""
    robot = BlockBench(MujocoRobot, grouped({"seed": seed, **STANDARD_NOISE}), robot="bruce")
    estimator = BlockBench(kind, params, robot="bruce")
    opened, flying, found = np.zeros(4), False, {}
    for tick in range(800):
        time = tick * PERIOD
        robot.block.emit()
        for port in ("imu", "joints"):
            estimator.set(port, **dict(robot.get(port)))
        opened = np.where(robot.get("contacts").closed, 0, opened + 1)
        estimator.set("contacts", active=opened <= 15)  # held for 30 ms, as by ContactDetector
        estimator.step()
        truth, base = robot.get("truth"), estimator.get("base")
        touched = bool(truth.contact_touched.any())
        if time > HOP_START and touched == flying:
            flying = not touched
            found["lift-off" if flying else "touchdown"] = (
                np.linalg.norm(base.linear_velocity - truth.base_linear_velocity),
                np.linalg.norm(turn_between(base.orientation, truth.base_orientation)),
                np.linalg.norm(base.position - truth.base_position),
            )
            if not flying and time > HOP_END + 0.1:
                return found
        stiff = time < HOP_END
        robot.set(
            "command", mode=1, position=hop(time), velocity=(hop(time + 0.002) - hop(time)) / 0.002,
            stiffness=np.tile([150, 250, 250, 250, 60] if stiff else [60, 100, 80, 100, 25], 2),
            damping=np.tile([2.0, 3.0, 3.0, 2.5, 0.6], 2),
        )  # fmt: skip
        robot.block.update()
        robot.clock.tick += 1
    raise AssertionError("the robot did not hop and land")


@pytest.mark.parametrize("seed", [2001, 2002, 2003])
@pytest.mark.parametrize("flight", ["imu", "ballistic"])
def test_a_hop_with_the_standard_noise(seed, flight):
    """The noise model without an estimator assumes 0.04 m/s and 10 mrad at touchdown."""
    found = simulate(seed, flight=flight)
    velocity, attitude, _ = found["lift-off"]
    assert velocity < 0.025
    assert attitude < 0.008
    velocity, attitude, position = found["touchdown"]
    assert velocity < 0.06  # the impact is within this tick
    assert attitude < 0.008
    assert position < 0.012


def test_the_papers_filter_is_spoilt_by_the_latch_at_lift_off():
    """Why the weights: the same hop with the paper's filter."""
    plain = simulate(2001, kind=ComplementaryFilter, velocity_gain=53.0, position_gain=53.0)
    assert plain["touchdown"][0] > 0.1
