"""Weak motors are asked for more, and give what the joints are to get."""

from __future__ import annotations

from typing import Any

import numpy as np

from aloft.blocks.control.motor_compensation import MotorCompensation
from aloft.blocks.signals import CommandMode
from aloft.robots.description import find_robot
from aloft.runtime.testing.bench import BlockBench

ROBOT = find_robot("bruce")
N = len(ROBOT.joints)


def test_motors_give_the_torque_that_is_wanted() -> None:
    bench: BlockBench[Any] = BlockBench(MotorCompensation, {}, robot="bruce")
    wanted, share = np.linspace(-3.0, 5.0, N), np.linspace(0.9, 1.0, N)
    bench.set(
        "desired",
        torque=wanted,
        mode=CommandMode.DAMPING,
        position=0.1,
        velocity=0.2,
        stiffness=3.0,
        damping=0.4,
    )
    bench.set("motors", torque_constant=share)
    bench.step()
    command = bench.get("command")
    given = share * np.linalg.solve(ROBOT.joint_to_motor.T, command.torque)
    np.testing.assert_allclose(ROBOT.joint_to_motor.T @ given, wanted, atol=1e-12)
    assert abs(command.torque - wanted).max() > 0.1
    assert command.mode == CommandMode.DAMPING
    passed = (command.position, command.velocity, command.stiffness, command.damping)
    assert [set(values) for values in passed] == [{0.1}, {0.2}, {3.0}, {0.4}]
