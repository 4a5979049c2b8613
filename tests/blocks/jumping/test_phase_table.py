"""The table of phases: what leads where, in which order, and when each condition holds."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.jumping.phase_table import (
    TABLE,
    TRANSITIONS,
    Condition,
    find_conditions,
    next_phase,
)
from aloft.blocks.signals import Phase

LIMITS = np.array([0.02, 0.01, 0.5, 0.35, 0.2, 1.5])


def conditions(
    now=0.0, in_phase=0.0, lift_off=1.0, touchdown=1.3, remaining=0.0, unloaded=0.0,
    planned=Phase.STAND, another=False, limits=LIMITS, ahead=0.0,
):  # fmt: skip
    holds = np.zeros(len(Condition), bool)
    times = np.array([now, in_phase, lift_off, touchdown, remaining, unloaded, ahead])
    find_conditions(times, limits, int(planned), another, holds)
    return {condition for condition in Condition if holds[condition]}


@pytest.mark.parametrize("transition", TRANSITIONS, ids=lambda t: f"{t.phase.name}-{t.when.name}")
def test_each_transition_is_taken_when_it_alone_applies(transition):
    holds = np.zeros(len(Condition), bool)
    assert next_phase(TABLE, int(transition.phase), holds) == transition.phase
    holds[transition.when] = True
    assert next_phase(TABLE, int(transition.phase), holds) == transition.to


def test_of_several_the_first_in_the_table_is_taken():
    holds = np.ones(len(Condition), bool)
    found = {phase: Phase(next_phase(TABLE, int(phase), holds)) for phase in Phase}
    assert found == {
        Phase.STAND: Phase.FAULT, Phase.SQUAT: Phase.FAULT, Phase.THRUST: Phase.FAULT,
        Phase.FLIGHT: Phase.LANDING, Phase.LANDING: Phase.FAULT, Phase.RECOVER: Phase.FAULT,
        Phase.FAULT: Phase.FAULT,
    }  # fmt: skip


def test_every_phase_but_the_first_can_be_reached():
    assert {t.to for t in TRANSITIONS} == set(Phase) - {Phase.STAND}


def test_when_the_conditions_hold():
    C = Condition
    assert conditions() == {C.TOUCHED_DOWN}
    assert C.PLAN_SQUATS in conditions(planned=Phase.SQUAT)
    assert C.PLAN_THRUSTS not in conditions(planned=Phase.SQUAT)
    assert {C.PLAN_SQUATS, C.PLAN_THRUSTS} <= conditions(planned=Phase.FLIGHT)
    assert C.LIFT_OFF_DUE not in conditions(now=1.01)
    assert C.LIFT_OFF_DUE in conditions(now=1.01, unloaded=0.002)
    assert C.LIFT_OFF_DUE in conditions(now=1.03)
    assert C.LEFT_EARLY in conditions(now=0.95, in_phase=0.1, unloaded=0.01)
    assert C.LEFT_EARLY not in conditions(now=0.85, in_phase=0.1, unloaded=0.01)
    assert C.TOUCHED_DOWN not in conditions(in_phase=0.1, remaining=0.2)
    assert C.TOUCHED_DOWN in conditions(in_phase=0.16, remaining=0.1)
    assert C.TOUCHED_DOWN not in conditions(in_phase=0.2, remaining=0.1, unloaded=0.002)
    assert C.TOUCHED_DOWN in conditions(in_phase=0.2, remaining=0.005, unloaded=0.2, ahead=0.004)
    assert C.TOUCHED_DOWN not in conditions(
        in_phase=0.2, remaining=0.007, unloaded=0.2, ahead=0.004
    )
    assert C.TOUCHED_DOWN not in conditions(
        in_phase=0.2, remaining=0.001, unloaded=0.2, ahead=0.001
    )
    assert C.TOUCHED_DOWN not in conditions(remaining=0.005, unloaded=0.2, ahead=0.004)
    assert C.OVERDUE in conditions(in_phase=0.51, unloaded=0.5)
    assert C.OVERDUE not in conditions(in_phase=0.49, unloaded=0.5)
    assert C.RESTED in conditions(in_phase=0.35)
    assert C.RESTED not in conditions(in_phase=0.35, another=True)
    assert C.THRUSTS_AGAIN in conditions(planned=Phase.THRUST, another=True)
    assert C.THRUSTS_AGAIN not in conditions(planned=Phase.THRUST)
    assert C.LOST_CONTACT in conditions(unloaded=0.21)
