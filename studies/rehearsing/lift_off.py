"""Rehearses a plan in simulation and learns what the controller misses of it at lift-off.

The graph that will run the plan runs it with a few seeds in the standard trial. The mean deviation d
at lift-off from the plan, of the velocity of the centre of mass and of the angular momentum, is
learnt away with the corrections c of ``blocks.BalanceTarget``: c becomes c - GAIN d, and the plan is
run again with the same seeds. What does not make the deviation smaller is not kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from ...blocks.jumping.plan_progress import speed_error
from ...files.nodes import text_of
from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...planner.library.rehearsed import ZERO, Deviation, Rehearsed, Vector
from ...runtime.graph import load
from ...runtime.language.errors import AloftError
from ...runtime.language.flat_graph import FlatGraph
from ...runtime.running.run_result import RunResult
from ..batch.jobs import job_results
from ..batch.seeds import overrides_for
from ..trials import trial_settings

Found = TypeVar("Found")

TRIAL = "standard"
SEEDS = (7001, 7002, 7003)
TRIES = 2
"""Corrections that are tried after the run without any."""
GAIN = 0.8
"""Share of the deviation that a try corrects; half of it after a try that was too much or did not help."""
NEGLIGIBLE = 0.005
"""Deviation below which no correction is made [m/s]."""
WORTH = 0.75
"""A correction is kept only if it leaves at most this share of the deviation."""
LARGEST = 0.15
"""The largest correction along each axis [m/s]; of the momentum this speed at the lever arm."""
LEVER = 1.0 / 3.0
"""The lever arm, as a share of the height of the centre of mass, at which an angular momentum is
compared with a velocity: about the radius of gyration of a standing robot."""
EARLY, FLIGHT = 0.1, 10
"""Contact may end that long before the planned lift-off [s]; a flight is that many ticks without."""


@dataclass(frozen=True)
class LiftOff:
    """One run: by how much it missed the plan at lift-off (``None`` if it never left the ground),
    as velocity [m/s] and angular momentum [N m s] in one array (6,), and whether it succeeded."""

    missed: Array | None
    landed: bool


Measure = Callable[[Vector, Vector], Sequence[LiftOff]]
"""Runs a plan with a velocity and a momentum correction, once with every seed."""


def learn(
    measure: Measure, momentum_unit: float, *, tries: int = TRIES,
    seeds: Sequence[int] = SEEDS, on_try: Callable[[str], None] = lambda text: None,
) -> Rehearsed:  # fmt: skip
    """Learn the corrections of a plan.

    Args:
        measure: runs the plan.
        momentum_unit: the angular momentum [N m s] that counts as much as 1 m/s.
        tries: how many corrections are tried at most.
        seeds: those that ``measure`` uses, for the record.
        on_try: is told what is being done.
    """
    unit = np.array([1.0] * 3 + [momentum_unit] * 3)
    on_try("without a correction")
    before = best = deviation(measure(ZERO, ZERO), unit)
    correction, gain, tried = np.zeros(6), GAIN, 0
    while tried < tries and best.flown and best.size > max(NEGLIGIBLE, best.scatter):
        missed = np.array(best.velocity + best.momentum)
        changed = np.clip(correction - gain * missed, -LARGEST * unit, LARGEST * unit).round(5)
        tried += 1
        on_try(f"correction {tried} of at most {tries}; {1e3 * best.size:.0f} mm/s are left")
        found = deviation(measure(*parts_of(changed)), unit)
        too_much = float(missed / unit @ (np.array(found.velocity + found.momentum) / unit)) < 0.0
        better = found.size < best.size and found.flown >= best.flown
        if better and found.landed >= best.landed:
            correction, best = changed, found
            gain *= 0.5 if too_much else 1.0
        else:
            gain *= 0.5
    if not before.flown:
        reason = "no run left the ground, so nothing can be learnt"
    elif tried == 0:
        reason = "the deviation is negligible, or smaller than its scatter: nothing to correct"
    elif best.size > WORTH * before.size:
        reason = f"no correction of {tried} tried made the deviation smaller by a quarter"
        correction, best = np.zeros(6), before
    else:
        reason = f"the correction leaves {best.size / before.size:.0%} of the deviation"
    velocity, momentum = parts_of(correction)
    return Rehearsed(velocity, momentum, before, best, tuple(seeds), TRIAL, reason)


def deviation(runs: Sequence[LiftOff], unit: Array) -> Deviation:
    """Return the mean over the runs that left the ground; see ``Deviation``."""
    missed = np.array([run.missed for run in runs if run.missed is not None])
    landed = sum(run.landed for run in runs)
    if len(missed) == 0:
        return Deviation(ZERO, ZERO, 0.0, 0.0, landed, 0, len(runs))
    mean = missed.mean(axis=0)
    spread = missed.std(axis=0, ddof=1) if len(missed) > 1 else np.zeros(6)
    return Deviation(
        *parts_of(mean),
        size=float(np.linalg.norm(mean / unit)),
        scatter=float(np.linalg.norm(spread / unit) / np.sqrt(len(missed))),
        landed=landed,
        flown=len(missed),
        runs=len(runs),
    )


def parts_of(values: Array) -> tuple[Vector, Vector]:
    """Split a correction (6,) into the velocity's part and the angular momentum's."""
    x, y, z, kx, ky, kz = (float(value) for value in values)
    return (x, y, z), (kx, ky, kz)


def corrected_parameters(graph: FlatGraph) -> dict[str, str]:
    """Return the parameters of a graph that follow the plan's corrections, by the correction that
    each follows.

    Raises:
        AloftError: one of the two is followed by no parameter.
    """
    found = {}
    for kind in ("velocity_correction", "momentum_correction"):
        for path, block in graph.plain().items():
            for key, value in block["with"].items():
                if value == {"from": f"plan.{kind}"}:
                    found[kind] = f"{path}.{key}"
        if kind not in found:
            raise AloftError(
                f"{graph.file}: no parameter takes what a rehearsal learns, {{from: plan.{kind}}}: "
                "include controllers/planned.yaml, and set targets." + kind + " nowhere"
            )
    return found


def rehearse(
    path: Path, overrides: Sequence[str], parameters: dict[str, str], momentum_unit: float,
    *, tries: int = TRIES, seeds: Sequence[int] = SEEDS,
    on_try: Callable[[str], None] = lambda text: None,
) -> Rehearsed:  # fmt: skip
    """Rehearse the plan of a graph on all processors; see ``learn``.

    Args:
        path, overrides: the graph that will run the plan. Its trial and seed are replaced.
        parameters: from ``corrected_parameters``.

    Raises:
        LoadError: the graph may not run.
        AloftError: a run could not be made.
    """
    measure = in_all_worlds(path, overrides, parameters, TRIAL, seeds, run_once, "the plan")
    return learn(measure, momentum_unit, tries=tries, seeds=seeds, on_try=on_try)


def in_all_worlds(
    path: Path, overrides: Sequence[str], parameters: dict[str, str], trial: str, seeds: Sequence[int],
    run: Callable[[tuple[Path, Sequence[str]]], Found], what: str,
) -> Callable[[Vector, Vector], list[Found]]:  # fmt: skip
    """Return a function that runs a graph in a trial with a correction of velocity and one of
    angular momentum, on all processors.

    Args:
        path, overrides, parameters: as ``rehearse`` takes them.
        run: makes one run in a process of its own; what it finds comes in the order of ``seeds``.
        what: is rehearsed, for the text of an error.

    Raises:
        LoadError: the graph may not run.
        AloftError: a run could not be made; raised by what is returned.
    """
    settings = [f"{key}={text_of(value)}" for key, value in trial_settings(trial).items()]
    common = [*overrides, *settings, "plan.rehearsed=false"]
    graph = load(path, common)

    def measure(velocity: Vector, momentum: Vector) -> list[Found]:
        values = {"velocity_correction": velocity, "momentum_correction": momentum}
        given = [f"{parameters[kind]}={text_of(list(value))}" for kind, value in values.items()]
        jobs = [(path, overrides_for(graph, [*common, *given], seed)) for seed in seeds]
        found: dict[int, Found] = {}
        with closing(job_results(run, jobs)) as results:
            for result in results:
                if result.error:
                    raise AloftError(f"{what} cannot be rehearsed: {result.error}")
                found[result.index] = result.value
        return [found[index] for index in range(len(jobs))]

    return measure


def run_once(job: tuple[Path, Sequence[str]]) -> LiftOff:
    """Run a graph once, and compare its first lift-off with the plan."""
    path, overrides = job
    result = load(path, overrides).run()
    result.raise_if_failed()
    return LiftOff(missed_at_lift_off(result), result.success)


def missed_at_lift_off(result: RunResult) -> Array | None:
    """Return the error of a run's first lift-off from the plan, (6,); ``None`` without a flight.

    The upward velocity is compared by the apex that follows from it, as ``speed_error`` does: a
    robot that lifts off higher may be slower. The robot stands along the world's axes, as the plan
    does, so no vector is rotated.
    """

    def plan(name: str) -> Array:
        return np.asarray(result.signal(f"plan.reference.{name}"), np.float64)

    def robot(name: str) -> Array:
        return np.asarray(result.signal(f"robot.truth.{name}"), np.float64)

    time, planned = plan("time"), float(plan("lift_off_time")[0])
    after = int(np.searchsorted(time, planned - 1e-9))
    loaded = np.asarray(result.signal("robot.truth.contact_touched").any(axis=1), np.bool_)
    start = int(np.searchsorted(time, planned - EARLY))
    free = np.flatnonzero(
        [not loaded[tick : tick + FLIGHT].any() for tick in range(start, len(time) - FLIGHT)]
    )
    if after >= len(time) or len(free) == 0:
        return None
    first = start + int(free[0])
    late = float(time[after]) - planned
    speed = plan("com_velocity")[after] + [0.0, 0.0, GRAVITY * late]
    height = plan("com")[after, 2] - speed[2] * late + 0.5 * GRAVITY * late**2
    velocity = robot("com_velocity")[first] - speed
    velocity[2] = speed_error(
        float(robot("com")[first, 2] - robot("com")[0, 2]),
        float(robot("com_velocity")[first, 2]),
        float(height - plan("com")[0, 2]),
        float(speed[2]),
    )
    momentum = robot("angular_momentum")[first] - plan("angular_momentum")[after]
    return np.concatenate([velocity, momentum])
