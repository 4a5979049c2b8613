"""Mass and centre of mass: exact statics are found, friction is not believed, pushes are left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.estimation.mass_estimator import MassEstimator
from aloft.blocks.signals import Phase
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
GRAPH = Path(aloft.__file__).parent / "graphs" / "jump.yaml"
UPRIGHT = [0.0, 0.0, 0.0, 1.0]
POINTS = len(ROBOT.contacts)


class Standing:
    """A robot at rest, of a mass and a torso that its controller does not know."""

    def __init__(self, scale=1.0, offset=(0.0, 0.0, 0.0), **params):
        self.true = BlockBench(Dynamics, {}, robot=ROBOT)
        self.true.set("mass", mass=scale * ROBOT.total_mass, com_offset=offset)
        self.model = BlockBench(Dynamics, {}, robot=ROBOT)
        self.filter = BlockBench(MassEstimator, params, robot=ROBOT)
        self.phase = Phase.STAND
        self.gyro_noise, self.random = 0.0, np.random.default_rng(11)
        self.disturbance, self.speed = np.zeros(len(ROBOT.joints)), 0.0

    def torque(self):
        """The torques that hold the true robot, its weight shared by the feet as statics ask."""
        terms = self.terms(self.true)
        jacobian = np.asarray(terms.contact_jacobian).reshape(-1, 16)
        gravity = np.asarray(terms.nonlinear_effects)
        force = np.linalg.lstsq(jacobian[:, :6].T, gravity[:6], rcond=None)[0]
        return gravity[6:] - jacobian[:, 6:].T @ force

    @staticmethod
    def terms(bench):
        bench.set("base", position=[0, 0, 0.4], orientation=UPRIGHT)
        bench.set("joints", position=ROBOT.standing_position)
        bench.step()
        return bench.get("terms")

    def stand(self, ticks):
        torque = self.torque()
        for _ in range(ticks):
            out = self.filter.get("estimate")
            self.model.set("mass", mass=out.mass.copy(), com_offset=out.com_offset.copy())
            terms = self.terms(self.model)
            measured = {name: array.copy() for name, array in terms}
            measured["velocity"][3:6] += self.random.normal(0.0, 1.0, 3) * self.gyro_noise
            measured["velocity"][6:] += self.speed
            self.filter.set("terms", **measured)
            self.filter.set("joints", torque=torque + self.disturbance)
            self.filter.set("phase", phase=self.phase, stance=np.ones(POINTS, bool))
            self.filter.step()
        return self.filter.get("estimate")


def frictionless():
    return {"friction_share": 0.0, "friction_left": 0.0, "tilt_std": 0.0, "gyro_noise": 0.0}


@pytest.mark.parametrize("scale", [0.9, 1.12])
def test_finds_the_mass_and_where_it_is(scale):
    offset = np.array([0.008, -0.006, 0.0])
    found = Standing(scale, offset, **frictionless()).stand(300)
    assert float(found.mass) == pytest.approx(scale * ROBOT.total_mass, rel=0.01)
    np.testing.assert_allclose(found.com_offset[:2], offset[:2], atol=1e-3)
    assert float(found.mass_std) < 0.02 * ROBOT.total_mass
    assert found.com_offset_std[2] > 0.009, "the height is not observable while the torso is level"


def test_the_described_robot_stays_as_it_is():
    found = Standing().stand(200)
    assert float(found.mass) == pytest.approx(ROBOT.total_mass, rel=1e-4)
    np.testing.assert_allclose(found.com_offset, 0.0, atol=1e-5)


def test_friction_leaves_an_uncertainty_that_covers_its_effect():
    """A joint at rest may hold any torque up to its friction."""
    random = np.random.default_rng(3)
    errors = []
    for _ in range(4):
        robot = Standing()
        robot.disturbance[:] = random.uniform(-1.0, 1.0, 10) * ROBOT.motors.friction
        found = robot.stand(200)
        errors.append((float(found.mass) - ROBOT.total_mass) / float(found.mass_std))
        assert 0.01 < float(found.mass_std) / ROBOT.total_mass < 0.05
    assert np.abs(errors).max() < 3.0
    assert np.abs(errors).max() > 0.1, "friction does disturb"


def test_friction_that_is_told_is_not_taken_for_a_torso_elsewhere():
    further = {joint.name: 0.1 for joint in ROBOT.joints}

    def offset(**said):
        robot = Standing(**said)
        robot.speed = 0.5  # faster than what is uncertain at rest
        robot.disturbance[:] = ROBOT.motors.friction + 0.1 + 0.5 * (ROBOT.motors.damping + 0.1)
        return float(np.linalg.norm(robot.stand(300).com_offset))

    told, untold = offset(friction=further, damping=further), offset()
    assert told < 1e-3
    assert untold > 5 * told


def test_a_push_is_left_out():
    robot = Standing()
    robot.stand(100)
    robot.disturbance[:] = 40.0 * np.asarray(robot.model.get("terms").contact_jacobian)[0, 0, 6:]
    found = robot.stand(100)
    assert float(found.mass) == pytest.approx(ROBOT.total_mass, rel=0.02)


def test_a_noisy_gyroscope_is_believed_less():
    """Its derivative times the inertia is a moment that no centre of mass explains."""

    def offset(said):
        robot = Standing(gyro_noise=said)
        robot.gyro_noise = 0.2
        return float(np.hypot(*robot.stand(400).com_offset[:2]))

    assert offset(0.2) < 0.002
    assert offset(0.0) > 2 * offset(0.2)


def test_nothing_changes_from_the_thrust_on():
    robot = Standing(1.1)
    robot.stand(100)
    robot.phase = Phase.THRUST
    robot.stand(300)
    before = robot.stand(1).mass.copy()
    robot.phase = Phase.RECOVER
    assert robot.stand(100).mass == pytest.approx(before, rel=1e-4)
    assert before > 1.05 * ROBOT.total_mass


def test_before_any_measurement_it_is_the_description():
    found = Standing(1.2).stand(20)
    assert float(found.mass) == ROBOT.total_mass
    assert float(found.mass_std) == pytest.approx(0.1 * ROBOT.total_mass)


@pytest.mark.long
@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_in_a_noisy_world_at_the_end_of_the_squat(scale):
    settings = {
        "robot.body.mass_scale": scale, "robot.body.base_com_offset": [0.008, 0.0, 0.0], "robot.seed": 4,
        "duration": 0.8,
    }  # fmt: skip
    found = aloft.load(GRAPH, settings).run(log=False).metrics
    assert found["felt_mass_kg"] == pytest.approx(found["robot_mass_kg"], rel=0.03)
    assert found["felt_com_offset_x_mm"] == pytest.approx(8.0, abs=6.0)
    assert found["felt_com_offset_y_mm"] == pytest.approx(0.0, abs=8.0)
