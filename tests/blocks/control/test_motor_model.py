"""What is asked of the motors gives what is wanted, as the simulated motors give it."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.motor_model import MotorModel
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
TO_JOINT = ROBOT.joint_to_motor.T
PEAK = np.array(ROBOT.motors.peak_torque)
FACTORS = 1.0 + 0.05 * np.cos(np.arange(10.0))
CONSTANTS = {joint.name: value for joint, value in zip(ROBOT.joints, FACTORS, strict=True)}


def bench_of(**params):
    return BlockBench(MotorModel, params, robot=ROBOT)


def test_default_parameters_pass_everything():
    bench = bench_of()
    torque = np.linspace(-6.0, 6.0, 10)
    bench.set("desired", mode=1, torque=torque, position=0.1, stiffness=60.0, damping=1.5)
    bench.set("measured", torque=torque[::-1], position=0.3, velocity=2.0)
    bench.step()
    command, joints = bench.get("command"), bench.get("joints")
    assert command.torque == pytest.approx(torque, abs=1e-12)
    assert joints.torque == pytest.approx(torque[::-1], abs=1e-12)
    assert command.mode == 1 and (command.stiffness == 60.0).all()
    assert (joints.position == 0.3).all() and (joints.velocity == 2.0).all()


@pytest.mark.parametrize("share", [-0.8, -0.2, 0.0, 0.5, 0.78])
def test_the_currents_of_the_command_give_what_was_desired(share):
    bench = bench_of(torque_constant=CONSTANTS, saturation=0.1, load_friction=0.05)
    desired = TO_JOINT @ (share * PEAK * np.sign(np.cos(np.arange(10.0))))
    bench.set("measured", velocity=np.linspace(-5.0, 5.0, 10))
    bench.set("desired", torque=desired)
    bench.step()
    bench.set("measured", torque=bench.get("command").torque)
    bench.step()
    assert bench.get("joints").torque == pytest.approx(desired, abs=1e-6)


def test_saturation_takes_its_share_at_the_peak_and_no_more_is_asked():
    bench = bench_of(saturation=0.2)
    bench.set("measured", torque=TO_JOINT @ PEAK)
    bench.set("desired", torque=TO_JOINT @ (2.0 * PEAK))
    bench.step()
    assert bench.get("joints").torque == pytest.approx(TO_JOINT @ (0.8 * PEAK))
    assert bench.get("command").torque == pytest.approx(TO_JOINT @ PEAK)
