"""The filter on exactly known motions: it converges, agrees with integration, and is as wrong as
it says."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from tests.robots.limbed_robots import quadruped

from aloft.blocks.estimation.invariant_kalman_filter import InvariantKalmanFilter, tracked_points
from aloft.mathematics import extended_pose, rotations
from aloft.mathematics.inertial_filter import rotate_in_world
from aloft.planner.library.library import shipped_folder
from aloft.robots.contact_kinematics import ContactKinematics
from aloft.robots.description import find_robot
from aloft.robots.kinematics import ball_feet
from aloft.runtime.language.errors import BlockError
from aloft.runtime.loading import LoadError, checked_file
from aloft.runtime.testing import BlockBench

from ...compiled import Sight
from ...turns import quaternion_of, turn_in_body

ROBOT = find_robot("bruce")
SEEN = ContactKinematics(ROBOT)
SIGHT = Sight(SEEN, 10)
PERIOD = 0.002
NONE = np.zeros(10)


def smooth(start, end, time):
    """From 0 to 1 with zero velocity and acceleration at both ends."""
    u = min(max((time - start) / (end - start), 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


def crouching(time):
    """Joint angles: both legs alike, from standing into a squat with a lean."""
    u = smooth(0.3, 0.6, time)
    return ROBOT.standing_position + u * np.tile([0.0, 0.5, 0.0, -0.5, 0.3], 2)


def standing(time):
    return ROBOT.standing_position


class OnFlatFeet:
    """Joints as given, the same on both legs; the base where the flat feet put it."""

    def __init__(self, joints):
        self.joints = joints

    def pose(self, time):
        """Orientation and position of the base [m]."""
        SIGHT.see(quaternion_of(np.zeros(3)), self.joints(time))
        pitch = math.atan2(SEEN.forward[2], SEEN.forward[0])
        orientation, rotation = quaternion_of([0.0, pitch, 0.0]), np.empty((3, 3))
        rotations.to_matrix(orientation, rotation)
        SIGHT.see(orientation, self.joints(time))
        position = -(SEEN.soles @ rotation.T).mean(axis=0)
        position[2] = -(SEEN.points @ rotation.T)[:, 2].mean()
        return orientation, position


STAND, SQUAT = OnFlatFeet(standing), OnFlatFeet(crouching)


class InTheAir:
    """Joints held, a free fall from rest at ``begin``, and any rotation about the pitch axis [rad]
    from there."""

    def __init__(self, angle, begin=0.0):
        self.joints, self.angle, self.begin = standing, angle, begin
        self.start = STAND.pose(0.0)

    def pose(self, time):
        out, time = np.empty(4), max(time - self.begin, 0.0)
        rotations.multiply(quaternion_of([0.0, self.angle(time), 0.0]), self.start[0], out)
        return out, self.start[1] - [0.0, 0.0, 0.5 * 9.81 * time**2]


def velocity(motion, time, step=1e-5):
    return (motion.pose(time + step)[1] - motion.pose(time - step)[1]) / (2 * step)


@cache
def imu(motion, time):
    """Angular velocity at that time and mean specific force over the tick before."""
    step = 1e-5
    rate = turn_in_body(motion.pose(time + step)[0], motion.pose(time - step)[0]) / (2 * step)
    change = (velocity(motion, time) - velocity(motion, time - PERIOD)) / PERIOD
    force = np.empty(3)
    rotations.rotate_back(
        motion.pose(time - PERIOD / 2)[0], np.add(change, [0.0, 0.0, 9.81]), force
    )
    return rate, force


class Run:
    """A filter that follows a motion through sensors with errors."""

    def __init__(self, motion, seed=None, gyro=0.0, accelerometer=0.0, offset=NONE, noise=(0, 0),
                 limit=math.inf, plain=False, **params):  # fmt: skip
        self.motion, self.random = motion, np.random.default_rng(seed)
        self.gyro, self.accelerometer, self.offset = gyro, accelerometer, offset
        self.noise, self.limit = noise, limit
        self.bench = BlockBench(InvariantKalmanFilter, params, robot="bruce", plain=plain)
        self.tick = 0

    def to(self, end, active=True, motion=None):
        self.motion = motion or self.motion
        while self.tick * PERIOD < end - 1e-9:
            time = self.tick * PERIOD
            rate, force = imu(self.motion, time)
            rate = rate + self.gyro + self.noise[0] * self.random.normal(size=3)
            force = force + self.accelerometer + self.noise[1] * self.random.normal(size=3)
            self.bench.set(
                "imu", angular_velocity=np.clip(rate, -self.limit, self.limit), specific_force=force
            )
            self.bench.set("joints", position=self.motion.joints(time) + self.offset)
            self.bench.set("contacts", active=active)
            self.bench.step()
            self.tick += 1
        return self

    def error(self):
        """The right-invariant error (9) of rotation, velocity and position."""
        time = (self.tick - 1) * PERIOD
        base = self.bench.get("base")
        orientation, position = self.motion.pose(time)
        truth = orientation, np.array([velocity(self.motion, time), position])
        found = base.orientation, np.array([base.linear_velocity, base.position])
        out, tangent = (np.empty(4), np.empty((2, 3))), np.empty(9)
        extended_pose.divide(*found, *truth, *out, np.empty(4))
        extended_pose.logarithm(*out, tangent)
        return tangent

    def covariance(self):
        return self.bench.get("estimate").covariance


class Disturbed:
    """The points that a block tracks are elsewhere on their feet than it has been told."""

    def __init__(self, block, disturb):
        self.points, self.disturb = block.legs.tracked.centre, disturb
        self.described = self.points.copy()
        block.kernel_calls = (self, *block.kernel_calls)

    def take_turn(self):
        self.points[:] = self.described
        self.disturb(self.points)


@pytest.mark.long
@pytest.mark.parametrize("level_ground", [True, False])
def test_machine_code_estimates_the_same_bytes(level_ground):
    """Through touchdowns, lift-offs and saturated samples."""
    kept = []
    for plain in (False, True):
        run = Run(
            SQUAT,
            3,
            noise=(0.02, 0.1),
            limit=0.05,
            plain=plain,
            level_ground=level_ground,
            gyro_range=0.05,
        )
        for end, active in (
            (0.02, True),
            (0.03, [True, False, True, False]),
            (0.04, False),
            (0.06, True),
        ):
            run.to(end, active)
        snapshot = run.bench.snapshot()
        kept.append((snapshot.bus, snapshot.state))
    assert kept[0] == kept[1]


def test_starts_at_the_truth_and_stays_there():
    run = Run(STAND).to(PERIOD)
    assert np.abs(run.error()).max() < 1e-12
    assert np.abs(run.to(0.2).error()).max() < 1e-6


@pytest.mark.long
def test_follows_a_squat_without_noise():
    run = Run(SQUAT)
    for end in (0.3, 0.4, 0.5, 0.6, 0.7):
        assert np.abs(run.to(end).error()).max() < 2e-4


@pytest.mark.long
def test_standing_still_finds_the_biases():
    gyro, accelerometer = np.array([0.01, -0.01, 0.005]), np.array([0.1, -0.1, 0.05])
    run = Run(STAND, 1, gyro, accelerometer, noise=(0.02, 0.1)).to(1.0)
    estimate = run.bench.get("estimate")
    assert estimate.gyro_bias == pytest.approx(gyro, abs=2e-3)
    assert estimate.accelerometer_bias == pytest.approx(accelerometer, abs=0.02)
    assert np.abs(run.error()[:3]).max() < 2e-3
    assert np.abs(run.error()[3:6]).max() < 5e-3


def test_the_covariance_stays_symmetric_and_positive():
    run = Run(SQUAT, 2, noise=(0.02, 0.1))
    for end, active in ((0.4, True), (0.45, [True, False, True, False]), (0.5, False), (0.7, True)):
        covariance = run.to(end, active).covariance()
        assert np.array_equal(covariance, covariance.T)
        present = np.flatnonzero(np.diag(covariance))
        assert np.linalg.eigvalsh(covariance[np.ix_(present, present)]).min() > 0.0
        assert np.array_equal(run.bench.get("health").trusted, np.broadcast_to(active, 4))


def test_a_flight_is_an_integration_of_the_imu():
    """A tumbling flight at 500 Hz against its exact motion."""
    tumble = InTheAir(lambda t: 0.3 * math.sin(12.0 * t) + 2.0 * t * t)
    run = Run(tumble).to(0.1, active=False)
    first = run.error()
    drifted = run.to(0.3, active=False).error() - first
    assert np.abs(drifted[:3]).max() < 2e-4
    assert np.abs(drifted[3:6] - 0.2 * np.cross([0, 0, -9.81], first[:3])).max() < 2e-3
    assert not run.bench.get("health").trusted.any()


def test_it_is_as_wrong_as_it_says():
    """Normalised estimation error squared of 12 runs whose errors are drawn as the filter assumes,
    within the chi-squared distribution's 99.9 % from above; and not idly pessimistic."""
    from scipy.special import gammaincinv  # a hundredth of the import of scipy.stats

    total, late = 0.0, 9
    for seed in range(12):
        random = np.random.default_rng([seed, 1])
        run = Run(
            SQUAT, seed, 0.006 * random.normal(size=3),
            0.06 * random.normal(size=3), 0.0017 * random.normal(size=10), (0.02, 0.1),
        )  # fmt: skip
        slid = np.zeros((2, 3))

        def disturb(centres, random=random, slid=slid):
            """Leg kinematics with white noise, of feet that slide at random."""
            slid[:, :2] += 1e-3 * math.sqrt(PERIOD) * random.normal(size=(2, 2))
            centres += 2e-4 * random.normal(size=(4, 3)) + slid.repeat(2, axis=0)

        Disturbed(run.bench.block, disturb)
        error = run.to(0.6).error()
        total += error @ np.linalg.solve(run.covariance()[:late, :late], error)
    assert total < 2.0 * gammaincinv(0.5 * 12 * late, 0.999)  # of chi-squared
    assert total > 0.4 * 12 * late


def test_a_slipping_foot_is_refused():
    """One foot is pulled away: nothing is learnt from it, and its points say so."""

    speed, slid = [0.0], [0.0]

    def slip(centres):
        slid[0] += speed[0] * PERIOD
        centres[:2, 0] += slid[0]

    run = Run(STAND)
    Disturbed(run.bench.block, slip)
    run.to(0.2)
    speed[0] = 0.3
    run.to(0.3)
    assert run.bench.get("health").trusted.tolist() == [False, False, True, True]
    assert np.abs(run.error()[3:6]).max() < 0.1 * speed[0]
    assert np.abs(run.error()[6:]).max() < 0.1 * slid[0]


def test_a_wrong_velocity_is_found_out():
    run = Run(STAND).to(0.3)
    vectors = run.bench.get("estimate").vectors.copy()
    vectors[0, 0] = 0.6
    run.bench.set("estimate", vectors=vectors)
    assert abs(run.to(0.6).error()[3]) < 0.02


@pytest.mark.parametrize("level_ground", [True, False])
def test_only_ground_that_is_said_to_be_level_tells_the_tilt(level_ground):
    """The estimated pitch is off after a flight; the heights of the points tell it or do not."""
    run = Run(STAND, level_ground=level_ground).to(0.2)
    run.to(0.22, active=False)
    estimate = run.bench.get("estimate")
    orientation, covariance = estimate.orientation.copy(), run.covariance().copy()
    rotate_in_world(orientation, 0.0, 0.03, 0.0)
    covariance[1, 1] += 0.03**2
    run.bench.set("estimate", orientation=orientation, covariance=covariance)
    assert bool(abs(run.to(0.24).error()[1]) < 5e-3) == level_ground


def test_a_range_that_is_not_reached_changes_nothing():
    limits = {"gyro_range": 8.73, "accelerometer_range": 39.2}
    plain, limited = (Run(SQUAT, 1, noise=(0.02, 0.1), **p) for p in ({}, limits))
    assert plain.to(0.4).bench.snapshot().state == limited.to(0.4).bench.snapshot().state


@pytest.mark.parametrize("speed", [600, 900])
def test_a_spin_beyond_the_gyroscopes_range(speed):
    """It cannot be followed; but the filter knows that, and how far off it may be."""
    limit = math.radians(500)

    def angle(time):
        """Up to speed within 0.05 s."""
        return math.radians(speed) * (time - 0.025 if time > 0.05 else 10.0 * time * time)

    runs = {}
    for name, known in (("told", limit), ("not told", None)):
        run = Run(STAND, 3, limit=limit, noise=(0.02, 0.1), gyro_range=known).to(0.2)
        assert not run.bench.get("health").gyro_saturated
        runs[name] = run.to(0.45, active=False, motion=InTheAir(angle, 0.2))
    lost = math.radians(speed - 500) * 0.2
    for run in runs.values():
        assert np.linalg.norm(run.error()[:3]) == pytest.approx(lost, rel=0.15)
        base = run.bench.get("base")
        assert base.linear_velocity == pytest.approx(velocity(run.motion, 0.448), abs=0.03)
    health = runs["told"].bench.get("health")
    assert health.gyro_saturated and 90 < health.saturated_ticks < 125
    assert health.tilt_std > lost
    assert runs["not told"].bench.get("health").tilt_std < 0.1 * lost
    assert not runs["not told"].bench.get("health").gyro_saturated


def test_restores_exactly():
    run = Run(SQUAT).to(0.4)
    half = run.bench.snapshot()
    first = run.to(0.45).bench.snapshot()
    run.bench.restore(half)
    run.tick -= 25
    assert run.to(0.45).bench.snapshot().state == first.state


def test_feet_that_press_harder_are_taken_to_slide():
    """At rest nothing presses beyond gravity; in a squat the place on the ground is less sure."""
    for motion, pressed in ((STAND, False), (SQUAT, True)):
        plain, told = Run(motion), Run(motion, impact_slide=3e-3)
        for run in (plain, told):
            run.to(0.55)
        wider = told.covariance()[9:21, 9:21].diagonal() - plain.covariance()[9:21, 9:21].diagonal()
        assert (wider > 1e-8).all() if pressed else np.abs(wider).max() < 1e-15


def test_needs_a_robot():
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(InvariantKalmanFilter, dimensions=dict(ROBOT.dimensions))


@pytest.mark.parametrize("count", [2, 1])
def test_point_feet_stand(count):
    """BRUCE on its toes, or on one toe alone: nothing is divided by zero, nothing drifts."""
    toes = [contact for contact in ROBOT.contacts if contact.name.endswith("toe")][:count]
    names = [contact.foot for contact in toes]
    feet = tuple(foot for foot in ROBOT.feet if foot.name in names)
    robot = ROBOT.changed(contacts=tuple(toes), feet=feet)
    bench = BlockBench(InvariantKalmanFilter, robot=robot)
    bench.set("joints", position=ROBOT.standing_position)
    bench.set("imu", specific_force=[0.0, 0.0, 9.81])
    bench.set("contacts", active=True)
    bench.step(200)
    base = bench.get("base")
    assert bench.get("health").trusted.all()
    assert np.abs(base.linear_velocity).max() < 1e-3
    assert np.linalg.norm(base.orientation[:3]) < 5e-3


def test_it_tracks_the_point_of_a_foot_that_stands_while_the_foot_rolls():
    points, heights = tracked_points(ROBOT)
    assert points.tolist() == [list(contact.position) for contact in ROBOT.contacts]
    assert heights.tolist() == [0.0] * len(ROBOT.contacts)


def test_of_a_foot_that_is_a_ball_it_tracks_the_centre():
    robot = quadruped()
    points, heights = tracked_points(robot)
    assert len(ball_feet(robot)) == 4
    for ball in ball_feet(robot):
        assert points[ball.point].tolist() == ball.centre.tolist()
        assert heights[ball.point] == ball.radius > 0.0


def test_no_start_where_the_ground_leans():
    jump = shipped_folder() / "jump.yaml"
    task = {"name": "odd", "rise": 0.1, "slope": ["5 deg", 0]}
    with pytest.raises(LoadError, match="takes the ground on which it begins for level") as error:
        checked_file(jump, {"plan.task": task, "estimator.use": "blocks.InvariantKalmanFilter"})
    assert "ground that rises by 5 deg ahead and 0 deg to the left" in str(error.value)
    assert "estimator.use: blocks.StateEstimator" in str(error.value)
