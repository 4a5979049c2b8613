"""Computes from the momentum in flight where the feet should land."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Literal

import numpy as np
import pydantic

from ...mathematics.compiling.kernel_call import KernelCall
from ...robots.description import RobotDescription
from ...robots.kinematics import foot_sides, standing_feet
from ...runtime.language.block import Input, Misfit, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, FootTarget, JumpReference, PhaseState
from .landing_prediction import PredictionGains, Terms, landing_prediction, scale_gains
from .landing_targets import Law, Memory, Now, Plan, Scratch, Settings, Targets, aim_feet


def _three(value: object) -> object:
    """One number stands for all three axes."""
    return (value,) * 3 if isinstance(value, int | float) else value


Share = Annotated[float, pydantic.Field(ge=0.0, le=1.0)]
Shares = Annotated[tuple[Share, Share, Share], pydantic.BeforeValidator(_three)]


class LandingMemory(Signal):
    """The state of ``LandingHeuristic``."""

    flying = Field(dtype="bool", text="whether the robot flew at the last tick")
    offset = Field(
        ("n_feet", 3), unit="m", frame="world", text="feet at lift-off, measured minus planned"
    )
    goal = Field(("n_feet", 3), unit="m", frame="world", text="where the feet last aimed")
    planned = Field(("n_feet", 3), unit="m", frame="world", text="planned feet from the com")
    swing = Field(("n_feet", 3), unit="m/s", frame="world", text="their planned speed from the com")
    linear = Field(3, unit="kg m/s", frame="world", text="planned linear momentum")
    angular = Field(3, unit="N m s", frame="world", text="planned angular momentum")
    orientation = Field(4, unit="", text="planned base quaternion x, y, z, w")
    shift = Field(4, unit="m", frame="world", text="chosen: ahead, to the left, apart, upwards")
    started = Field(dtype="bool", text="whether the plan's place in the world is known")
    origin = Field(3, unit="m", frame="world", text="position of the plan's origin")
    lift_off_time = Field(unit="s", text="planned lift-off of the flight under way or next")
    wished = Field(3, unit="m", frame="world", text="planned place of the com at touchdown")
    due = Field(unit="s", text="touchdown with the planned length of the legs, from lift-off")


class LandingHeuristic(KernelBlock):
    """Foot targets in flight from momentum feedback (paper, IV).

    All places are relative to the centre of mass, in world axes. The law, for each of any number
    of feet, with p_nom the planned foot and its side s = 1 on the left of the base, -1 on the
    right and 0 in the middle (the paper's (-1)^i):

        p^x = p_nom^x + W_l^x l^x + W_k^x k^y
        p^y = p_nom^y + W_l^y l^y + W_k^y k^x
        Delta y = W_c |l^y|
        p_des^x = p^x                   where |p^x - c^x| <= p_max^x, else at that limit
        p_des^y = p^y + s Delta y       likewise, of the sum, with p_max^y

    The limits are centred at c: the centre of mass with ``limits_about: com``, as in the paper;
    the foot's place below a standing robot with ``limits_about: stance``, for robots whose feet
    stand far from the centre of mass, such as quadrupeds.

    With ``law: paper`` l and k are the measured momenta. With ``law: deviation`` they are the
    measured momenta minus the planned ones: the planned footholds already fit the planned momentum,
    so feeding back the whole momentum of a forward jump would count it twice.

    With ``law: predicted`` the landing place is chosen anew in every tick, from the momenta that
    were not planned, by what it does to the torso. Feet that keep their place in the world turn a
    torso that tilts even further; drawn up they turn BRUCE's forward, by 5 to 8 deg per cm
    (``mathematics/landing_law``). All feet are shifted ahead, to the left, apart and upwards
    by the s that costs least::

        (s_x - g_x)^2 + (s_y - g_y)^2 + (apart_cost (s_a - g_a))^2 + (height_cost s_z)^2
            + sum over roll and pitch of (tilt_cost h (tilt - free))^2

    where tilt is the deviation from the planned orientation at touchdown, linear in s, of which up
    to ``free_tilt`` costs nothing. Drawn up legs touch down later, by s_z over the speed of the
    fall, and the base turns until then. s_z is within ``height_range`` h, but drawn up legs must
    keep the stroke in which ``stop_acceleration`` g stops the fall, and stretched legs touch down early
    by at most the share ``early`` of the flight. The goal g is the capture point of the linear
    inverted pendulum of the standing height h, w^2 = g / h, times the gains::

        g_x = capture l^x / (m w) + capture_turn k^y w / (m g),
        g_y = capture l^y / (m w) - capture_turn k^x w / (m g),    g_a = clearance |l^y| / (m w)

    These gains have no unit, so they are the same for robots of any size. p_max applies as above.
    They are less than 1, aside even more, because two feet that stand apart hold a capture point that
    is off their middle, and a long way with drawn up legs is at the end of the hips' reach.

    A robot that lifts off with a slightly wrong velocity lands beside its place, and feet that go to
    the capture point land even further off. Let e be by how much unshifted feet would miss their
    planned place in the world, by the measured motion, and d = g + e the way from that place to the
    capture point, both horizontal. Then g is replaced by

        g - place_gain / (1 + (|d| / (place_range h))^4) d

    so a small miss, within which standing feet keep the balance, is partly made good; after a push
    the feet go to the capture point. Touchdown comes some milliseconds before its prediction, and in
    a long jump the feet still swing then. So they are ahead of their planned way by ``lead_time``.

    The foot moves there from its position at lift-off, along x and y with minimum jerk over
    ``reach_share`` of the predicted flight. Its height follows the plan (paper, V), and near
    touchdown the foot moves upwards at the speed ``retraction``, to land softly.

    The target is rotated into the body's frame by R_ref Exp(alpha Log(R_ref' R)). With ``alpha`` 1
    it is fixed in the world, whatever the torso does; with 0 it is fixed in the planned body, as in
    the paper. The target of the sole is flat, with the planned heading.

    A plan that lands on the toes first (``reference.toes_first``) draws the feet in by itself, by a fast
    turn of torso against thighs. There is then no ``retraction``, and instead of ``alpha`` the legs
    compensate the share ``toes_alpha``: with all of it the legs would work against that turn whenever
    the torso is some milliseconds ahead of the plan or behind it.

    With z up a push along +x gives l^x > 0 and k^y > 0, and along +y l^y > 0 and k^x < 0, so the
    stabilising signs are W_l > 0, W_k^x > 0 and W_k^y < 0. In LANDING a foot that is still in the
    air moves on to its last target, at the height of the lowest sole; otherwise the target is the
    plan. In a flight that is longer than planned the plan stays at its last instant before
    touchdown. Whether a leg can reach the target is left to its inverse kinematics.
    """

    class Params(PredictionGains):
        law: Literal["paper", "deviation", "predicted"] = parameter(
            "deviation",
            text="feed back the measured momentum, or its deviation from the plan; or predict",
        )
        w_l: tuple[float, float] = live_parameter(
            (0.03, 0.04), unit="s/kg", text="W_l: metres per linear momentum along x and y"
        )
        w_k: tuple[float, float] = live_parameter(
            (0.0, 0.0), unit="s/(kg m)", text="W_k: metres per angular momentum about y and x"
        )
        w_c: float = live_parameter(
            0.04, unit="s/kg", ge=0.0, text="W_c: sideways clearance per lateral momentum"
        )
        p_max: tuple[float, float] = live_parameter(
            (0.15, 0.16), unit="m", text="farthest places ahead and aside the leg can reach"
        )
        limits_about: Literal["com", "stance"] = parameter(
            "com", text="the centre of the limits p_max: the centre of mass, or each foot's stance"
        )
        alpha: Shares = live_parameter(
            (1.0, 1.0, 1.0),
            text="share of the torso's rotation about x, y and z that the legs compensate",
        )
        toes_alpha: Shares = live_parameter(
            (0.8, 0.8, 0.8),
            text="the same share where the plan lands on the toes first",
        )
        reach_share: float = live_parameter(
            0.7, gt=0.0, le=1.0, text="share of the predicted flight by which the feet are there"
        )
        retraction: float = live_parameter(
            0.3, unit="m/s", ge=0.0, le=2.0, text="upward speed of the feet at touchdown"
        )
        retraction_time: float = live_parameter(
            0.06, unit="s", gt=0.0, text="how long before touchdown it begins"
        )

    needs = ("feet",)
    params: Params
    reference = Input(JumpReference, text="the plan")
    phase = Input(PhaseState, text="the phase and the time to touchdown")
    terms = Input(DynamicsTerms, text="the present state")
    feet = Output(FootTarget, text="where the feet should be, and where they should land")
    memory = State(LandingMemory, text="lift-off, and the plan as long as it lasts")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Report limits within which the robot cannot stand."""
        assert isinstance(params, cls.Params) and robot is not None
        if params.limits_about == "stance":
            return
        for foot, place in zip(robot.feet, standing_feet(robot), strict=True):
            x, y = abs(float(place[0])), abs(float(place[1]))
            if x > params.p_max[0] or y > params.p_max[1]:
                yield Misfit(
                    f"{foot.name} of {robot.name} stands {x:.3f} m ahead or behind and {y:.3f} m "
                    "beside the centre of mass, which is beyond p_max",
                    parameter="p_max",
                    expected="limits within which every foot stands",
                    found=f"({params.p_max[0]} m, {params.p_max[1]} m)",
                    fix="limits_about: stance",
                )
                return

    def setup(self) -> None:
        robot, p = self.robot, self.params
        stance = standing_feet(robot)
        self._mass, self._height = robot.total_mass, -float(stance[:, 2].mean())
        sides, n = foot_sides(stance), len(robot.feet)
        turned = p.limits_about == "stance"
        law = Law(
            p.law == "predicted", p.law != "paper", turned, np.array(sides), stance, self._mass,
            self.period,
        )  # fmt: skip
        self._prediction = landing_prediction(robot, sides)
        self._settings = Settings(*(np.zeros(size) for size in (2, 2, 2, 3, 3, 1, 1, 1, 1, 1)))
        self.on_parameters()
        shapes = (n, 3), (n, 3), 4, 4, (3, 3), (3, 3), 3, 3, 3, 3, 3, 3, 3, 3
        aiming = KernelCall(
            aim_feet,
            Now(*(getattr(self.phase, name) for name in Now._fields)),
            Plan(*(getattr(self.reference, name) for name in Plan._fields)),
            Terms(*(getattr(self.terms, name) for name in Terms._fields)),
            law,
            self._settings,
            self._prediction,
            Memory(*(getattr(self.memory, name) for name in Memory._fields)),
            Targets(*(getattr(self.feet, name) for name in Targets._fields)),
            Scratch(*(np.zeros(shape) for shape in shapes)),
        )
        self.kernel_calls = (aiming,)

    def on_parameters(self) -> None:
        for name in Settings._fields:
            getattr(self._settings, name)[:] = getattr(self.params, name)
        scale_gains(self.params, self._mass, self._height, self._prediction.gains)
