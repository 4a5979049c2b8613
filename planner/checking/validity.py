"""Decides whether a robot may follow a plan: named tests against exact dynamics and the task.

The check is independent of the solver. It uses exact dynamics (``models/exact_dynamics.py``) and nothing of the planner's own model. A
plan is valid if every test passes. The report keeps the measured value of every test, passed or not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...robots.description import RobotDescription
from ..task.files import JumpTaskError
from ..task.plan import ARRAYS, InvalidPlanError, PlannedJump
from .evidence import Evidence
from .plan_tests import PLAN_TESTS
from .replay import replay


@dataclass(frozen=True)
class PlanTest:
    """One test: passed where ``value`` is at most ``limit``, both in ``unit``.

    ``where`` says at which instant, joint or contact the value was found.
    """

    name: str
    passed: bool
    value: float
    limit: float
    unit: str
    where: str
    text: str


@dataclass(frozen=True)
class ValidityReport:
    """Tests of one plan, and ``figures``: its performance and loads, with their units."""

    tests: tuple[PlanTest, ...]
    figures: Mapping[str, float] = field(default_factory=dict)

    @property
    def valid(self) -> bool:
        """True if every test passed."""
        return all(test.passed for test in self.tests)

    @property
    def failed(self) -> tuple[PlanTest, ...]:
        """The tests that did not pass."""
        return tuple(test for test in self.tests if not test.passed)

    def as_json(self) -> dict[str, Any]:
        """Return the report as plain data, as it stands in a plan's file."""
        return {
            "valid": self.valid,
            "tests": [dict(vars(test)) for test in self.tests],
            "figures": dict(self.figures),
        }

    def explain(self) -> str:
        """Return one line for every test that failed."""
        return "\n".join(
            f"{test.name}: {test.text} is {test.value:.4g} {test.unit}, at most {test.limit:.4g} "
            f"{test.unit} is allowed{f' ({test.where})' if test.where else ''}"
            for test in self.failed
        )


def check_plan(plan: PlannedJump, robot: RobotDescription) -> ValidityReport:
    """Test a plan with the actuator profile it is for; about 0.1 s."""
    robot = plan.task.equipped(robot)
    broken = broken_array(plan, robot)
    if broken:
        return ValidityReport((PlanTest("arrays", False, math.inf, 0.0, "", broken, "the arrays"),))
    try:
        evidence = Evidence(plan, robot, replay(plan, robot))
    except ValueError as error:
        return ValidityReport((PlanTest("phases", False, math.inf, 0.0, "", str(error), "phases"),))
    tests = tuple(_run_tests(evidence))
    return ValidityReport(tests, evidence.figures())


def _run_tests(evidence: Evidence) -> Iterator[PlanTest]:
    for make in PLAN_TESTS:
        for found in make(evidence):
            yield PlanTest(
                found.name, bool(found.value <= found.limit), float(found.value),
                float(found.limit), found.unit, found.where, found.text,
            )  # fmt: skip


def checked(plan: PlannedJump, robot: RobotDescription) -> PlannedJump:
    """Return the plan with its validity report."""
    return plan.with_report(check_plan(plan, robot).as_json())


def require_valid(plan: PlannedJump, robot: RobotDescription) -> None:
    """Let only valid plans through: what every user of a plan calls before a robot moves.

    The check is made anew; a report that came with a file is not believed.

    Raises:
        InvalidPlanError: with a line for every test that failed.
    """
    report = check_plan(plan, robot)
    if not report.valid:
        raise InvalidPlanError(
            f"the plan {plan.task.name!r} is not valid:\n{report.explain()}",
            plan.with_report(report.as_json()),
        )


def failure_text(error: Exception) -> str:
    """Return what binds where a task has no valid plan, in a few words, from what the planner raised."""
    if isinstance(error, InvalidPlanError):
        return ", ".join(t["name"] for t in error.plan.report["tests"] if not t["passed"])
    if isinstance(error, JumpTaskError):
        return "contradicts itself"
    return getattr(error, "family", "") or "no plan"


def broken_array(plan: PlannedJump, robot: RobotDescription) -> str:
    """Return the fault of the arrays themselves; empty where there is none."""
    knots, joints = len(plan.time), len(robot.joints)
    shapes: dict[str, tuple[int, ...]] = {
        "time": (knots,),
        "phase": (knots,),
        "position": (knots, 7 + joints),
        "velocity": (knots, 6 + joints),
        "acceleration": (knots, 6 + joints),
        "joint_torque": (knots, joints),
        "contact": (knots, len(robot.contacts)),
        "contact_force": (knots, len(robot.contacts), 3),
        **dict.fromkeys(("com", "com_velocity", "angular_momentum"), (knots, 3)),
    }
    for name in ARRAYS:
        array = np.asarray(getattr(plan, name))
        if array.shape != shapes[name]:
            return f"{name} has the shape {array.shape}, expected {shapes[name]}"
        if not np.isfinite(array).all():
            return f"{name} is not finite at knot {int(np.argwhere(~np.isfinite(array))[0][0])}"
    length = np.abs(np.linalg.norm(plan.position[:, 3:7], axis=1) - 1.0)
    if length.max() > 1e-9:
        return f"the base quaternion at knot {int(length.argmax())} is not of length 1"
    return ""
