"""The controller's and the estimators' blocks with robots of other legs, feet, arms and masses."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.control.joint_pd import JointPD, default_gains
from aloft.blocks.control.whole_body_controller import WholeBodyController
from aloft.blocks.estimation.complementary_filter import ComplementaryFilter
from aloft.blocks.estimation.invariant_kalman_filter import InvariantKalmanFilter
from aloft.blocks.estimation.state_estimator import StateEstimator
from aloft.blocks.signals import Phase
from aloft.mathematics.constants import GRAVITY
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

ROBOTS = ["bruce", "go2", "solo12", "g1"]
"""Line, ball, ball and flat feet; five, three, three and six joints a leg; 5, 16, 2.5 and 33 kg."""
LEVEL = [0.0, 0.0, 0.0, 1.0]


def standing_terms(robot):
    bench = BlockBench(Dynamics, robot=robot)
    bench.set("base", position=[0.0, 0.0, 0.5], orientation=LEVEL)
    bench.set("joints", position=robot.standing_position)
    bench.step()
    return {name: array.copy() for name, array in bench.get("terms")}


@pytest.mark.parametrize("name", ROBOTS)
def test_the_whole_body_controller_carries_any_robot_on_any_of_its_points(name):
    robot = find_robot(name)
    terms, weight = standing_terms(robot), robot.weight
    bench = BlockBench(WholeBodyController, {"limits": "none"}, robot=robot)
    bench.set("terms", **terms)
    bench.set("joints", position=robot.standing_position)
    bench.set("target", com=terms["com"], orientation=LEVEL, joint_position=robot.standing_position)
    count = len(robot.contacts)
    for stance in (np.ones(count, bool), np.arange(count) != 0, np.arange(count) == 0):
        for phase in (Phase.STAND, Phase.THRUST, Phase.LANDING):
            bench.set("phase", phase=int(phase), stance=stance)
            bench.step()
            command = bench.get("command")
            assert bool(command.solved)
            left = terms["mass_matrix"] @ command.acceleration + terms["nonlinear_effects"]
            left[6:] -= command.torque
            left -= np.einsum("ikn,ik->n", terms["contact_jacobian"], command.force)
            assert np.abs(left).max() < 1e-6 * weight
            assert not command.force[~stance].any()
        if stance.all():
            bench.set("phase", phase=int(Phase.STAND))
            bench.step()
            assert command.force[:, 2].sum() == pytest.approx(weight, rel=1e-3)
            assert np.abs(command.acceleration).max() < 0.05


def test_held_joints_and_arms_do_not_swing_to_balance():
    robot = find_robot("g1")
    assert len(robot.held) > 10
    terms = standing_terms(robot)
    held = [k for k, joint in enumerate(robot.joints) if joint.name in robot.held]
    accelerations = {}
    for with_posture in (True, False):
        tasks = ["ContactPoints", "LinearMomentum", "TorsoOrientation", "AngularMomentum"]
        params = {"tasks": [*tasks, *(["Posture"] if with_posture else [])]}
        bench = BlockBench(WholeBodyController, params, robot=robot)
        bench.set("terms", **terms)
        bench.set("joints", position=robot.standing_position)
        bench.set("phase", phase=int(Phase.STAND), stance=True)
        bench.set("target", com=terms["com"] + [0.02, 0.02, 0.0], orientation=LEVEL)
        bench.set("target", joint_position=robot.standing_position)
        bench.step()
        accelerations[with_posture] = np.abs(bench.get("command").acceleration[6:][held]).max()
    assert accelerations[True] < 0.3 * accelerations[False]


@pytest.mark.parametrize("name", ROBOTS)
def test_every_joint_has_sensible_gains_and_held_ones_are_held(name):
    robot = find_robot(name)
    stiffness, damping = default_gains(robot)
    peak = np.abs(robot.joint_to_motor).T @ robot.motors.peak_torque
    assert (stiffness > 0.0).all() and (damping > 0.0).all()
    assert (0.2 * stiffness <= peak * (1.0 + 1e-12)).all()
    inertia = (damping / 1.6) ** 2 / stiffness
    assert (damping * 0.0005 < 0.5 * inertia).all(), "a drive of 2 kHz would not be stable"
    bench = BlockBench(JointPD, robot=robot)
    bench.set("phase", phase=int(Phase.STAND), stance=True)
    bench.set("reference", joint_position=robot.standing_position)
    bench.step(5)
    command = bench.get("command")
    for k, joint in enumerate(robot.joints):
        held = joint.name in robot.held
        assert command.stiffness[k] == (stiffness[k] if held else 0.0)
        assert command.position[k] == (robot.standing_position[k] if held else 0.0)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("kind", [StateEstimator, ComplementaryFilter, InvariantKalmanFilter])
def test_the_estimators_stand_still_with_any_robot(name, kind):
    robot = find_robot(name)
    bench = BlockBench(kind, robot=robot)
    bench.set("joints", position=robot.standing_position)
    bench.set("imu", specific_force=[0.0, 0.0, GRAVITY])
    bench.set("contacts", active=True)
    bench.step(100)
    base = bench.get("base")
    assert np.abs(base.linear_velocity).max() < 1e-3
    assert np.abs(base.orientation[:3]).max() < 1e-2
    terms = standing_terms(robot)
    lowest = 0.5 - terms["contact_position"][:, 2].mean()
    assert base.position[2] == pytest.approx(lowest, abs=3e-3)
