"""The targets of the whole-body controller: the plan, and after it balance over the feet."""

from __future__ import annotations

import numpy as np

from ...mathematics.compiling.kernel_call import KernelCall
from ...robots.limb import FootKind, foot_shape
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JumpReference, PhaseState, WholeBodyTarget
from .balance_law import (
    BY_BASE,
    BY_FEET,
    BY_PATTERN,
    Aim,
    Gains,
    Memory,
    Plan,
    Present,
    Scratch,
    Stand,
    aim,
)

Vector = tuple[float, float, float]


class BalanceMemory(Signal):
    """The state of ``BalanceTarget``."""

    standing_height = Field(unit="m", text="planned height of the centre of mass in the first tick")
    started = Field(dtype="bool", text="whether that height is known")
    trim = Field(3, unit="rad", frame="body", text="rotation added to the level target")
    origin = Field(3, unit="m", frame="world", text="position of the plan's origin")
    heading = Field(unit="rad", frame="world", text="heading of the plan's x axis")
    off_place = Field(3, unit="m", frame="world", text="the feet's offset from their planned place")


class BalanceTarget(KernelBlock):
    """Follows the plan until its last touchdown, then balances over the middle of the feet.

    It serves any number of feet. Their middle is the mean of the sole centres, and their heading
    is the mean of the headings of the line and flat feet. Point feet have no heading of their own:
    that of several point feet is the rotation, by least squares, of the pattern in which they stand
    from the planned pattern; that of a single one is the heading of the base.

    Before the last touchdown the target's positions and heading are the plan's, shifted and rotated
    with the measured feet. The plan is relative to the feet, so a drift of the estimated position
    or heading does not matter. Its angular momentum and the rate of that are scaled with the mass
    of the model at ``terms``.

    So the error of each landing would add to the next one, unless ``place_gain`` feeds the position
    back. In the last T_p = ``place_time`` before a lift-off it changes the length of the jump. Let
    e be the estimated position of the feet's middle minus the planned one, and T_f the planned
    flight time. Then

        d = -place_gain e, of a length of at most place_limit
        v(t) = v_d s(u),   s = 10 u^3 - 15 u^4 + 6 u^5,   u = 1 - (t_lo - t) / T_p,
        v_d = d / (T_f + T_p / 2)

    v is added to the velocity of the centre of mass, its integral to the position and its
    derivative to the acceleration: at touchdown they have moved it by d. The plan's place in the
    world is set in the first tick. An error of the feet's heading is not corrected.

    After the last touchdown the centre of mass goes over the middle of the sole centres, at
    ``landing_depth`` below standing height. When the phase is RECOVER it rises to standing height
    with minimum jerk within ``rise_time``. The base goes level, with the heading of the feet. Joint
    friction leaves a small steady tilt, which the integral ``trim`` removes,

        trim' = trim_rate Log(R' R_level), within trim_limit,    R_target = R_level Exp(trim),

    about the body's x and y axes. The targets of angular momentum and its rate are zero.

    A robot that differs from its model misses the plan at lift-off in much the same way in every
    jump of a task. ``velocity_correction`` dv and ``momentum_correction`` dk compensate the known
    part of that error: with u, from 0 to 1, the share of a thrust of duration T that is over, the
    plan becomes

        v + u^2 dv,   a + 2 u dv / T,   p + T u^3 dv / 3,   k + u^2 dk,   k' + 2 u dk / T.

    The block does not plan steps: the feet stay where they are.
    """

    class Params(Parameters):
        landing_depth: float = live_parameter(
            0.06, unit="m", ge=0.0, le=0.5, text="depth below standing held after touchdown"
        )
        rise_time: float = live_parameter(
            0.6, unit="s", gt=0.0, text="time to rise from there to standing height"
        )
        trim_rate: float = live_parameter(
            3.0, unit="1/s", ge=0.0, le=20.0, text="integral gain on a steady tilt"
        )
        trim_limit: float = live_parameter(
            0.08, unit="rad", ge=0.0, le=0.5, text="largest trim about each axis"
        )
        velocity_correction: Vector = live_parameter(
            (0.0, 0.0, 0.0),
            unit="m/s",
            text="added to the planned velocity of the centre of mass at lift-off, in the plan's axes",
        )
        momentum_correction: Vector = live_parameter(
            (0.0, 0.0, 0.0),
            unit="N m s",
            text="added to the planned angular momentum at lift-off, in the plan's axes",
        )

        place_gain: float = live_parameter(
            0.0,
            ge=0.0,
            le=1.0,
            text="share of the feet's position error that the next jump corrects",
        )
        place_limit: float = live_parameter(
            0.03, unit="m", ge=0.0, le=0.2, text="largest change of a jump's length"
        )
        place_time: float = live_parameter(
            0.2, unit="s", gt=0.0, le=1.0, text="how long before lift-off it begins"
        )

    needs = ("floating base", "feet")
    params: Params
    reference = Input(JumpReference, text="the plan")
    phase = Input(PhaseState, text="the phase the robot is in")
    terms = Input(DynamicsTerms, text="the present state")
    target = Output(WholeBodyTarget, text="what to achieve now")
    memory = State(BalanceMemory, text="standing height and trim")

    def setup(self) -> None:
        robot = self.robot
        feet = range(len(robot.feet))
        heads = np.array([foot_shape(robot, foot)[0] != FootKind.POINT for foot in feet])
        kind = BY_FEET if heads.any() else BY_BASE if len(feet) == 1 else BY_PATTERN
        counted = heads if heads.any() else np.ones(len(feet), np.bool_)
        self._gains = Gains._make([*np.zeros((7, 1)), np.zeros((2, 3))])
        self.on_parameters()
        phase, terms = self.phase, self.terms
        present = Present(
            phase.phase, phase.time_in_phase, terms.foot_position, terms.foot_rotation,
            terms.base_rotation, terms.mass_matrix,
        )  # fmt: skip
        aiming = KernelCall(
            aim,
            Plan(*(getattr(self.reference, name) for name in Plan._fields)),
            present,
            Stand(kind, counted, robot.total_mass, self.period),
            self._gains,
            Memory(*(getattr(self.memory, name) for name in Memory._fields)),
            Aim(*(getattr(self.target, name) for name in Aim._fields)),
            Scratch(np.zeros(4), np.zeros(4), np.zeros(3), np.zeros(3), np.zeros(3)),
        )
        self.kernel_calls = (aiming,)

    def on_parameters(self) -> None:
        p, gains = self.params, self._gains
        for name in Gains._fields[:-1]:
            getattr(gains, name)[0] = getattr(p, name)
        gains.corrections[:] = p.velocity_correction, p.momentum_correction
