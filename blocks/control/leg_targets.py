"""What ``LegInverseKinematics`` does in every tick before and after its legs, as kernels."""

from __future__ import annotations

from ...mathematics.arrays import Array1D, Flags0D, Flags1D, Indices1D
from ...mathematics.kernel import kernel
from ...robots.five_joint_track import LegTargets
from ..signals import Phase
from .followed_plan import Flown, Following, PlannedJoints, Soles, follow_plan, go_on

_FLIGHT = int(Phase.FLIGHT)


@kernel
def begin_targets(
    measured: Array1D,
    held: Indices1D,
    angles: Array1D,
    may_slide: Flags1D,
    toes_first: Flags0D,
    slides: Flags1D,
    target: LegTargets,
) -> None:
    """Joints that belong to no leg stay where they are measured; the ``held`` ones at ``angles``.

    A foot out of reach ``slides`` (1,) if it ``may_slide`` (1,), but not where the plan lands on the
    toes first, of shape (): there a sole that was laid flat would land on all of its points.
    """
    slides[0] = may_slide[0] and not toes_first[()]
    for joint in range(measured.shape[0]):
        target.position[joint] = measured[joint]
        target.velocity[joint] = 0.0
    for k in range(held.shape[0]):
        target.position[held[k]] = angles[k]


@kernel
def end_targets(
    follows: bool,
    following: Following,
    soles: Soles,
    plan: PlannedJoints,
    flown: Flown,
    target: LegTargets,
    known: Flags0D,
    found: Array1D,
) -> None:
    """Take the plan's joints instead where it flies, or has just landed, and is followed; remember what
    was ``found``."""
    if follows and plan.phase[()] == _FLIGHT:
        follow_plan(following, soles, plan, flown, target)
    elif follows:
        go_on(following, plan, flown, target)
    found[:] = target.position
    known[()] = True
