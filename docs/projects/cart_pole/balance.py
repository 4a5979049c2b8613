"""Balances whatever stands on joints without motors."""

from collections.abc import Mapping

import numpy as np

from aloft import Block, Input, Output, Parameters, parameter
from aloft.blocks.signals import CommandMode, JointCommand, JointState
from aloft.robots.pinocchio_model import build_pinocchio_model


class Balance(Block):
    """A linear quadratic regulator about the pose in which all joints are zero::

        torque = -K (q, q')

    K minimises the sum over all ticks of ``position_weight`` |q|^2 + ``velocity_weight`` |q'|^2 +
    ``torque_weight`` |torque|^2 for the robot's own dynamics, linearised about that pose: M q'' +
    dg/dq q = S torque, with the mass matrix M and gravity g from Pinocchio and S choosing the
    joints that have a motor. K is the limit of the Riccati recursion.

    Raises:
        ValueError: no gains hold the robot with these motors.
    """

    class Params(Parameters):
        position_weight: float = parameter(10.0, gt=0, text="weight of positions [rad, m]")
        velocity_weight: float = parameter(1.0, ge=0, text="weight of velocities [rad/s, m/s]")
        torque_weight: float = parameter(0.1, gt=0, text="weight of motor torques [N m, N]")

    needs = ("robot",)
    params: Params
    joints = Input(JointState, text="measured joints")
    command = Output(JointCommand, text="torques of the joints that have a motor")

    def setup(self) -> None:
        """Find the gains."""
        self.gains = self._riccati(*self.linear_model())
        self._state, self._torque = np.zeros(self.gains.shape[1]), np.zeros(len(self.gains))
        self._driven = np.flatnonzero(self._motors())

    def _motors(self) -> np.ndarray:
        return self.robot.motors.peak_torque > 0.0

    def linear_model(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrices A and B of x+ = A x + B torque with x = (q, q'), from tick to tick."""
        import pinocchio

        built = build_pinocchio_model(self.robot)
        model, memory, n = built.model, built.model.createData(), built.model.nv
        # Continuous joints have two coordinates in no model of ours: zero is all zeros.
        zero, step = np.zeros(n), 1e-6
        mass = np.array(pinocchio.crba(model, memory, zero)) + built.rotor_coupling
        mass = np.triu(mass) + np.triu(mass, 1).T
        stiffness = np.zeros((n, n))
        for k in range(n):
            ahead = np.eye(n)[k] * step
            up = np.array(pinocchio.computeGeneralizedGravity(model, memory, ahead))
            down = np.array(pinocchio.computeGeneralizedGravity(model, memory, -ahead))
            stiffness[:, k] = (up - down) / (2 * step)
        inverse = np.linalg.inv(mass)
        rate = np.block(
            [[np.zeros((n, n)), np.eye(n)],
             [-inverse @ stiffness, -inverse * self.robot.motors.damping]]
        )  # fmt: skip
        push = np.vstack([np.zeros((n, n)), inverse])[:, self._motors()]
        dt = self.period
        once = np.eye(2 * n) + 0.5 * dt * rate
        return np.eye(2 * n) + dt * rate @ once, dt * once @ push

    def _riccati(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        n, p = len(a) // 2, self.params
        state = np.diag([p.position_weight] * n + [p.velocity_weight] * n)
        effort, cost = p.torque_weight * np.eye(b.shape[1]), state
        for _ in range(20000):
            gains = np.linalg.solve(effort + b.T @ cost @ b, b.T @ cost @ a)
            after = state + a.T @ cost @ (a - b @ gains)
            done = np.abs(after - cost).max() < 1e-9 * np.abs(cost).max()
            cost = after
            if done:
                break
        if not np.abs(np.linalg.eigvals(a - b @ gains)).max() < 1.0:
            raise ValueError(f"no gains hold {self.robot.name} with these motors")
        return gains

    def step(self) -> None:
        """Compute torques from the measured state."""
        n, command = len(self._state) // 2, self.command
        self._state[:n] = self.joints.position
        self._state[n:] = self.joints.velocity
        np.dot(self.gains, self._state, out=self._torque)
        for field in (command.position, command.velocity, command.stiffness, command.damping):
            field.fill(0.0)
        command.torque.fill(0.0)
        for k, joint in enumerate(self._driven):
            command.torque[joint] = -self._torque[k]
        command.mode[()] = CommandMode.ACTIVE

    def metrics(self) -> Mapping:
        """Report the joints' distance from zero at the end, as measured."""
        return {"largest_position": float(np.abs(self.joints.position).max())}
