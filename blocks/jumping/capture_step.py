"""Steps after touchdown, where the feet no longer support the robot."""

from __future__ import annotations

import numpy as np

from ...mathematics.compiling.kernel_call import KernelCall
from ...robots.kinematics import foot_sides, standing_feet
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JumpReference, PhaseState
from .capture_law import Feet, Memory, PhaseFields, Scratch, Settings, Terms, take_steps


class StepMemory(Signal):
    """The state of ``CaptureStep``."""

    foot = Field(dtype="int64", text="the foot that steps, counted from 1; 0 for none")
    elapsed = Field(unit="s", text="how long it has stepped")
    taken = Field(dtype="int64", text="steps taken so far")
    outside = Field(unit="s", text="how long the capture point has been outside the support")
    last = Field(unit="s", text="time after touchdown at which the last step ended")
    ground = Field(unit="m", frame="world", text="height of the ground under the stepping foot")
    heading = Field(
        unit="rad", frame="world", text="mean heading of the feet before the first step"
    )
    foothold = Field(("n_feet", 3), unit="m", frame="world", text="where each foot last went")


class CaptureStep(KernelBlock):
    """Takes a step after touchdown, or several, where the feet can no longer hold the robot.

    It passes the phase on unchanged unless a foot steps. After the last planned touchdown it
    computes in every tick the capture point xi of the linear inverted pendulum
    (``mathematics/capture_step``)::

        xi = c + c' / w + turn (k_y, -k_x) w / (m g),    w^2 = g / (c_z - ground)

    A foot steps where xi has been outside the support polygon by more than ``margin`` for
    ``confirmation``, at the earliest ``after`` touchdown, while all feet stand, and ``steps`` times
    at most. The support polygon is that of all points of the feet.

    **Where.** While the foot is in the air the others push at p, where they are nearest to xi, and
    xi runs away from there. The foot goes to where xi will be as it lands, and a share farther::

        foothold = p + (1 + beyond) (xi - p) exp(w left)

    It stays within ``reach`` ahead of and behind the other feet and, in multiples of their distance
    in standing, within ``apart`` to its own side of them, so that the legs do not cross. The
    foothold is computed anew in every tick until the last quarter of the step. The foot that steps
    is the one for which these limits change the foothold least, so in a fall sideways the foot on
    that side, though it carries the robot; of equals it is the one farther from xi.

    **How.** The points of the foot leave the stance and get an acceleration, which is that of the
    motion of least mean square acceleration from where they are to their place, with a flat sole
    and the heading that the feet had before the first step. The whole-body controller follows it as
    a task and computes the torques of both legs (``ContactPoints``), so the leg's reaction on the
    body is taken into account. Of the feet that stand meanwhile, points more than ``flat`` above the
    lowest of their foot are not in stance: the controller would rely on the friction of a heel that
    hovers, and the foot would turn on its toe. The step ends with the first contact after 0.6 of ``duration``, or
    after 1.5 of it. The robot stays in LANDING, low, until ``settle`` after the last step, and then
    recovers.

    The block plans one step at a time, on level ground, and does not return the feet to where they
    stood. A robot with a single foot takes none.
    """

    class Params(Parameters):
        steps: int = live_parameter(
            0, ge=0, le=20, text="the most steps it takes; 0: it only stands"
        )
        margin: float = live_parameter(
            0.015, unit="m", ge=0.0, text="how far outside the support the capture point must be"
        )
        confirmation: float = live_parameter(
            0.006, unit="s", ge=0.0, text="how long it must be there"
        )
        after: float = live_parameter(
            0.08, unit="s", ge=0.0, text="time after touchdown before which no foot steps"
        )
        turn: float = live_parameter(
            1.0, ge=0.0, le=1.0, text="share of the angular momentum that counts"
        )
        duration: float = live_parameter(0.13, unit="s", gt=0.04, le=1.0, text="of a step")
        height: float = live_parameter(
            0.015, unit="m", gt=0.0, le=0.2, text="how high the foot is lifted"
        )
        beyond: float = live_parameter(
            0.1, ge=0.0, le=1.0, text="how much farther the foot goes than the capture point"
        )
        reach: float = live_parameter(
            0.2, unit="m", gt=0.0, text="farthest place ahead of or behind the other feet"
        )
        apart: tuple[float, float] = live_parameter(
            (0.6, 1.8), text="least and largest distance aside, in distances of the standing feet"
        )
        settle: float = live_parameter(
            0.35, unit="s", ge=0.0, text="time from a step until the robot rises again"
        )
        flat: float = live_parameter(
            0.0005,
            unit="m",
            ge=0.0,
            text="height up to which the other points of a foot carry load while another foot steps",
        )

    needs = ("feet",)
    params: Params
    before = Input(PhaseState, text="the phase and the stance points by plan and contacts")
    reference = Input(JumpReference, text="the plan, for whether another jump follows")
    terms = Input(DynamicsTerms, text="the present state")
    phase = Output(PhaseState, text="the same, with the steps")
    memory = State(StepMemory, text="the step under way, and those taken")

    def setup(self) -> None:
        robot = self.robot
        stance = standing_feet(robot)
        n_feet, n_contacts = len(robot.feet), len(robot.contacts)
        foot_of_point = np.array(robot.foot_of_contact(), dtype=np.int64)
        apart = np.zeros(n_feet)
        for foot, place in enumerate(stance):
            others = np.delete(stance, foot, axis=0)
            if len(others):
                apart[foot] = abs(float(place[1]) - float(others[:, 1].mean()))
        offset = np.array(
            [
                np.array(point.position) - np.array(robot.feet[foot].sole)
                for point, foot in zip(robot.contacts, foot_of_point, strict=True)
            ]
        )
        self._settings = Settings._make(
            np.zeros(2 if name == "apart" else 1, np.int64 if name == "steps" else np.float64)
            for name in Settings._fields
        )
        self.on_parameters()
        stepping = KernelCall(
            take_steps,
            PhaseFields(*(getattr(self.before, name) for name in PhaseFields._fields)),
            self.reference.time,
            self.reference.lift_off_time,
            Terms(*(getattr(self.terms, name) for name in Terms._fields)),
            self._settings,
            Feet(
                foot_of_point, np.array(foot_sides(stance)), apart, offset, robot.total_mass,
                self.period,
            ),
            Memory(*(getattr(self.memory, name) for name in Memory._fields)),
            PhaseFields(*(getattr(self.phase, name) for name in PhaseFields._fields)),
            Scratch(
                np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(3), np.zeros(n_contacts, np.bool_),
                np.ones(n_feet, np.bool_),
            ),
        )  # fmt: skip
        self.kernel_calls = (stepping,)

    def on_parameters(self) -> None:
        for name in Settings._fields:
            getattr(self._settings, name)[:] = getattr(self.params, name)
