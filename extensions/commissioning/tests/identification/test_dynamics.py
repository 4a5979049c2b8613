"""Dynamics from logs: base parameters, the band, what a drawn robot's logs tell, bodies that can exist, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from aloft.extensions.commissioning.identification.band import LowPass, band_of
from aloft.extensions.commissioning.identification.base_parameters import LinkRegressor, Motion
from aloft.extensions.commissioning.identification.consistent_body import consistent_dynamics
from aloft.extensions.commissioning.identification.dynamics_fit import DynamicsModel, fit_dynamics
from aloft.extensions.commissioning.identification.dynamics_report import identify_dynamics
from aloft.extensions.commissioning.identification.identification import IdentificationError
from aloft.extensions.commissioning.identification.motion_log import MotionLog, missing
from aloft.lab.studies.identified_robots import drawn, pendulum, simulated_log
from aloft.robots.description import find_robot


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return pendulum(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def told(robot):
    """A drawn robot, its log, and the fit in which its elbow's torque is trusted."""
    rng = np.random.default_rng(5)
    truth, model = drawn(robot, rng)
    truth["log constant"][1] = 0.0
    log = simulated_log(model, truth, rng, "sines")
    return truth, log, *fit_dynamics(robot, [log], trusted=("elbow",))


@pytest.mark.parametrize("name", ["double_pendulum", "bruce"])
def test_base_parameters_hold_the_equations_of_motion(robot, name):
    described = robot if name == "double_pendulum" else find_robot(name)
    links = LinkRegressor(described)
    rng, n, floating = (
        np.random.default_rng(1),
        len(described.joints),
        described.base_joint == "floating",
    )
    q, v, a = rng.uniform(-1, 1, (3, 1, n))
    base = [rng.uniform(-3, 3, (1, 3)) if floating else None for _ in range(3)]
    rows = links.rows(Motion(q, v, a, *base))
    state = links._states(Motion(q, v, a, *base), 0)
    free = pin.Model(links.model)
    free.armature = np.zeros(free.nv)
    assert rows[0] @ links.described_base == pytest.approx(
        pin.rnea(free, free.createData(), *state), abs=1e-9
    )


def test_base_parameters_of_a_double_pendulum_are_those_of_the_textbook(robot):
    links = LinkRegressor(robot)
    assert "upper m z - 0.25 lower mass" in links.names
    assert "upper Ixx + 0.0625 lower mass" in links.names
    assert [robot.joints[j].name for j in links.told_rotors] == ["elbow"]


def test_a_low_pass_keeps_the_band_and_its_slope():
    time = 0.002 * np.arange(4000)
    low = LowPass.of(len(time), 0.002, 5.0)
    slow, fast = np.sin(2 * np.pi * 1.5 * time), np.sin(2 * np.pi * 12.0 * time)
    at = time[low.centres]
    assert low(slow[:, None])[:, 0] == pytest.approx(np.sin(2 * np.pi * 1.5 * at), abs=0.01)
    assert np.abs(low(fast[:, None])).max() < 0.01
    slope = 2 * np.pi * 1.5 * np.cos(2 * np.pi * 1.5 * at)
    assert low(slow[:, None], derivative=True)[:, 0] == pytest.approx(slope, abs=0.2)


def test_the_band_follows_from_the_torque_and_not_from_its_noise():
    rng, time = np.random.default_rng(0), 0.002 * np.arange(5000)
    torque = np.sin(2 * np.pi * 2.0 * time)[:, None] + 0.02 * rng.normal(size=(5000, 1))
    log = MotionLog("log", 0.002, np.zeros((5000, 1)), torque)
    assert band_of([log]) == pytest.approx(5.0, abs=1.0)


def test_derivatives_by_the_unknowns_are_those_of_the_torques(robot):
    rng, time = np.random.default_rng(3), 0.002 * np.arange(2000)
    angles = np.stack([np.sin(7.0 * time), 0.8 * np.sin(9.0 * time + 1.0)], axis=1)
    model = DynamicsModel(robot)
    formed = model.form(MotionLog("sines", 0.002, angles, np.zeros_like(angles)), 5.0)
    value = model.mean + 0.05 * rng.uniform(0.5, 1.0, len(model.mean))
    value[model.part("age of torques")] = 0.004
    made, jacobian = model.predicted(value, formed, 0)
    scale = np.abs(made).max()
    for k, name in enumerate(model.unknowns.names):
        ends = [value + sign * 1e-6 * np.eye(len(value))[k] for sign in (1, -1)]
        high, low = (model.predicted(end, formed, 0)[0] for end in ends)
        assert jacobian[:, :, k] == pytest.approx((high - low) / 2e-6, abs=1e-5 * scale), name


@pytest.mark.long
def test_what_is_true_of_a_drawn_robot_is_found(told):
    truth, _, model, fit = told
    for kind in ("base", "coulomb", "viscous", "load", "log constant", "age of torques"):
        for value, found in zip(truth[kind], fit.estimates_at(model.part(kind)), strict=True):
            assert abs(found.value - value) < 3.5 * found.std + 1e-4, kind
    base = model.part("base")
    assert fit.value[base][[1, 2]] == pytest.approx(truth["base"][[1, 2]], rel=0.04)


@pytest.mark.long
def test_values_that_no_body_has_move_to_the_nearest_that_one_has(told):
    _, _, model, fit = told
    value = fit.value.copy()
    value[model.part("base").start + 2] = -0.01  # a moment of inertia
    value[model.part("viscous")] = -0.01
    body = consistent_dynamics(model, replace(fit, value=value))
    for link in body.links.values():
        xx, yy, zz, xy, xz, yz = link.inertia
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert link.mass > 0.0 and moments[0] > 0.0
        assert moments[2] < moments[0] + moments[1]
    assert (body.value[model.part("viscous")] > -1e-6).all()
    assert any("lower Ixx" in name for name in body.moved)


@pytest.mark.long
def test_a_controller_is_not_taken_for_the_robot(robot, told):
    log = told[1]
    q = log.position
    held = 0.6 * 9.81 * 0.2 * np.sin(q.sum(axis=1))
    torque = np.stack([held + 1.5 * np.sin(q[:, 0]), held], axis=1)
    found = identify_dynamics(robot, [replace(log, torque=torque)])
    assert sum("a function of the positions alone" in text for text in found.warnings) == 2
    assert "a controller is identified, not the robot" in found.warnings[0]


@pytest.mark.long
def test_motors_that_disagree_are_reported_and_held_out_logs_judged(robot, told):
    log = told[1]
    torque = log.torque * [0.5, 1.0]
    late = np.vstack([np.zeros((6, 2)), torque[:-6]])
    found = identify_dynamics(robot, [replace(log, torque=torque, asked=torque)], [log])
    assert any("the motors disagree about the same body" in text for text in found.warnings)
    assert [each.held_out for each in found.residuals] == [False, True]
    assert not any("had to move" in text for text in found.warnings), (
        "a body that fits needs no move"
    )
    assert found.residuals[0].fitted["shoulder"] < 0.02
    assert found.residuals[1].fitted["shoulder"] > 100 * found.residuals[0].fitted["shoulder"]
    assert any("the fit does not hold for such motion" in text for text in found.warnings)
    assert found.delay is not None and found.delay.value == pytest.approx(0.0, abs=1e-3)
    found = identify_dynamics(robot, [replace(log, torque=late, asked=torque)])
    assert found.delay is not None and found.delay.value == pytest.approx(0.012, abs=1e-3)


def test_a_log_without_torques_says_what_cannot_be_told(robot):
    log = MotionLog("quiet.csv", 0.002, np.zeros((5000, 2)))
    with pytest.raises(
        IdentificationError,
        match=r"quiet\.csv has no torques, so masses.*cannot be told: motion alone",
    ):
        missing(log, robot)


def test_a_short_log_and_an_unknown_joint_are_refused(robot):
    time = 0.002 * np.arange(500)[:, None]
    log = MotionLog("short", 0.002, np.sin(9 * time) * [1, 1], np.sin(9 * time) * [1, 1])
    with pytest.raises(
        IdentificationError, match=r"short has 0.998 s, and .* s are needed in a band of"
    ):
        fit_dynamics(robot, [log])
    with pytest.raises(IdentificationError, match="no joint knee to trust; it has shoulder, elbow"):
        fit_dynamics(robot, [log], trusted=("knee",))
