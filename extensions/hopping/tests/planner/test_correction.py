"""A corrected motion fulfils the constraints of its problem, by other means than the corrector's own, and stays near."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.extensions.hopping.planner import correction
from aloft.extensions.hopping.planner.correction import Corrector
from aloft.extensions.hopping.planner.hop_plans import samples_of_hops
from aloft.extensions.hopping.planner.hop_request import HopRequest, coarse, task_of
from aloft.planner.problem.program_functions import program_functions
from aloft.planner.problem.unpacking import pack
from aloft.planner.solving.solve import make_problem
from aloft.planner.solving.solver import VIOLATION, violation_of
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
SAMPLES = samples_of_hops(find_robot("bruce"))


def problem_and_guess(wanted: HopRequest):
    task = coarse(task_of(wanted, "bruce", SAMPLES.reach.rise).resolved(ROBOT))
    problem = make_problem(task, ROBOT, coordinates="full")
    return problem, pack(problem, SAMPLES.interpolated(wanted))


@pytest.mark.long
def test_all_constraints_hold_near_the_guess() -> None:
    problem, guess = problem_and_guess(HopRequest(0.13, 0.04, 0.2))
    constraint = program_functions(problem.assembly)["nlp_g"]
    assert violation_of(problem, guess, constraint)[0] > 1e-2
    found = Corrector(problem).correct(problem, guess)
    assert found.solved
    assert found.steps <= correction.STEPS
    assert violation_of(problem, found.values, constraint)[0] <= VIOLATION
    n, starts = problem.coordinates.size, problem.assembly.state_start
    moved = np.array([(found.values - guess)[start : start + n] for start in starts])
    assert 0.0 < np.abs(moved).max() < 0.2  # m or rad


@pytest.mark.long
def test_a_guess_from_far_away_is_not_called_solved() -> None:
    problem, guess = problem_and_guess(HopRequest(0.13, 0.04, 0.2))
    far = guess + 0.5 * np.random.default_rng(1).standard_normal(len(guess))
    found = Corrector(problem).correct(problem, far)
    assert not found.solved
