"""Nothing wrong: the command unchanged. Anything wrong: damping, for good, with the reason."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.safety_monitor import Fault, SafetyMonitor
from aloft.blocks.signals import CommandMode
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
COMMAND = {
    "mode": int(CommandMode.ACTIVE),
    "torque": np.arange(10.0),
    "position": np.linspace(-1.0, 1.0, 10),
    "velocity": np.linspace(-2.0, 2.0, 10),
    "stiffness": np.full(10, 40.0),
    "damping": np.full(10, 1.0),
}


def leaning(angle):
    return [0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)]


@pytest.fixture
def bench():
    return make()


def make(**params):
    bench = BlockBench(
        SafetyMonitor, {"damping": 0.5, "speed_limit": 60.0, **params}, robot="bruce"
    )
    bench.set("desired", **COMMAND)
    bench.set("base", orientation=leaning(0.1), position=[0.0, 0.0, 0.38])
    bench.set("joints", position=ROBOT.standing_position)
    bench.set("wbc", solved=True)
    return bench


def fault(bench):
    return Fault(int(bench.get("state").fault))


def assert_damps(bench, reason):
    assert fault(bench) == reason
    command = bench.get("command")
    assert command.mode == CommandMode.DAMPING
    assert not command.torque.any() and not command.stiffness.any() and not command.velocity.any()
    assert (command.damping == 0.5).all()
    assert all(np.isfinite(values).all() for _, values in command)
    assert bench.block.metrics()["safety_fault"] == reason.name.lower()


def test_passes_the_command_unchanged(bench):
    bench.step(100)
    for name, value in COMMAND.items():
        assert np.array_equal(getattr(bench.get("command"), name), value)
    assert bench.block.metrics() == {"safety_fault": "none"}


def test_tilt_must_last(bench):
    bench.set("base", orientation=leaning(1.3))
    bench.step(10)
    assert fault(bench) == Fault.NONE
    bench.set("base", orientation=leaning(1.1))
    bench.step()
    bench.set("base", orientation=leaning(1.3))
    bench.step(10)
    assert fault(bench) == Fault.NONE
    bench.step()
    assert_damps(bench, Fault.TILT)


def test_damping_is_for_good_and_the_first_reason_stays(bench):
    bench.set("base", orientation=leaning(2.0))
    bench.step(11)
    bench.set("base", orientation=leaning(0.0))
    bench.set("desired", torque=np.nan)
    bench.step(50)
    assert_damps(bench, Fault.TILT)
    assert bench.block.metrics()["safety_fault_time_s"] == pytest.approx(10 / 500)


def test_a_joint_beyond_its_limit(bench):
    position = ROBOT.standing_position.copy()
    position[3] = ROBOT.joint_limits[3, 0] - 0.06
    bench.set("joints", position=position)
    bench.step(10)
    assert fault(bench) == Fault.NONE
    bench.step()
    assert_damps(bench, Fault.JOINT_LIMIT)


def test_different_joints_in_turn_are_not_one_that_stays_beyond(bench):
    for tick in range(40):
        position = ROBOT.standing_position.copy()
        position[3 if tick % 2 else 8] = ROBOT.joint_limits[3, 0] - 0.06
        bench.set("joints", position=position)
        bench.step()
    assert fault(bench) == Fault.NONE


def test_limits_and_damping_follow_from_the_motors_or_are_given_by_joint():
    bench = BlockBench(SafetyMonitor, robot="bruce")
    peak = np.abs(ROBOT.joint_to_motor).T @ ROBOT.motors.peak_torque
    bench.set("wbc", solved=True)
    bench.set("base", orientation=leaning(0.0))
    for torque, reason in ((9.9 * peak, Fault.NONE), (10.1 * peak, Fault.ABSURD_COMMAND)):
        bench.set("desired", **{**COMMAND, "torque": torque})
        bench.step()
        assert fault(bench) == reason
    assert bench.get("command").damping == pytest.approx(peak / 20.0)
    patterns = {"*": 60.0, "*_knee": 5.0}
    for joint, reason in ((2, Fault.NONE), (3, Fault.JOINT_SPEED)):
        bench = make(speed_limit=patterns)
        velocity = np.zeros(10)
        velocity[joint] = 6.0
        bench.set("joints", velocity=velocity)
        bench.step(11)
        assert fault(bench) == reason


def test_a_joint_without_limits_is_never_beyond_them():
    free = ROBOT.changed(joints=tuple(j.model_copy(update={"limits": None}) for j in ROBOT.joints))
    bench = BlockBench(SafetyMonitor, robot=free)
    bench.set("desired", **COMMAND)
    bench.set("base", orientation=leaning(0.0))
    bench.set("wbc", solved=True)
    bench.set("joints", position=np.full(10, 50.0))
    bench.step(100)
    assert fault(bench) == Fault.NONE


def test_a_joint_too_fast(bench):
    bench.set("joints", velocity=np.r_[np.zeros(9), -61.0])
    bench.step(11)
    assert_damps(bench, Fault.JOINT_SPEED)


def test_readings_that_stop_changing():
    bench = make(stale_ticks=5)
    for tick in range(20):
        bench.set("joints", velocity=1e-9 * tick)
        bench.step()
    assert fault(bench) == Fault.NONE
    bench.step(4)
    assert fault(bench) == Fault.NONE
    bench.step()
    assert_damps(bench, Fault.STALE_SENSORS)


@pytest.mark.parametrize(
    ("port", "field", "value"),
    [
        ("joints", "position", np.nan),
        ("joints", "velocity", np.inf),
        ("base", "orientation", np.nan),
        ("base", "linear_velocity", 11.0),
        ("base", "angular_velocity", -101.0),
        ("base", "position", np.inf),
    ],
)
def test_an_absurd_state_stops_at_once(bench, port, field, value):
    bench.set(port, **{field: value})
    bench.step()
    assert_damps(bench, Fault.ABSURD_STATE)


@pytest.mark.parametrize(
    ("field", "value"),
    [("torque", np.nan), ("torque", 201.0), ("position", np.inf), ("stiffness", -np.inf)],
)
def test_an_absurd_command_never_reaches_the_drives(bench, field, value):
    bench.set("desired", **{field: value})
    bench.step()
    assert_damps(bench, Fault.ABSURD_COMMAND)


def test_a_solver_that_keeps_failing(bench):
    bench.set("wbc", solved=False)
    bench.step(24)
    bench.set("wbc", solved=True)
    bench.step()
    bench.set("wbc", solved=False)
    bench.step(24)
    assert fault(bench) == Fault.NONE
    bench.step()
    assert_damps(bench, Fault.SOLVER)


def test_fault_survives_a_restore(bench):
    healthy = bench.snapshot()
    bench.set("desired", torque=np.nan)
    bench.step()
    broken = bench.snapshot()
    bench.restore(healthy)
    bench.step()
    assert fault(bench) == Fault.NONE
    bench.restore(broken)
    bench.set("desired", torque=0.0)
    bench.step()
    assert_damps(bench, Fault.ABSURD_COMMAND)


def test_needs_a_robot():
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(SafetyMonitor, dimensions=dict(ROBOT.dimensions))
