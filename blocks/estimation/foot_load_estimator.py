"""Finds from the legs' torques which feet carry load, and which of their points stand."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ...mathematics.arrays import Array1D, Indices1D
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...robots.limb import leg_joints
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import (
    ContactState,
    ContactSwitches,
    DynamicsTerms,
    FootLoad,
    JointState,
    Phase,
    PhaseState,
)
from .leg_forces import force_along, solve_leg

_STILL = 0.05
"""A point that moves up or down more slowly than this [m/s] is still."""


class FootLoadMemory(Signal):
    """The state of ``FootLoadEstimator``."""

    force = Field(("n_contacts", 3), unit="N", frame="world", text="of each point, filtered")
    loaded = Field("n_feet", dtype="bool", text="each foot carries load")
    touched = Field(
        "n_contacts",
        dtype="bool",
        text="each point has touched, or rested, while its foot stands",
    )
    ground = Field(
        "n_contacts",
        unit="m",
        frame="world",
        text="place of its last rest, or the lowest height at which it has touched since",
    )
    still = Field(
        "n_contacts", unit="s", text="time for which each point has neither risen nor sunk"
    )


class FootLoadConstants(Signal):
    """Constants of the robot's description and the parameters."""

    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    leg_joints = Field(
        ("n_feet", "n_leg_joints"), dtype="int64", text="joints of each foot's leg, then -1"
    )
    following = Field(unit="", text="share of a change that the filter takes over in a tick")
    least = Field(2, unit="N", text="forces below and above which a foot's load ends and begins")


class FootLoadScratch(Signal):
    """Intermediate values of a tick."""

    normal = Field(("n_leg_joints", "n_leg_joints"), text="J' J of a leg, damped")
    needed = Field("n_joints", unit="N m", text="torques that the ground gives")
    torque = Field("n_leg_joints", text="y")


class FootLoadEstimator(Block):
    """Force and centre of pressure of every foot from the torques of its leg.

    A sole that lies across an edge carries load between its contact points, where no switch is. The
    torques of its leg show it. With the joint rows of the equations of motion of a leg,

        n_j - tau = J_j' f,

    where J_j has the rows of the foot's contact points, the forces f of the points are the solution of
    least norm. Only their sum and its moment mean anything: the part by which the points push against
    each other has no torque. Both are low-pass filtered with ``filter_time``.

    The upward ``force`` of a foot is the sum over its points, and its ``centre`` of pressure the mean of
    the points, weighted by their upward forces and within the span of the points. A foot is ``loaded``
    from where its force exceeds ``begin`` weights of the robot until it falls below ``end``.

    **Contacts.** After a touchdown a loaded foot may stand on an edge between its points. Load anywhere
    between toe and heel is a sum of loads at both, so then the points count as in contact that are less than
    ``flat_height`` above where they have touched since the foot came down, or, before they have, above where
    its other points have. A point has touched where its switch has closed, and where it has been still for ``still_time``: a
    sole that rests on its heel and across an edge has its toe in the air, and the edge carries what the program
    puts on the toe; with more load there the sole turns about the edge until the toe touches. If no point has touched, all
    count: the foot has come down on the edge.

    A contact that is only held, its switch being open, ends where the point has risen by ``flat_height``: on a sole
    that tips over an edge an end is 2 cm up before a hold of 30 ms is over. All other points in ``switches``
    stay in contact, and before the touchdown only they are.

    The joints' accelerations and friction are left out, so the force is wrong for some milliseconds after
    an impact, and by what friction holds. A leg that is stretched straight shows no load along itself. The block
    does not find where under the sole the ground is.
    """

    class Params(Parameters):
        filter_time: float = live_parameter(
            0.006, unit="s", gt=0.0, text="time constant of the forces' filter"
        )
        begin: float = live_parameter(
            0.2, gt=0.0, le=1.0, text="force from which a foot is loaded, in weights of the robot"
        )
        end: float = live_parameter(
            0.1, gt=0.0, le=1.0, text="force below which it is not, likewise"
        )
        flat_height: float = live_parameter(
            0.006, unit="m", ge=0.0,
            text="height above where it has touched up to which a point of a loaded foot is in contact",
        )  # fmt: skip
        still_time: float = live_parameter(
            0.01,
            unit="s",
            gt=0.0,
            text="a point of a loaded foot that is still for so long has touched",
        )

    Constants = FootLoadConstants
    Scratch = FootLoadScratch
    needs = ("floating base", "feet")
    params: Params
    constants: FootLoadConstants
    terms = Input(DynamicsTerms, text="the model's terms")
    joints = Input(JointState, text="measured torques")
    switches = Input(ContactState, text="points with contact by their switches")
    closed = Input(ContactSwitches, text="the raw switches")
    phase = Input(PhaseState, text="the phase, of the tick before")
    load = Output(FootLoad, text="force and centre of pressure of every foot")
    contacts = Output(ContactState, text="points with contact by switches or by their foot's load")
    memory = State(FootLoadMemory, text="the filter, and where points have touched")

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Return the number of joints of the longest leg."""
        assert robot is not None
        return {"n_leg_joints": leg_joints(robot).shape[1]}

    def setup(self) -> None:
        robot, constants = self.robot, self.constants
        constants.foot_of_point[:] = robot.foot_of_contact()
        constants.leg_joints[:] = leg_joints(robot)

    def prepare(self) -> None:
        p, weight = self.params, self.robot.weight
        self.constants.following = min(1.0, self.period / p.filter_time)
        self.constants.least[:] = min(p.end, p.begin) * weight, p.begin * weight

    @kernel
    @staticmethod
    def step(
        terms: DynamicsTerms,
        joints: JointState,
        switches: ContactState,
        closed: ContactSwitches,
        phase: PhaseState,
        load: FootLoad,
        contacts: ContactState,
        memory: FootLoadMemory,
        params: Params,
        constants: FootLoadConstants,
        scratch: FootLoadScratch,
        period: float,
    ) -> None:
        first = terms.velocity.shape[0] - joints.torque.shape[0]
        for k in range(joints.torque.shape[0]):
            scratch.needed[k] = terms.nonlinear_effects[first + k] - joints.torque[k]
        for foot in range(load.force.shape[0]):
            solve_leg(
                foot, terms.contact_jacobian, scratch.needed, constants.leg_joints[foot],
                constants.foot_of_point, first, scratch.normal, scratch.torque,
            )  # fmt: skip
            filter_forces(foot, terms, memory, constants, scratch.torque, first)
            find_centre(foot, terms, load, memory, constants)
            threshold = constants.least[0] if memory.loaded[foot] else constants.least[1]
            memory.loaded[foot] = load.force[foot] > threshold
            load.loaded[foot] = memory.loaded[foot]
        contacts.active[:] = switches.active
        if phase.phase < Phase.LANDING:
            memory.touched[:] = False
        else:
            time_still_points(terms, period, memory)
            find_touched(terms, switches, memory, constants.foot_of_point, params.still_time)
            leave_risen_points(terms, closed, memory, params.flat_height, contacts)
            add_loaded_points(terms, memory, constants.foot_of_point, params.flat_height, contacts)


@kernel
def filter_forces(
    foot: int,
    terms: DynamicsTerms,
    memory: FootLoadMemory,
    constants: FootLoadConstants,
    solution: Array1D,
    first: int,
) -> None:
    """Let the filtered forces of a foot's points follow J y."""
    leg = constants.leg_joints[foot]
    for point in range(constants.foot_of_point.shape[0]):
        if constants.foot_of_point[point] != foot:
            continue
        for axis in range(3):
            force = force_along(terms.contact_jacobian[point, axis], leg, solution, first)
            memory.force[point, axis] += constants.following * (force - memory.force[point, axis])


@kernel
def find_centre(
    foot: int,
    terms: DynamicsTerms,
    load: FootLoad,
    memory: FootLoadMemory,
    constants: FootLoadConstants,
) -> None:
    """Write a foot's upward force, and its centre of pressure; without load the mean of its points."""
    count, total, positive = 0, 0.0, 0.0
    for point in range(constants.foot_of_point.shape[0]):
        if constants.foot_of_point[point] == foot:
            count += 1
            total += memory.force[point, 2]
            positive += max(memory.force[point, 2], 0.0)
    load.force[foot] = total
    load.centre[foot, :] = 0.0
    for point in range(constants.foot_of_point.shape[0]):
        if constants.foot_of_point[point] == foot:
            share = max(memory.force[point, 2], 0.0) / positive if positive > 0.0 else 1.0 / count
            load.centre[foot, :] += share * terms.contact_position[point]


@kernel
def find_touched(
    terms: DynamicsTerms,
    switches: ContactState,
    memory: FootLoadMemory,
    foot: Indices1D,
    still_time: float,
) -> None:
    """Note where the points of the feet that stand have touched, and forget it for the others."""
    for i in range(foot.shape[0]):
        stands = bool(memory.loaded[foot[i]])
        rests = stands and memory.still[i] >= still_time
        for j in range(foot.shape[0]):
            stands = stands or (foot[j] == foot[i] and switches.active[j])
        known, height = memory.touched[i], terms.contact_position[i, 2]
        memory.touched[i] = stands and (known or switches.active[i] or rests)
        # A contact lasts longer than its switch is closed, so a point may have left the ground already.
        if rests or (switches.active[i] and not (known and memory.ground[i] < height)):
            memory.ground[i] = height


@kernel
def time_still_points(terms: DynamicsTerms, period: float, memory: FootLoadMemory) -> None:
    """Count how long each point has been still."""
    for i in range(memory.still.shape[0]):
        still = abs(terms.contact_velocity[i, 2]) < _STILL
        memory.still[i] = memory.still[i] + period if still else 0.0


@kernel
def leave_risen_points(
    terms: DynamicsTerms,
    closed: ContactSwitches,
    memory: FootLoadMemory,
    flat_height: float,
    contacts: ContactState,
) -> None:
    """Take out of the ``contacts`` the points with open switches that have left the ground."""
    for i in range(closed.closed.shape[0]):
        height = terms.contact_position[i, 2]
        if not closed.closed[i] and height >= memory.ground[i] + flat_height:
            contacts.active[i] = False


@kernel
def add_loaded_points(
    terms: DynamicsTerms,
    memory: FootLoadMemory,
    foot: Indices1D,
    flat_height: float,
    contacts: ContactState,
) -> None:
    """Add to the ``contacts`` the points of loaded feet that are near the ground under them."""
    for i in range(foot.shape[0]):
        if not memory.loaded[foot[i]]:
            continue
        ground = memory.ground[i]
        if not memory.touched[i]:
            ground = math.inf
            for j in range(foot.shape[0]):
                if foot[j] == foot[i] and memory.touched[j]:
                    ground = min(ground, memory.ground[j])
        if terms.contact_position[i, 2] < ground + flat_height:
            contacts.active[i] = True
