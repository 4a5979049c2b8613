"""When the legs of a somersault leave the tuck: so that it has turned as planned at touchdown."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import Array, Indices
from ...mathematics.kernel import kernel
from ...mathematics.rotations import pitch_angle
from ...planner.library.jump_table import locate
from ...runtime.language.parameters import Parameters, parameter
from ..signals import Phase
from .jump_phase import planned_touchdown_height, time_to_height

PITCH = 1
"""The axis of a somersault: the world's y axis, which is the body's too."""
SETTLED = 0.02
"""From so long after lift-off on [s] the measured momentum is that of the flight."""
FULL = 0.95
"""The rate of rotation is measured while the planned one is at least this share of its greatest."""
SPIN_TIME, SPIN_RANGE = 0.03, 0.2
"""Time constant of its mean [s], and by what share it may differ from the plan's."""
TUCKED_SHIFT, OPEN_SHIFT = 0.3, 0.4
"""By how much the plan is hastened or slowed down at most before and after the legs have left the tuck,
as a share of time."""
CLOSING = 0.008
"""So long before touchdown [s] the plan is on time again."""


class Turning(Parameters):
    """How the flight of a somersault is retimed; see ``follow_turn``."""

    gain: float = parameter(
        50.0, unit="1/s", ge=0.0, text="rate at which an error of the rotation is corrected"
    )
    early: float = parameter(
        0.04, unit="s", ge=0.0, le=0.1, text="by how much earlier the legs leave the tuck at most"
    )
    late: float = parameter(
        0.005, unit="s", ge=0.0, le=0.05,
        text="by how much later; then they must hurry, and their feet are faster at touchdown",
    )  # fmt: skip
    aim: float = parameter(
        0.0, unit="rad", ge=-0.5, le=0.5,
        text="how much further than planned the body has turned at touchdown",
    )  # fmt: skip


class Body(NamedTuple):
    """The measured motion: fields of ``DynamicsTerms``."""

    base_rotation: Array
    com: Array
    com_velocity: Array
    angular_momentum: Array
    centroidal_matrix: Array


class Pose(NamedTuple):
    """The planned motion: fields of ``JumpReference``."""

    phase: Indices
    touchdown_time: Array
    com: Array
    com_velocity: Array
    orientation: Array


class Rotation(NamedTuple):
    """The fields of ``planner.library.jump_table.FlightRotation``."""

    time: Array
    rate: Array
    left: Array
    marks: Array


class TurnSettings(NamedTuple):
    """The parameters ``Turning``, and the block's period [s]."""

    gain: float
    early: float
    late: float
    aim: float
    period: float


class TurnProgress(NamedTuple):
    """Fields of the state of ``JumpPlan``, of shape () each: how late the plan is read [s], and how fast
    the robot turns as a share of the plan."""

    late: Array
    spin: Array


@kernel
def follow_turn(
    instant: Array,
    body: Body,
    pose: Pose,
    rotation: Rotation,
    settings: TurnSettings,
    progress: TurnProgress,
) -> None:
    """Hasten or slow down the plan in flight, by how far the robot has turned and how long it will fly.

    Let the plan be read at tau, with w(tau) its rate of rotation with the joints held, G(tau) the
    rest of this rotation until touchdown, and w_td its last rate. Let the robot turn c w where the
    plan turns w, and have turned further than the plan by s. Angular momentum is conserved, so::

        s' = w (c - tau'),     at touchdown:  s_td = s + (c - 1) G - w_td d

    where d is by how much the plan must still be shifted, with its legs out, to land when the robot
    falls onto its feet. A shift in the tuck instead changes s_td by w_td - w for every second of it::

        tau' = 1 + gain (s_td - aim) / (w - w_td)

    From when the legs are tucked until they are out, as far as d stays between -``early`` and ``late``.
    Then tau' is what makes d zero shortly before touchdown.

    Args:
        instant: as ``plan_progress.plan_instant`` writes it; ``pose`` is of that instant.
    """
    now = float(instant[0])
    if int(pose.phase[()]) != Phase.FLIGHT or now < float(rotation.time[0]) + SETTLED:
        progress.spin[()] = 1.0
        return
    planned = float(pose.touchdown_time[()]) - now
    falls = time_to_height(
        float(body.com[2]), float(body.com_velocity[2]),
        planned_touchdown_height(float(pose.com[2]), float(pose.com_velocity[2]), planned),
    )  # fmt: skip
    tucked, out = float(rotation.marks[0]), float(rotation.marks[1])
    if falls < CLOSING or now < tucked:
        return
    shift = planned - falls
    if now >= out:
        change = shift / max(falls - CLOSING, settings.period)
        change = min(max(change, -OPEN_SHIFT), OPEN_SHIFT) * settings.period
        progress.late[()] -= change
        return
    rate, left = (
        value_at(rotation.time, rotation.rate, now),
        value_at(rotation.time, rotation.left, now),
    )
    lands = float(rotation.rate[rotation.rate.shape[0] - 1])
    sign = float(rotation.marks[3])
    if rate >= FULL * float(rotation.marks[2]):
        inertia = float(body.centroidal_matrix[3 + PITCH, 3 + PITCH])
        spin = sign * float(body.angular_momentum[PITCH]) / (inertia * rate)
        spin = min(max(spin, 1.0 - SPIN_RANGE), 1.0 + SPIN_RANGE)
        progress.spin[()] += (spin - float(progress.spin[()])) * settings.period / SPIN_TIME
    surplus = sign * turned_beyond(body.base_rotation, pose.orientation)
    surplus += (float(progress.spin[()]) - 1.0) * left - lands * shift - settings.aim
    if rate == lands:  # the plan turns as fast as with its legs out: a shift would change nothing
        return
    change = settings.gain * surplus / (rate - lands)
    change = min(max(change, -TUCKED_SHIFT), TUCKED_SHIFT) * settings.period
    progress.late[()] -= min(max(change, shift - settings.late), shift + settings.early)


@kernel
def value_at(times: Array, values: Array, time: float) -> float:
    """The value at a time in a table that is linear between its rows; (n,) each."""
    low, share = locate(times, time)
    return float(values[low]) + share * (float(values[low + 1]) - float(values[low]))


@kernel
def turned_beyond(rotation: Array, orientation: Array) -> float:
    """By how much [rad] a body of this ``rotation`` (3, 3) has turned further about its y axis than one
    of the planned ``orientation``, a quaternion x, y, z, w."""
    planned = pitch_angle(orientation)
    measured = math.atan2(-float(rotation[2, 0]), float(rotation[0, 0]))
    return math.atan2(math.sin(measured - planned), math.cos(measured - planned))
