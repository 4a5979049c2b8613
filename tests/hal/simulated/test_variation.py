"""Bodies, soles, switches and surroundings differ as they are told to, by the seed only."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aloft.hal.simulated.effects import SwitchEffects
from aloft.hal.simulated.mujoco_model import build_world
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.simulated.state import PhysicsState
from aloft.hal.simulated.switch_effects import SwitchDelays
from aloft.hal.simulated.variation import draw_variation
from aloft.robots.description import find_robot

from ...simulator_settings import grouped
from .simulated_bruce import bench, hold
from .test_drive_effects import SIZES

ROBOT = find_robot("bruce")
WEIGHT = 5.118 * 9.81
"""N"""


def world(**params: Any) -> Any:
    chosen = SimulatorParameters.model_validate(grouped(params))
    return build_world(chosen, ROBOT, draw_variation(chosen, ROBOT))


def test_links_differ_each_by_itself() -> None:
    nominal, other = world(), world(
        seed=2, links={"mass_spread": 0.1, "com_spread": 0.005, "inertia_spread": 0.2}
    )  # fmt: skip
    mass = other.body_mass[1:] / nominal.body_mass[1:]
    assert len(set(mass.round(9))) == len(mass) and (abs(mass - 1.0) <= 0.1).all()
    moved = other.body_ipos[1:] - nominal.body_ipos[1:]
    assert (abs(moved) <= 0.005 + 1e-12).all() and (moved != 0.0).all()
    inertia = other.body_inertia[1:] / nominal.body_inertia[1:] / mass[:, None]
    assert (abs(inertia - 1.0) <= 0.2 + 1e-9).all()
    np.testing.assert_allclose(inertia, inertia[:, :1].repeat(3, axis=1), rtol=1e-6)


def test_links_are_longer_in_all_directions() -> None:
    nominal, other = world(), world(seed=2, links={"length_spread": 0.02})
    variation = draw_variation(
        SimulatorParameters.model_validate(grouped({"seed": 2, "links": {"length_spread": 0.02}})),
        ROBOT,
    )
    factor = np.array([1.0, *variation.link_length])  # of the world and of the links
    assert len(set(variation.link_length)) == len(ROBOT.links)
    assert (abs(factor - 1.0) <= 0.02).all()
    bodies = [nominal.body("base").id if name == "base" else nominal.body(name).id for name in (
        link.name for link in ROBOT.links)]  # fmt: skip
    of_body = dict(zip(bodies, factor[1:], strict=True))
    for body in bodies:
        np.testing.assert_allclose(
            other.body_ipos[body], of_body[body] * nominal.body_ipos[body], atol=1e-12
        )
        np.testing.assert_allclose(
            other.body_inertia[body], of_body[body] ** 2 * nominal.body_inertia[body], rtol=1e-6
        )
        parent = nominal.body_parentid[body]
        if parent:
            longer = of_body[int(parent)] * nominal.body_pos[body]
            np.testing.assert_allclose(other.body_pos[body], longer, atol=1e-12)
    for contact in ROBOT.contacts:
        body = int(nominal.site(contact.name).bodyid[0])
        place = of_body[body] * np.array(contact.position)
        np.testing.assert_allclose(other.site(contact.name).pos, place, atol=1e-12)
        centre = other.geom(contact.name).pos - other.site(contact.name).pos
        np.testing.assert_allclose(centre, [0.0, 0.0, contact.radius], atol=1e-12)
    np.testing.assert_allclose(other.body_mass, nominal.body_mass)


def test_on_legs_of_different_length_a_robot_stands_on_all_points() -> None:
    for seed in range(4):
        robot = bench(seed=seed, links={"length_spread": 0.01})
        hold(robot)
        robot.step(100)
        robot.block.emit()
        assert (robot.get("truth").contact_force[:, 2] > 2.0).all()
    metrics = robot.block.metrics()
    assert 0.99 <= metrics["robot_least_link_length"] < metrics["robot_largest_link_length"] <= 1.01


def test_joints_and_rotors_differ() -> None:
    nominal = world()
    other = world(joints={"friction_spread": 0.3, "rotor_inertia": 1.5})
    joints = slice(nominal.nv - len(ROBOT.joints), None)
    factor = other.dof_frictionloss[joints] / nominal.dof_frictionloss[joints]
    assert len(set(factor.round(9))) == len(factor) and (abs(factor - 1.0) <= 0.3).all()
    np.testing.assert_allclose(other.dof_damping[joints] / nominal.dof_damping[joints], factor)
    np.testing.assert_allclose(other.dof_armature, 1.5 * nominal.dof_armature)
    np.testing.assert_allclose(other.tendon_armature, 1.5 * nominal.tendon_armature)


def test_what_has_no_spread_is_drawn_as_before() -> None:
    """An effect that is on changes no other draw."""
    usual = {"mass_spread": 0.05, "friction_range": [0.5, 1.0], "base_com_spread": 0.01, "seed": 9}
    first = draw_variation(SimulatorParameters.model_validate(grouped(usual)), ROBOT)
    more = {**usual, "links": {"mass_spread": 0.1}, "imu": {"position_spread": 0.01}}
    second = draw_variation(SimulatorParameters.model_validate(grouped(more)), ROBOT)
    assert second.link_mass and not first.link_mass
    for name in ("friction", "mass", "base_com_offset", "contact_stiffness"):
        assert getattr(first, name) == getattr(second, name)


def test_soles_sink_in_as_their_time_constant_says() -> None:
    depths = []
    for soles in (None, {"time_constant": 0.016}):
        robot = bench(**({"soles": soles} if soles else {}))
        hold(robot)
        robot.step(250)
        robot.block.emit()
        depths.append(-robot.get("truth").contact_position[:, 2].mean())
    assert depths[1] > 4.0 * depths[0] > 0.0


def test_gravity_leans_with_the_floor() -> None:
    model = world(floor_tilt=0.1, seed=4)
    x, y, z = model.opt.gravity
    assert math.hypot(x, y) == pytest.approx(9.81 * math.sin(0.1), rel=1e-3)
    assert z == pytest.approx(-9.81 * math.cos(0.1), rel=1e-3)
    assert tuple(world(floor_tilt=0.1, seed=5).opt.gravity) != (x, y, z)


def test_a_cable_pulls_and_hangs_on_the_robot() -> None:
    loads = []
    for cable in (None, {"pull": 2.0 / WEIGHT, "weight": 3.0 / WEIGHT}):
        robot = bench(**({"cable": cable} if cable else {}))
        hold(robot)
        robot.step(1500)
        robot.block.emit()
        loads.append(robot.get("truth").contact_force.sum(axis=0).copy())
    difference = loads[1] - loads[0]
    assert difference[2] == pytest.approx(3.0, abs=0.05)
    assert math.hypot(*difference[:2]) == pytest.approx(2.0, abs=0.05)


def test_a_cable_adds_to_a_push() -> None:
    robot = bench(cable={"pull": 0.0, "weight": 3.0 / WEIGHT})
    hold(robot)
    robot.set("push", force=[0.0, 0.0, -5.0], point=0)
    robot.step(250)
    robot.block.emit()
    weight = robot.get("truth").contact_force.sum(axis=0)[2]
    assert weight == pytest.approx(WEIGHT + 8.0, abs=0.1)


def test_switches_close_late_and_open_later() -> None:
    step = 0.0005
    memory = PhysicsState.allocate({**SIZES, "n_late_switches": 2})
    effects = SwitchEffects.model_validate({"debounce": 0.002, "sticking": 0.003})
    switches = SwitchDelays(effects, step, memory)
    switches.begin(np.zeros(len(ROBOT.joints)))
    pressed = np.array([False, False])
    call = switches.settle_call(pressed)
    seen = []
    for k in range(60):
        pressed[0] = 10 <= k < 30
        pressed[1] = k % 3 == 0  # bounces for ever: a debounced switch says nothing
        call.run()
        seen.append(tuple(switches.closed.tolist()))
    closed = [k for k in range(60) if seen[k][0]]
    assert closed == list(range(14, 40))
    assert not any(other for _, other in seen)
