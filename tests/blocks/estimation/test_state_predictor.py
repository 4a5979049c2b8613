"""The state when a command takes effect follows from the commands that are on their way."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.estimation.state_predictor import StatePredictor
from aloft.blocks.signals import Phase
from aloft.runtime.testing import BlockBench

PERIOD = 0.002
STANDING = {"phase": Phase.SQUAT, "stance": True}
FLYING = {"phase": Phase.FLIGHT, "stance": False}


def make(delay, ahead):
    bench = BlockBench(StatePredictor, {}, robot="bruce")
    bench.set("delay", delay=delay, ahead=ahead)
    return bench


def body(bench, position=(0.0, 0.0, 0.3), velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)):
    bench.set(
        "measured_base", position=position, orientation=[0.0, 0.0, 0.0, 1.0],
        linear_velocity=velocity, angular_velocity=spin,
    )  # fmt: skip


def commanded(joint, base=0.0):
    """A command whose first joint and whose base, upwards, accelerate by so much."""
    acceleration = np.zeros(16)
    acceleration[6], acceleration[2] = joint, base
    return acceleration


def test_with_a_tolerated_delay_the_output_is_what_is_measured():
    bench = make(0.002, 0.0)
    body(bench, velocity=(0.3, -0.2, 1.0), spin=(0.5, 2.0, -1.0))
    bench.set("measured_joints", position=0.2, velocity=3.0, torque=1.5)
    bench.set("command", acceleration=50.0)
    bench.set("phase", **STANDING)
    bench.step(5)
    base, joints = bench.get("base"), bench.get("joints")
    assert base.position == pytest.approx([0.0, 0.0, 0.3], abs=1e-15)
    assert base.linear_velocity == pytest.approx([0.3, -0.2, 1.0], abs=1e-15)
    assert base.angular_velocity == pytest.approx([0.5, 2.0, -1.0], abs=1e-15)
    assert (joints.position == 0.2).all() and (joints.velocity == 3.0).all()
    assert (joints.torque == 1.5).all()


@pytest.mark.parametrize(("delay", "ahead"), [(0.008, 0.006), (0.005, 0.003), (0.0073, 0.0053)])
def test_a_joint_is_where_its_commands_bring_it(delay, ahead):
    """A double integrator with that delay, driven by anything: the prediction comes true."""
    random = np.random.default_rng(3)
    bench, sent = make(delay, ahead), list(random.normal(scale=100.0, size=40))
    body(bench)
    bench.set("phase", **STANDING)
    fine = 20000  # steps of simulation a second; all instants here are multiples of its step
    at, speed, seen = [0.4], [1.0], []
    for step in range(round(len(sent) * PERIOD * fine)):
        tick = round(step - delay * fine) // round(PERIOD * fine)
        push = sent[tick] if tick >= 0 else 0.0
        at.append(at[-1] + speed[-1] / fine + 0.5 * push / fine**2)
        speed.append(speed[-1] + push / fine)
    for tick in range(len(sent) - 10):
        now = round(tick * PERIOD * fine)
        bench.set("measured_joints", position=at[now], velocity=speed[now])
        bench.set("command", acceleration=commanded(sent[tick - 1] if tick else 0.0))
        bench.step()
        joints, then = bench.get("joints"), now + round(ahead * fine)
        seen.append((joints.position[0] - at[then], joints.velocity[0] - speed[then]))
    assert np.abs(seen).max() < 1e-9
    assert np.ptp(at) > 0.02


def test_the_base_turns_and_moves_in_the_world():
    """Turned by 90 degrees to the left, its own axis ahead is the world's to the left."""
    bench, half = make(0.008, 0.006), np.sqrt(0.5)
    bench.set("measured_base", orientation=[0.0, 0.0, half, half], linear_velocity=[0.0, 1.0, 0.0])
    bench.set("measured_base", angular_velocity=[0.0, 0.0, 2.0])
    acceleration = np.zeros(16)
    acceleration[0], acceleration[5] = 10.0, 50.0
    bench.set("command", acceleration=acceleration)
    bench.set("phase", **STANDING)
    bench.step(10)
    base = bench.get("base")
    assert base.position == pytest.approx([0.0, 0.00618, 0.0], abs=1e-9)
    assert base.angular_velocity == pytest.approx([0.0, 0.0, 2.3], abs=1e-12)
    angle = np.pi / 2 + 0.0129
    assert base.orientation[2:] == pytest.approx([np.sin(angle / 2), np.cos(angle / 2)], abs=1e-9)
    assert base.linear_velocity == pytest.approx(
        [1.06 * np.cos(angle), 1.06 * np.sin(angle), 0.0], abs=1e-9
    )


def test_in_flight_the_base_falls_and_joints_go_on():
    bench = make(0.008, 0.006)
    body(bench, velocity=(0.5, 0.0, 1.0), spin=(0.0, 3.0, 0.0))
    bench.set("measured_joints", position=0.1, velocity=2.0)
    bench.set("command", acceleration=70.0)
    bench.set("phase", **FLYING)
    bench.step(10)
    base, joints = bench.get("base"), bench.get("joints")
    assert base.linear_velocity == pytest.approx([0.5, 0.0, 1.0 - 9.81 * 0.006], abs=1e-3)
    assert base.position == pytest.approx([0.003, 0.0, 0.3 + 0.006 - 0.5 * 9.81 * 36e-6], abs=1e-4)
    assert base.angular_velocity == pytest.approx([0.0, 3.0, 0.0])
    assert joints.position == pytest.approx(0.112)
    assert joints.velocity == pytest.approx(2.0)


def test_after_touchdown_flight_commands_tell_nothing():
    """Neither the fall nor a guessed impact: the velocity is as measured until commands act again."""
    bench = make(0.008, 0.006)
    body(bench, velocity=(0.0, 0.0, -1.0))
    bench.set("phase", **FLYING)
    bench.step(10)
    bench.set("phase", phase=Phase.LANDING, stance=True)
    bench.set("command", acceleration=commanded(0.0, base=100.0))
    speeds = []
    for _ in range(5):
        bench.step()
        speeds.append(float(bench.get("base").linear_velocity[2]))
    # The newest command acts from d - T on: at the end of what is predicted, d - 2 ms, not yet.
    assert speeds == pytest.approx([-1.0, -0.8, -0.6, -0.4, -0.4])
