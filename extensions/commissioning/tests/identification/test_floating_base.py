"""Dynamics of a floating base: what the ground's forces leave of its equations, beside Pinocchio by hand; what logs of simulated robots
tell; what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from aloft import load
from aloft.extensions.commissioning.identification.base_parameters import LinkRegressor, Motion
from aloft.extensions.commissioning.identification.dynamics_fit import (
    MASS_STD,
    DynamicsModel,
    FittedDynamics,
    fit_dynamics,
)
from aloft.extensions.commissioning.identification.dynamics_report import identify_dynamics
from aloft.extensions.commissioning.identification.ground_forces import equations_left
from aloft.extensions.commissioning.identification.identification import IdentificationError
from aloft.extensions.commissioning.identification.motion_log import MotionLog, missing
from aloft.hal.log.played_log import rotation_of
from aloft.lab.studies.identified_robots import NINETY
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model

BRUCE = find_robot("bruce")
N, POINTS = len(BRUCE.joints), len(BRUCE.contacts)
SAMPLES = 60
ALL = np.ones(POINTS, bool)


def standing_log(closed: np.ndarray, wrenches: np.ndarray | None, angles: np.ndarray) -> MotionLog:
    return MotionLog(
        "log", 0.002, np.tile(angles, (SAMPLES, 1)), None, None, np.zeros((SAMPLES, 6)),
        closed=np.tile(closed, (SAMPLES, 1)), wrenches=wrenches,
    )  # fmt: skip


@pytest.mark.parametrize("measured", ["nothing", "normal", "wrench"])
@pytest.mark.parametrize("loaded", ["both", "right", "toe", "none"])
@pytest.mark.parametrize("count", [6, 6 + N])
def test_what_is_left_of_the_equations_does_not_depend_on_forces_that_are_not_measured(
    measured, loaded, count
):
    """Inverse dynamics less point forces, by Pinocchio's frames of the points, hold with what is measured of these alone."""
    rng, links = np.random.default_rng(2), LinkRegressor(BRUCE)
    closed = {"both": ALL, "none": ~ALL, "toe": np.eye(POINTS, dtype=bool)[0]}.get(
        loaded, ALL.copy()
    )
    if loaded == "right":
        closed = np.array([c.foot == BRUCE.contacts[0].foot for c in BRUCE.contacts])
    angles, speeds, turns = rng.uniform(-0.6, 0.6, (3, N))
    base = rng.uniform(-3, 3, (3, 1, 3))
    built = build_pinocchio_model(BRUCE)
    data = built.model.createData()
    q = np.concatenate([np.zeros(6), [1.0], angles])
    pin.computeJointJacobians(built.model, data, q)
    pin.updateFramePlacements(built.model, data)
    feet = [foot.name for foot in BRUCE.feet]
    wrenches = np.zeros((SAMPLES, len(feet), 6))
    ground = np.zeros(6 + N)
    for point, contact in enumerate(BRUCE.contacts):
        if not closed[point]:
            continue
        force, foot = rng.uniform(-20, 20, 3), feet.index(contact.foot)
        if measured == "normal":
            force[2] = 8.0  # how a normal force is shared among points is not known
        jacobian = pin.getFrameJacobian(built.model, data, built.contact_frames[point], pin.LOCAL)
        ground += jacobian[:3].T @ force
        arm = np.array(contact.position) - np.array(BRUCE.feet[foot].sole)
        wrenches[:, foot] += np.concatenate([force, np.cross(arm, force)])
    if measured == "normal":
        wrenches[:, :, [0, 1, 3, 4, 5]] = np.nan
    log = standing_log(closed, None if measured == "nothing" else wrenches, angles)
    through, known = equations_left(log, 5.0, links, np.tile(angles, (2, 1)), count)
    motion = Motion(angles[None], speeds[None], turns[None], *base)
    whole = links.rows(motion)[0, :count] @ links.described_base
    left = through[0] @ (whole - ground[:count])
    assert through[0] @ whole == pytest.approx(left + known[0], abs=1e-8)
    # as many as the wrenches of points, lines and nothing leave: a foot on two points has five directions, one fewer if the normal
    # force is known
    loads = {"both": [2, 2], "right": [2], "toe": [1], "none": []}[loaded]
    free = sum({1: 3, 2: 5}[p] - (measured == "normal") for p in loads)
    rank = np.linalg.matrix_rank(through[0], tol=1e-9)
    assert rank == count - (0 if measured == "wrench" else min(free, count))


@pytest.fixture(scope="module")
def swayed(tmp_path_factory):
    """What a robot measures that sways over its feet with the standard trial's sensors, with the wrenches of its feet as MuJoCo has them,
    and a description of it that is wrong by a fifth."""
    file = tmp_path_factory.mktemp("sway") / "sway.yaml"
    file.write_text("include: [aloft:sway, aloft:trials/standard]\n")
    result = load(file).run()
    result.raise_if_failed()

    def signal(name: str) -> np.ndarray:
        return np.asarray(result.signal(f"robot.{name}"))

    def middle(values: np.ndarray) -> np.ndarray:
        return 0.5 * (values + np.concatenate([values[1:], values[-1:]]))

    angles, built = signal("joints.position"), build_pinocchio_model(BRUCE)
    turns, places = rotation_of(signal("truth.base_orientation")), signal("truth.base_position")
    forces, points = middle(signal("truth.contact_force")), signal("truth.contact_position")
    wrenches, data = np.zeros((len(angles), len(BRUCE.feet), 6)), built.model.createData()
    for k, q in enumerate(angles):
        pin.framesForwardKinematics(built.model, data, np.concatenate([np.zeros(6), [1.0], q]))
        for point, foot in enumerate(BRUCE.foot_of_contact()):
            sole = data.oMf[built.sole_frames[foot]]
            turn = turns[k] @ sole.rotation
            arm = turn.T @ (points[k, point] - places[k] - turns[k] @ sole.translation)
            force = turn.T @ forces[k, point]
            wrenches[k, foot] += np.concatenate([force, np.cross(arm, force)])
    base = np.hstack([signal("imu.angular_velocity"), middle(signal("imu.specific_force"))])
    log = MotionLog(
        "sway", 0.002, angles, signal("joints.torque"), None, base,
        closed=signal("contacts.closed").astype(bool), wrenches=wrenches,
    )  # fmt: skip
    rng, links = np.random.default_rng(0), []
    for link in BRUCE.links:
        mass, size = np.exp(0.2 * rng.normal(size=2))
        links.append(link.model_copy(update={
            "mass": link.mass * mass, "com": tuple(np.array(link.com) + 0.01 * rng.normal(size=3)),
            "inertia": tuple(np.array(link.inertia) * mass * size),
        }))  # fmt: skip
    return log, BRUCE.changed(links=tuple(links))


def judged(model: DynamicsModel, fit: FittedDynamics) -> tuple[float, float]:
    """Return the share of 90 % intervals that contain the true base parameters, and the error of the mass [kg]."""
    part, truth = model.part("base"), LinkRegressor(BRUCE).described_base
    std, error = np.sqrt(np.diag(fit.covariance))[part], np.abs(fit.value[part] - truth)
    return float((error < NINETY * std).mean()), float(error[model.links.whole_mass])


@pytest.mark.long
def test_measured_wrenches_tell_masses_without_torques(swayed):
    log, wrong = swayed
    found = identify_dynamics(wrong, [replace(log, torque=None)])
    share, mass = judged(found.model, found.fit)
    assert share > 0.85
    assert mass < 0.02 and abs(wrong.total_mass - BRUCE.total_mass) > 0.3
    names, std = found.fit.unknowns.names, np.sqrt(np.diag(found.fit.covariance))
    told = {n for n, s, b in zip(names, std, found.fit.prior_std, strict=True) if s < 0.3 * b}
    assert "whole mass" in told and "torso m x" in " ".join(told)
    assert len(told) > 40, "of 80"
    residual = found.residuals[0]
    assert list(residual.fitted) == found.model.equations and len(residual.fitted) == 6
    for name, left in residual.fitted.items():
        assert left < (0.5 if "force" in name else 0.8) * residual.described[name], name
    assert all(link.mass > 0.0 for link in found.body.links.values())
    assert any("friction, rotor inertia" in text for text in found.untold)
    assert any("near the description's" in text for text in found.untold)


@pytest.mark.long
def test_switches_and_torques_tell_friction_and_masses_but_for_a_common_factor(swayed):
    log, wrong = swayed
    part = slice(500, 6500)
    found = identify_dynamics(
        wrong,
        [replace(log, wrenches=None, position=log.position[part], torque=log.torque[part],
                 base=log.base[part], closed=log.closed[part])], band=5.0,
    )  # fmt: skip
    share, mass = judged(found.model, found.fit)
    assert share > 0.85 and mass < 1.0
    for name, friction in zip(found.model.joints, BRUCE.motors.friction, strict=True):
        coulomb = found.values("coulomb")[name]
        assert abs(coulomb.value - friction) < 4.0 * coulomb.std
    assert any("a common factor on torque constants" in text for text in found.untold)
    assert not any("positions alone" in text for text in found.warnings)


@pytest.mark.long
def test_gains_on_positions_alone_are_told_from_a_robot(swayed):
    log, wrong = swayed
    part = slice(500, 3500)
    angles = log.position[part]
    held = replace(log, wrenches=None, position=angles, torque=-20.0 * (angles - angles.mean(axis=0)),
                   base=log.base[part], closed=log.closed[part])  # fmt: skip
    found = identify_dynamics(wrong, [held], band=5.0)
    told = [text for text in found.warnings if "a controller is identified, not the robot" in text]
    assert len(told) == len(found.model.joints)


def moving_log(torques: bool, wrenches: bool) -> MotionLog:
    """Return two seconds of sines, of which a second of standing on both feet; it holds no equations of motion."""
    time = 0.002 * np.arange(1200)[:, None]
    joints, base = np.arange(N) + 5.0, np.arange(6) + 7.0
    closed = np.tile((time > 1.0), (1, POINTS))
    return MotionLog(
        "sines", 0.002, 0.3 * np.sin(joints * time), 2.0 * np.cos(joints * time) if torques else None, None,
        np.add(np.sin(base * time), [0, 0, 0, 0, 0, 9.81]), closed=closed,
        wrenches=np.ones((1200, 2, 6)) * closed[:, :1, None] if wrenches else None,
    )  # fmt: skip


def test_equations_are_those_of_inverse_dynamics_with_rotors_geared_to_two_joints():
    coupled = BRUCE.rotor_matrix - np.diag(np.diag(BRUCE.rotor_matrix))
    assert np.abs(coupled).max() > 1e-4, "a motor of BRUCE moves two joints"
    model = DynamicsModel(BRUCE)
    log = moving_log(torques=True, wrenches=False)
    formed = model.form(replace(log, closed=np.zeros_like(log.closed)), 8.0)
    made, _ = model.predicted(model.mean, formed, 0)
    motion, free = formed.motions[0], pin.Model(model.links.model)
    free.armature = np.zeros(free.nv)
    data, whole = free.createData(), []
    for k, turns in enumerate(motion.acceleration):
        torque = pin.rnea(free, data, *model.links._states(motion, k)).copy()
        torque[6:] += BRUCE.rotor_matrix @ turns
        whole.append(torque)
    assert made == pytest.approx(formed.low(np.array(whole)), abs=1e-6)


@pytest.mark.parametrize("torques", [True, False])
def test_derivatives_by_the_unknowns_are_those_of_the_equations_left(torques):
    model = DynamicsModel(BRUCE, torques)
    log = moving_log(torques, wrenches=True)
    log.wrenches[:, 1] = np.nan  # one foot's is known, the other's is projected out
    formed = model.form(log, 8.0)
    rng = np.random.default_rng(3)
    value = model.mean * (1.0 + 0.05 * rng.normal(size=len(model.mean)))
    if torques:
        for kind, size in (
            ("coulomb", 0.2),
            ("log constant", 0.1),
            ("load", 0.05),
            ("offset", 0.1),
        ):
            value[model.part(kind)] = size * rng.uniform(0.5, 1.0, N)
        value[model.part("age of torques")] = 0.002
    made, jacobian = model.predicted(value, formed, 0)
    assert made.shape[1] == len(model.equations) == (6 + N if torques else 6)
    for kind in model.unknowns.at if torques else ("base", "accelerometer offset of"):
        k = model.part(kind.removesuffix(" of")).start
        size = max(1e-6, 1e-4 * abs(value[k]))
        high, low = (
            model.predicted(value + sign * size * np.eye(len(value))[k], formed, 0)[0]
            for sign in (1, -1)
        )
        scale = np.abs(jacobian[:, :, k]).max()
        assert jacobian[:, :, k] == pytest.approx((high - low) / (2 * size), abs=2e-3 * scale), kind


def flight(rng: np.random.Generator, duration: float = 6.0) -> tuple[np.ndarray, MotionLog]:
    """Return the base parameters of a drawn robot in free flight, whose mass is the description's, and its log without torques.

    By Pinocchio's articulated-body algorithm in its gravity, in steps of half a millisecond: joints follow sums of sines.
    """
    links = LinkRegressor(BRUCE)
    model = links.model
    whole = links.described_base[links.whole_mass]
    for k in range(1, model.njoints):
        old = model.inertias[k]
        size = np.exp(0.1 * rng.normal())
        mass = old.mass * np.exp(0.2 * rng.normal())
        model.inertias[k] = pin.Inertia(
            mass, old.lever + 0.005 * rng.normal(size=3), old.inertia * mass / old.mass * size
        )
    own = model.inertias[1]
    rest = whole - sum(model.inertias[k].mass for k in range(2, model.njoints))
    model.inertias[1] = pin.Inertia(rest, own.lever, own.inertia)
    truth = np.concatenate(
        [model.inertias[k].toDynamicParameters() for k in range(1, model.njoints)]
    )
    data, step = model.createData(), 5e-4
    q, v = pin.neutral(model), np.zeros(model.nv)
    rates, phases = rng.uniform(4, 11, (2, N)), rng.uniform(0, 2 * np.pi, (2, N))
    sizes, rows = np.array([[0.3], [0.2]]), []
    for k in range(round(duration / step)):
        angle = rates * k * step + phases
        wanted = (sizes * np.sin(angle)).sum(axis=0)
        speed = (sizes * rates * np.cos(angle)).sum(axis=0)
        torque = np.zeros(model.nv)
        torque[6:] = 8.0 * (wanted - q[7:]) + 0.4 * (speed - v[6:])
        a = pin.aba(model, data, q, v, torque)
        if k % 4 == 0:
            force = a[:3] + np.cross(
                v[3:6], v[:3]
            )  # no gravity in this model, nor in an IMU that falls
            rows.append(np.concatenate([q[7:], v[3:6], force]))
        v = v + step * a
        q = pin.integrate(model, q, step * v)
    table = np.array(rows)
    table += rng.normal(size=table.shape) * np.repeat([1e-4, 2e-3, 2e-2], [N, 3, 3])
    closed = np.zeros((len(table), POINTS), bool)
    log = MotionLog("flight", 4 * step, table[:, :N], None, None, table[:, N:], closed=closed)
    return links.lumped @ truth, log


def test_a_flight_without_torques_tells_what_the_mass_scales():
    truth, log = flight(np.random.default_rng(2))
    model, fit = fit_dynamics(BRUCE, [log], 5.0)
    part = model.part("base")
    std, error = np.sqrt(np.diag(fit.covariance))[part], np.abs(fit.value[part] - truth)
    told = std < 0.1 * fit.prior_std[part]
    assert told.sum() > 40, "of 80"
    assert np.median(error[told] / np.abs(model.mean[part] - truth)[told]) < 0.25
    assert (error < NINETY * std).mean() > 0.85
    mass = part.start + model.links.whole_mass
    assert fit.value[mass] == pytest.approx(BRUCE.total_mass, rel=3 * MASS_STD)


def test_what_a_log_of_a_floating_base_lacks_is_said():
    log = moving_log(torques=True, wrenches=False)
    with pytest.raises(
        IdentificationError,
        match="sines of bruce, whose base floats, has neither an IMU nor motion",
    ):
        missing(replace(log, base=None), BRUCE)
    with pytest.raises(
        IdentificationError, match="has no contacts, so nothing says when the ground's"
    ):
        missing(replace(log, closed=None), BRUCE)
    with pytest.raises(IdentificationError, match="bruce has a planar base, and inertias"):
        missing(log, BRUCE.changed(base_joint="planar"))
    assert missing(replace(log, torque=None), BRUCE) == [
        "friction, rotor inertia, torque constants and delay: a log without torques tells what the base's equations hold"
    ]


def test_standing_without_torques_or_forces_tells_nothing():
    log = moving_log(torques=False, wrenches=False)
    stands = replace(log, closed=np.ones_like(log.closed))
    with pytest.raises(
        IdentificationError,
        match=r"the ground's forces leave 0\.0% of the equations of sines.*contacts: force.*or jumps",
    ):
        fit_dynamics(BRUCE, [stands], 8.0)
    with pytest.raises(IdentificationError, match="of these logs only sines have torques"):
        fit_dynamics(BRUCE, [replace(log, name="quiet"), moving_log(True, False)], 8.0)


def test_too_little_motion_is_refused():
    rng, log = np.random.default_rng(0), moving_log(torques=False, wrenches=False)
    still = replace(
        log, position=1e-4 * rng.normal(size=log.position.shape), base=0.02 * rng.normal(size=log.base.shape),
        closed=np.zeros_like(log.closed),
    )  # fmt: skip
    with pytest.raises(IdentificationError, match="sines has too little motion: it tells no mass"):
        identify_dynamics(BRUCE, [still], band=14.0)
