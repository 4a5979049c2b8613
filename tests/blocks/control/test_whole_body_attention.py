"""What of the whole-body controller's step is left to Python: failures, and tasks without a kernel."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.control.tasks.contact_points import ContactPoints
from aloft.blocks.control.whole_body_controller import WholeBodyController
from aloft.blocks.signals import Phase
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.kernel import kernel
from aloft.mathematics.whole_body_qp import ILL_POSED
from aloft.robots.description import find_robot
from aloft.runtime.language.steps import call_of
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")


def model(seed=None):
    """The terms of standing still, or of a random state near it."""
    bench, joints = BlockBench(Dynamics, robot=ROBOT), ROBOT.standing_position.copy()
    if seed is not None:
        random = np.random.default_rng(seed)
        joints += random.uniform(-0.15, 0.15, len(joints))
        bench.set("base", linear_velocity=random.normal(size=3) * 0.3)
        bench.set("joints", velocity=random.normal(size=len(joints)))
    bench.set("base", position=[0.0, 0.0, 0.38], orientation=[0.0, 0.0, 0.0, 1.0])
    bench.set("joints", position=joints)
    bench.step()
    return {name: array.copy() for name, array in bench.get("terms")}


def feed(bench, terms, phase=Phase.STAND):
    bench.set("terms", **terms)
    bench.set("joints", velocity=terms["velocity"][6:])
    bench.set("phase", phase=phase, stance=[True] * 4)
    bench.set("target", com=terms["com"], orientation=[0.0, 0.0, 0.0, 1.0])


@kernel
def give_up(code):
    code[0] = ILL_POSED


def failing(block):
    """The calls of a step in which the solver finds no solution."""
    fails = KernelCall(give_up, block._code)
    fails.when = block._solve.when
    return tuple(fails if call is block._solve else call for call in block.kernel_calls)


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize(
    "params", [{"solver": "daqp"}, {"solver": "clarabel", "cones": "round"}, {"cones": "round"}]
)
def test_where_a_solver_fails_another_follows(plain, params):
    bench = BlockBench(WholeBodyController, params, robot=ROBOT, plain=plain)
    feed(bench, model())
    bench.step()
    block, command = bench.block, bench.get("command")
    last = command.torque.copy()
    block.kernel_calls = failing(block)
    bench.step()
    assert bool(command.solved) and int(command.failures) == 0
    assert command.torque == pytest.approx(last, abs=1e-4)  # standing needs no friction


def test_pyramids_inside_the_cones_follow_where_round_cones_fail():
    bench = BlockBench(WholeBodyController, {"cones": "round", "friction": 0.05}, robot=ROBOT)
    feed(bench, model())
    # more than friction allows
    bench.set("target", com_acceleration=[6.0, 0.0, 0.0])
    block, command = bench.block, bench.get("command")
    for calls, share in ((block.kernel_calls, 1.0), (failing(block), np.sqrt(0.5))):
        block.kernel_calls = calls
        bench.step()
        assert bool(command.solved)
        along, normal = np.abs(command.force[:, :2]), 0.05 * command.force[:, 2]
        assert (np.linalg.norm(along, axis=1) <= normal + 1e-6).all()
        loaded = normal > 0.1
        assert (along.max(axis=1) / normal)[loaded].max() == pytest.approx(share, abs=1e-3)
    assert (along <= np.sqrt(0.5) * normal[:, None] + 1e-8).all()


@pytest.mark.parametrize("plain", [False, True])
def test_where_nothing_finds_a_solution_the_torque_is_held(plain):
    bench = BlockBench(WholeBodyController, robot=ROBOT, plain=plain)
    feed(bench, model())
    bench.step()
    block, command = bench.block, bench.get("command")
    last = command.torque.copy()
    own = tuple(block.kernel_calls)
    block.kernel_calls = failing(block)
    for failed in (1, 2):
        bench.step()
        assert not bool(command.solved) and int(command.failures) == failed
        assert command.torque == pytest.approx(0.9**failed * last, abs=1e-12)
    bench.set("phase", phase=Phase.FLIGHT, stance=[False] * 4)
    bench.step()
    assert bool(command.solved) and int(command.failures) == 2 and not command.torque.any()
    feed(bench, model())
    bench.step()
    assert int(command.failures) == 3 and not command.torque.any()  # what is held is zero now
    block.kernel_calls = own
    bench.step()
    assert bool(command.solved) and int(command.failures) == 3 and command.torque.any()


class SlowContactPoints(ContactPoints):
    """The task as Python writes it, so that the controller's step is no chain of kernels."""

    @staticmethod
    def step(contacts: KernelCall):
        contacts.run()

    def setup(self):
        super().setup()
        self.contacts = call_of(self, ContactPoints.step)


@pytest.mark.parametrize("phase", [Phase.STAND, Phase.THRUST, Phase.LANDING])
def test_tasks_in_python_give_the_same_bytes(phase):
    others = ["LinearMomentum", "TorsoOrientation", "AngularMomentum", "Posture"]
    found = []
    for first in ("ContactPoints", f"{__name__}:SlowContactPoints"):
        bench = BlockBench(WholeBodyController, {"tasks": [first, *others]}, robot=ROBOT)
        feed(bench, model(3), phase)
        compiled = all(call.compiled is not None for call in bench.block.kernel_calls)
        assert compiled == (first == "ContactPoints")
        bench.step()
        assert bool(bench.get("command").solved)
        snapshot = bench.snapshot()
        found.append((snapshot.bus, snapshot.state))
        bench.set("phase", phase=Phase.FLIGHT, stance=[False] * 4)
        bench.step()
        assert bool(bench.get("command").solved) and not bench.get("command").torque.any()
    assert found[0] == found[1]
