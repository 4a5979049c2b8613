"""A gantry: a rope above a simulated robot, which hangs at the start and is let down.

The rope holds the base at a point straight above the standing robot's centre of mass. It only pulls. With
the distance ``d`` from its anchor to that point and its length ``l`` without load, its tension is
``k (d - l) + c d'``, or zero if that is negative. ``k`` follows from how far the robot's weight stretches it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...mathematics.arrays import Array1D, Array2D, Counts, Indices0D, Vector3
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from ...robots.kinematics import standing_com
from ...runtime.language.steps import signal_call
from .effect import Effect
from .effects import GantryParameters
from .mujoco_model import body_name
from .state import PhysicsState

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

PAID_OUT, GOAL, DUE, DISTANCE = range(4)
"""Elements of ``PhysicsState.gantry``: the length of the rope beyond that at the start, and its goal [m]; the physics
step in which it is let down, negative: not yet; the distance of its ends [m]."""
NOT_DUE = -1e15
DAMPING_RATIO = 0.5
"""Of the robot's bouncing on its rope."""


class Rope(NamedTuple):
    """The rope: its ``anchor`` (3,) [m, world] and its fixing to the base, ``tied`` (3,) [m, base frame]; length [m],
    stiffness [N/m], damping [N s/m]; the speed of paying out [m/s]; the length paid out [m] until the robot stands, and
    then at once; step [s]."""

    anchor: Vector3
    tied: Vector3
    length: Array1D
    stiffness: float
    damping: float
    speed: float
    drop: float
    slack: float
    timestep: float


class Hanging(NamedTuple):
    """The base in the simulator's memory: its origin, rotation (9,) and CoM [m, world], and the wrench on
    it (6,) [N, N m, world]."""

    origin: Vector3
    rotation: Array1D
    com: Vector3
    wrench: Array1D


@kernel
def pull_rope(step: Indices0D, rope: Rope, base: Hanging, memory: PhysicsState) -> None:
    """Pay the rope out and add its pull to what acts on the base in the physics ``step``."""
    state = memory.gantry
    if state[DUE] != NOT_DUE and step[()] >= state[DUE]:
        state[GOAL] = rope.drop + rope.slack
        state[DUE] = NOT_DUE
    change = state[GOAL] - state[PAID_OUT]
    most = rope.speed * rope.timestep
    state[PAID_OUT] += min(max(change, -most), most)
    if change > 0.0 and state[PAID_OUT] >= rope.drop:
        state[PAID_OUT] = state[GOAL]
    x, y, z = rope.tied[0], rope.tied[1], rope.tied[2]
    turn = base.rotation
    ax = base.origin[0] + turn[0] * x + turn[1] * y + turn[2] * z
    ay = base.origin[1] + turn[3] * x + turn[4] * y + turn[5] * z
    az = base.origin[2] + turn[6] * x + turn[7] * y + turn[8] * z
    dx, dy, dz = rope.anchor[0] - ax, rope.anchor[1] - ay, rope.anchor[2] - az
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    rate = (distance - state[DISTANCE]) / rope.timestep
    state[DISTANCE] = distance
    stretch = distance - rope.length[0] - state[PAID_OUT]
    if stretch <= 0.0:
        return
    tension = rope.stiffness * stretch + rope.damping * rate
    if tension <= 0.0:
        return
    fx, fy, fz = tension * dx / distance, tension * dy / distance, tension * dz / distance
    x, y, z = ax - base.com[0], ay - base.com[1], az - base.com[2]
    wrench = base.wrench
    wrench[0] += fx
    wrench[1] += fy
    wrench[2] += fz
    wrench[3] += y * fz - z * fy
    wrench[4] += z * fx - x * fz
    wrench[5] += x * fy - y * fx


class Gantry(Effect):
    """The rope of a simulated robot.

    Args:
        params: of the gantry.
        robot: the description.
        model, data: the simulator's.
        memory: keeps the rope's length.
        timestep: of the physics [s].
    """

    def __init__(
        self, params: GantryParameters, robot: RobotDescription, model: MjModel, data: MjData,
        memory: PhysicsState, timestep: float,
    ) -> None:  # fmt: skip
        weight = float(model.body_subtreemass[0]) * GRAVITY
        stiffness = weight / params.stretch
        damping = 2.0 * DAMPING_RATIO * math.sqrt(stiffness * weight / GRAVITY)
        body = int(model.body(body_name(robot.base)).id)
        x, y, z = standing_com(robot).tolist()
        tied = np.array([x, y, z + params.above_com])
        speed = math.inf if params.speed is None else params.speed
        self._params, self._memory, self._timestep = params, memory, timestep
        wrenches: Array2D = data.xfrc_applied
        self._base = Hanging(data.xpos[body], data.xmat[body], data.xipos[body], wrenches[body])
        self._rope = Rope(
            np.zeros(3), tied, np.zeros(1), stiffness, damping, speed,
            params.height + 3.0 * params.stretch, params.slack, timestep,
        )  # fmt: skip

    def tie(self) -> None:
        """Tie the robot up where it is, with its weight on the rope."""
        base, rope, memory = self._base, self._rope, self._memory
        rope.anchor[:] = base.origin + product(base.rotation.reshape(3, 3), rope.tied)
        rope.anchor[2] += self._params.rope
        rope.length[0] = self._params.rope - self._params.stretch
        memory.gantry[:] = 0.0, 0.0, NOT_DUE, self._params.rope

    def lower(self, step: Counts) -> None:
        """Let the robot down, ``lower_after`` the physics ``step``, a count without a dimension."""
        if self._params.lower_after is not None:
            self._memory.gantry[DUE] = int(step) + round(self._params.lower_after / self._timestep)

    def let_down(self) -> None:
        """Let the robot down from now on."""
        self._memory.gantry[GOAL] = self._rope.drop + self._rope.slack
        self._memory.gantry[DUE] = NOT_DUE

    def lift(self) -> None:
        """Lift the robot to where it hung at the start."""
        self._memory.gantry[PAID_OUT] = min(self._memory.gantry[PAID_OUT], self._rope.drop)
        self._memory.gantry[GOAL], self._memory.gantry[DUE] = 0.0, NOT_DUE

    def force_calls(self, step: Counts, *, stands: bool) -> list[Call]:
        """Let the rope pull."""
        return [signal_call(pull_rope, step, self._rope, self._base, self._memory)]
