"""The whole-body controller: optimality, physics, limits, priorities and what it does on failure."""

from __future__ import annotations

import re
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.control.whole_body_controller import (
    ActiveCalls,
    WholeBodyController,
    activate_calls,
    keep_solution,
)
from aloft.blocks.signals import Phase
from aloft.lab.benchmarks.full_program import FullProgram
from aloft.mathematics.whole_body_qp import ILL_POSED, NOT_FOUND, SOLVED
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.language.steps import PythonCall
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
WEIGHT = ROBOT.total_mass * 9.81
SUBSETS = [s for s in product([False, True], repeat=4) if any(s)]
LEVEL = [0.0, 0.0, 0.0, 1.0]


@pytest.fixture(scope="module")
def dynamics():
    return BlockBench(Dynamics, robot=ROBOT)


def model(dynamics, seed=None, speed=1.0):
    """The terms of standing still, or of a random state near it."""
    joints, velocity = ROBOT.standing_position.copy(), np.zeros(10)
    base, turn = np.zeros(3), np.zeros(3)
    if seed is not None:
        random = np.random.default_rng(seed)
        joints += random.uniform(-0.15, 0.15, 10)
        velocity = random.normal(size=10) * speed
        base, turn = random.normal(size=3) * 0.3 * speed, random.normal(size=3) * speed
    dynamics.set("base", position=[0.0, 0.0, 0.38], orientation=LEVEL)
    dynamics.set("base", linear_velocity=base, angular_velocity=turn)
    dynamics.set("joints", position=joints, velocity=velocity)
    dynamics.step()
    return {name: array.copy() for name, array in dynamics.get("terms")}


def make(terms, *, phase=Phase.STAND, stance=(True,) * 4, target=None, **params):
    bench = BlockBench(WholeBodyController, params, robot=ROBOT)
    feed(bench, terms, phase=phase, stance=stance, target=target)
    return bench


def feed(bench, terms, *, phase=Phase.STAND, stance=(True,) * 4, target=None):
    bench.set("terms", **terms)
    bench.set("joints", velocity=terms["velocity"][6:])
    bench.set("phase", phase=phase, stance=list(stance))
    wanted = {"com": terms["com"], "orientation": LEVEL, **(target or {})}
    bench.set("target", **wanted)


def solve(terms, **keywords):
    bench = make(terms, **keywords)
    bench.step()
    command = bench.get("command")
    assert bool(command.solved)
    return {name: array.copy() for name, array in command}, bench


def residual(terms, command):
    """M a + h - S' tau - sum J' f over all rows."""
    left = terms["mass_matrix"] @ command["acceleration"] + terms["nonlinear_effects"]
    left[6:] -= command["torque"]
    return left - np.einsum("ikn,ik->n", terms["contact_jacobian"], command["force"])


def cost(bench, command, active):
    """The program's cost, recomputed from its own matrices."""
    block = bench.block
    program = FullProgram(block).assemble(active)
    x = np.concatenate([command["acceleration"], command["force"][active].ravel()])
    return 0.5 * x @ program.cost.hessian @ x + program.cost.gradient @ x, program, x


def test_machine_code_and_plain_python_give_the_same_bytes(dynamics):
    compiled, plain = (BlockBench(WholeBodyController, robot=ROBOT, plain=p) for p in (False, True))
    assert compiled.block._solve.compiled is not None
    assert plain.block._solve.compiled is None
    for seed, stance in enumerate(SUBSETS[::5]):
        terms, phase = model(dynamics, seed, 2.0), (Phase.STAND, Phase.THRUST)[seed % 2]
        for bench in (compiled, plain):
            feed(bench, terms, phase=phase, stance=stance)
            bench.step()
        assert compiled.get("command").solved
        one, other = compiled.snapshot(), plain.snapshot()
        assert (one.bus, one.state) == (other.bus, other.state)


@pytest.mark.parametrize("stance", SUBSETS)
@pytest.mark.parametrize("limits", ["none", "joint", "motor"])
def test_every_stance_obeys_the_dynamics_the_cones_and_the_limits(dynamics, stance, limits):
    terms = model(dynamics, seed=sum(stance))
    target = {"com_acceleration": [2.0, 1.0, 15.0]}
    command, _ = solve(
        terms, phase=Phase.LANDING, stance=stance, target=target, limits=limits, torque_margin=0.5
    )
    assert np.abs(residual(terms, command)).max() < 1e-6
    force = command["force"]
    for point, loaded in enumerate(stance):
        if not loaded:
            assert (force[point] == 0.0).all()
        assert np.abs(force[point, :2]).max() <= 0.5 * force[point, 2] + 1e-6
        assert -1e-6 <= force[point, 2] <= 400.0 + 1e-6
    if limits == "joint":
        assert np.abs(command["torque"]).max() <= 0.5 * 10.5 + 1e-6
    if limits == "motor":
        motor = ROBOT.torque_to_motor @ command["torque"]
        assert np.abs(motor).max() <= 0.5 * 10.5 + 1e-6


@pytest.mark.long
@given(st.integers(0, 10_000), st.sampled_from(SUBSETS), st.sampled_from(list(Phase)[:6]))
@settings(max_examples=40, deadline=None)
def test_two_solvers_find_the_same_optimum(dynamics, seed, stance, phase):
    terms = model(dynamics, seed, speed=3.0)
    target = {"com_acceleration": [1.0, -1.0, 8.0], "angular_momentum_rate": [0.1, 1.0, 0.0]}
    first, bench = solve(terms, phase=phase, stance=stance, target=target)
    second, _ = solve(terms, phase=phase, stance=stance, target=target, solver="quadprog")
    active = np.flatnonzero(stance)
    best, program, x = cost(bench, first, active)
    other, _, _ = cost(bench, second, active)
    assert other == pytest.approx(best, rel=1e-9, abs=1e-6)
    assert second["torque"] == pytest.approx(first["torque"], abs=1e-4)
    # Optimality: minus the gradient is a combination of the active rows, pushing outwards.
    slack = program.inequality.bound - program.inequality.matrix @ x
    assert slack.min() > -1e-6
    tight = program.inequality.matrix[slack < 1e-6]
    basis = np.vstack([program.equality.matrix, tight])
    gradient = program.cost.hessian @ x + program.cost.gradient
    multipliers = np.linalg.lstsq(basis.T, -gradient, rcond=None)[0]
    size = 1.0 + np.abs(program.cost.gradient).max()
    assert np.abs(basis.T @ multipliers + gradient).max() < 1e-7 * size
    assert np.abs(program.equality.matrix @ x - program.equality.bound).max() < 1e-7


def test_motor_limits_follow_the_speed(dynamics):
    """At a speed between corner and no-load a motor drives with less and brakes with all."""
    terms = model(dynamics)
    terms["velocity"][9] = 24.0  # the right knee extends; the ankle motor turns as fast
    target = {"com_acceleration": [0.0, 0.0, 60.0]}
    command, _ = solve(terms, phase=Phase.THRUST, target=target)
    motor = ROBOT.torque_to_motor @ command["torque"]
    speed = ROBOT.joint_to_motor @ terms["velocity"][6:]
    half = 0.97 * 10.5 * (30.0 - 24.0) / (30.0 - 18.0)
    for value, turning in zip(motor, speed, strict=True):
        most = half if value * turning > 0.0 else 0.97 * 10.5
        assert abs(value) <= most + 1e-6
    assert np.abs(motor[3]) == pytest.approx(half, abs=1e-6)


def test_standing_still_it_carries_the_weight_and_accelerates_nothing(dynamics):
    terms = model(dynamics)
    command, _ = solve(terms)
    assert np.abs(command["acceleration"]).max() < 0.05
    assert command["force"].sum(axis=0) == pytest.approx([0.0, 0.0, WEIGHT], abs=0.05)
    # The same torques as the static ones of these forces.
    static = terms["nonlinear_effects"][6:] - np.einsum(
        "ikn,ik->n", terms["contact_jacobian"][:, :, 6:], command["force"]
    )
    assert command["torque"] == pytest.approx(static, abs=0.05)


def test_left_and_right_mirror(dynamics):
    terms = model(dynamics)
    command, _ = solve(terms, target={"com_acceleration": [0.5, 0.0, 2.0]})
    mirror = np.array([-1.0, 1.0, -1.0, 1.0, 1.0])
    assert command["torque"][5:] == pytest.approx(mirror * command["torque"][:5], abs=1e-6)


def test_the_centre_of_mass_is_accelerated_as_asked(dynamics):
    """x = a_ref + K_p (p_ref - p) + K_d (v_ref - v), to the accuracy soft tasks give."""
    terms = model(dynamics)
    target = {
        "com": terms["com"] + [0.002, -0.001, 0.01],
        "com_velocity": [0.02, 0.0, 0.05],
        "com_acceleration": [0.1, 0.2, 1.0],
    }
    command, _ = solve(terms, target=target, torque_margin=1.0)
    found = command["force"].sum(axis=0) / ROBOT.total_mass - [0.0, 0.0, 9.81]
    wanted = 100.0 * np.array([0.002, -0.001, 0.01]) + 20.0 * np.array([0.02, 0.0, 0.05])
    assert found == pytest.approx(np.add(wanted, [0.1, 0.2, 1.0]), rel=0.02, abs=0.02)


def test_the_torso_turns_towards_its_target(dynamics):
    terms = model(dynamics)
    turned = [0.0, np.sin(0.05), 0.0, np.cos(0.05)]
    command, _ = solve(terms, target={"orientation": turned})
    assert command["acceleration"][4] == pytest.approx(200.0 * 0.1, rel=0.1)


def test_priorities_stance_then_momentum_then_torso(dynamics):
    """Asked for what cannot be had together, the heavier task keeps more of it."""
    terms = model(dynamics)
    turned = [0.0, np.sin(0.4), 0.0, np.cos(0.4)]
    wanted = 200.0 * 0.8
    command, _ = solve(terms, target={"orientation": turned, "com_acceleration": [3.0, 0.0, 0.0]})
    stance = terms["contact_jacobian"] @ command["acceleration"] + terms["contact_drift"]
    com = command["force"].sum(axis=0) / ROBOT.total_mass - [0.0, 0.0, 9.81]
    lost_torso = abs(command["acceleration"][4] - wanted) / wanted
    lost_com = abs(com[0] - 3.0) / 3.0
    assert np.abs(stance).max() < 0.1 * wanted
    heavy, _ = solve(
        terms,
        target={"orientation": turned, "com_acceleration": [3.0, 0.0, 0.0]},
        stand={"torso_weight": [1e4] * 3},
    )
    assert abs(heavy["acceleration"][4] - wanted) / wanted < lost_torso
    com = heavy["force"].sum(axis=0) / ROBOT.total_mass - [0.0, 0.0, 9.81]
    assert abs(com[0] - 3.0) / 3.0 > lost_com


def test_damping_or_tracking_angular_momentum(dynamics):
    terms = model(dynamics, seed=3)
    rates = {}
    for track in (False, True):
        gains = {
            "angular_weight": [1e6] * 3, "angular_damping": [5.0] * 3, "torso_weight": [0.0] * 3,
            "linear_weight": [0.0] * 3, "track_angular_momentum": track,
        }  # fmt: skip
        target = {"angular_momentum": [0.0, 0.02, 0.0], "angular_momentum_rate": [0.0, 0.3, 0.0]}
        command, _ = solve(terms, target=target, stand=gains, limits="none")
        rates[track] = (
            terms["centroidal_matrix"][3:] @ command["acceleration"] + terms["centroidal_drift"][3:]
        )
    k = terms["angular_momentum"]
    assert rates[False] == pytest.approx(-5.0 * k, abs=0.02)
    assert rates[True] == pytest.approx(
        np.array([0.0, 0.3, 0.0]) + 5.0 * (np.array([0.0, 0.02, 0.0]) - k), abs=0.02
    )


def test_a_hovering_point_falls_to_the_height_of_the_others(dynamics):
    terms = model(dynamics)
    terms["contact_position"][3, 2] += 0.004
    command, _ = solve(
        terms,
        phase=Phase.LANDING,
        stance=(True, True, True, False),
        landing={"swing_weight": 1e3},
    )
    drop = terms["contact_jacobian"][3] @ command["acceleration"]
    assert drop[2] == pytest.approx(-3000.0 * 0.004, rel=0.3)


def test_the_ankle_of_a_foot_on_its_toes_follows_the_plan(dynamics):
    """Feedforward and feedback, while the other foot's ankle does what keeps it flat."""
    terms = model(dynamics)
    joints = [joint.name for joint in ROBOT.joints]
    ankle = joints.index("left_ankle")
    planned, rates, bends = ROBOT.standing_position.copy(), np.zeros(10), np.zeros(10)
    planned[ankle] += 0.01
    rates[ankle], bends[ankle] = 0.5, -40.0
    target = {"joint_position": planned, "joint_velocity": rates, "joint_acceleration": bends}
    stance = [True] * 4
    stance[[c.name for c in ROBOT.contacts].index("left_heel")] = False
    bench = make(terms, phase=Phase.THRUST, stance=stance, target=target)
    bench.set("joints", position=ROBOT.standing_position)
    bench.step()
    acceleration = bench.get("command").acceleration
    assert acceleration[6 + ankle] == pytest.approx(-40.0 + 1000.0 * 0.01 + 60.0 * 0.5, abs=1.0)
    heel = terms["contact_jacobian"][[c.name for c in ROBOT.contacts].index("right_heel")]
    assert np.abs(heel @ acceleration).max() < 0.1


def test_in_the_air_it_asks_for_nothing(dynamics):
    terms = model(dynamics)
    bench = make(terms)
    bench.step()
    assert np.abs(bench.get("command").torque).max() > 0.1
    feed(bench, terms, phase=Phase.FLIGHT, stance=(False,) * 4)
    bench.step()
    command = bench.get("command")
    assert bool(command.solved)
    for name in ("torque", "acceleration", "force"):
        assert (getattr(command, name) == 0.0).all()


def test_the_fallback_is_the_defined_one(dynamics):
    terms = model(dynamics)
    bench = make(terms, fallback_ticks=3, fallback_decay=0.8)
    bench.step()
    command = bench.get("command")
    last = command.torque.copy()
    block = bench.block
    own = block._solve
    block._solve = PythonCall(lambda code: code.fill(NOT_FOUND), (block._code,))
    block._arrange()
    for failed in (1, 2, 3):
        bench.step()
        assert command.torque == pytest.approx(0.8**failed * last, abs=1e-12)
        assert not bool(command.solved)
        assert int(command.failures) == failed
        assert (command.force == 0.0).all()
    bench.step()
    quarter = np.array([0.0, 0.0, WEIGHT / 4.0])
    wanted = terms["nonlinear_effects"][6:] - sum(
        terms["contact_jacobian"][i, :, 6:].T @ quarter for i in range(4)
    )
    assert command.torque == pytest.approx(wanted, abs=1e-10)
    assert command.force == pytest.approx(np.tile(quarter, (4, 1)))
    assert int(command.failures) == 4
    block._solve = own
    block._arrange()
    bench.step()
    assert bool(command.solved) and int(command.failures) == 4
    assert command.torque.tolist() == last.tolist()


def test_the_fallback_survives_a_snapshot(dynamics):
    bench = make(model(dynamics))
    bench.step()
    block = bench.block
    block._solve = PythonCall(lambda code: code.fill(NOT_FOUND), (block._code,))
    block._arrange()
    bench.step(2)
    snapshot = bench.snapshot()
    bench.step()
    wanted = bench.get("command").torque.copy()
    bench.step(3)
    bench.restore(snapshot)
    bench.step()
    assert (bench.get("command").torque == wanted).all()


def test_errors_name_the_fix(dynamics):
    with pytest.raises(BlockError, match=r"no quadratic-program solver 'magic'.*daqp"):
        BlockBench(WholeBodyController, {"solver": "magic"}, robot=ROBOT)
    for task, message in {
        "Torso": "no task called 'Torso'; did you mean TorsoOrientation?",
        "nowhere:Task": "task nowhere:Task: there is no module 'nowhere'",
        "math:pi": "task math:pi: pi does not derive from Task",
        "aloft.blocks.control.tasks:Task": "does not define step, size",
    }.items():
        with pytest.raises(BlockError, match=re.escape(message)):
            BlockBench(WholeBodyController, {"tasks": [task]}, robot=ROBOT)
    entry = {"task": "LinearMomentum", "gains": {"weight": 3.0}}
    with pytest.raises(
        BlockError, match=r"LinearMomentum: gain 'weight':.*linear_weight, linear_st"
    ):
        BlockBench(WholeBodyController, {"tasks": [entry]}, robot=ROBOT)


def test_a_graph_chooses_the_tasks_and_their_gains(dynamics):
    """Without the torso's task its orientation does not matter; an entry has gains of its own."""
    terms = model(dynamics)
    turned = {"orientation": [0.0, np.sin(0.1), 0.0, np.cos(0.1)]}
    few = ["ContactPoints", "LinearMomentum", "AngularMomentum"]
    without, _ = solve(terms, target=turned, tasks=few)
    level, _ = solve(terms, tasks=few)
    assert (without["torque"] == level["torque"]).all()
    stiff = {"task": "TorsoOrientation", "gains": {"torso_stiffness": [50.0] * 3}}
    entry = {**stiff, "thrust": {"torso_stiffness": [400.0] * 3}}
    heavy = {"torso_weight": [1e6] * 3}
    for phase, stiffness in ((Phase.STAND, 50.0), (Phase.THRUST, 400.0)):
        command, _ = solve(
            terms, target=turned, tasks=["ContactPoints", entry], phase=phase, limits="none",
            stand=heavy, thrust=heavy,
        )  # fmt: skip
        assert command["acceleration"][4] == pytest.approx(stiffness * 0.2, rel=0.02)


def test_the_default_force_limit_follows_the_robots_weight(dynamics):
    bench = make(model(dynamics))
    bench.step()
    assert bench.block._weights.force_max[0] == pytest.approx(8.0 * WEIGHT)


@pytest.mark.parametrize("phase", list(Phase))
@pytest.mark.parametrize("stance", [[False, False], [False, True]])
def test_one_kind_of_gains_is_active_where_a_point_is_in_stance(phase, stance) -> None:
    active = ActiveCalls(*(np.full(1, 7) for _ in ActiveCalls._fields))
    activate_calls(SimpleNamespace(phase=np.array(int(phase)), stance=np.array(stance)), active)
    kind = "thrust" if phase == Phase.THRUST else "landing" if phase > Phase.THRUST else "stand"
    expected = {kind: 1, "loaded": 1} if any(stance) else {}
    assert {name: int(each[0]) for name, each in active._asdict().items() if each[0]} == expected


def solution_after(loaded: int, code: int):
    command = SimpleNamespace(
        torque=np.array([3.0, 4.0]), acceleration=np.ones(3), force=np.ones((2, 3)),
        solved=np.array(False), failures=np.array(-1),
    )  # fmt: skip
    memory = SimpleNamespace(torque=np.array([1.0, 2.0]), failed=np.array(2), failures=np.array(5))
    unsolved = np.full(1, 7)
    keep_solution(np.array([loaded]), np.array([code]), command, memory, unsolved)
    return command, memory, int(unsolved[0])


def test_a_solution_is_remembered() -> None:
    command, memory, unsolved = solution_after(1, SOLVED)
    assert unsolved == 0 and bool(command.solved)
    assert memory.torque.tolist() == command.torque.tolist() == [3.0, 4.0]
    assert (int(memory.failed), int(memory.failures), int(command.failures)) == (0, 5, 5)


def test_without_a_point_in_stance_everything_is_zero_and_counts_as_solved() -> None:
    command, memory, unsolved = solution_after(0, ILL_POSED)
    assert unsolved == 0 and bool(command.solved)
    for array in (command.torque, command.acceleration, command.force, memory.torque):
        assert not array.any()
    assert (int(memory.failed), int(memory.failures), int(command.failures)) == (0, 5, 5)


def test_without_a_solution_python_is_asked_and_nothing_changes() -> None:
    command, memory, unsolved = solution_after(1, ILL_POSED)
    assert unsolved == 1 and not bool(command.solved)
    assert memory.torque.tolist() == [1.0, 2.0] and command.torque.tolist() == [3.0, 4.0]
    assert (int(memory.failed), int(memory.failures), int(command.failures)) == (2, 5, -1)
