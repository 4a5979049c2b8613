"""Jumps of robots that differ from their model in one effect each, after the robot's own calibration.

The effects and the jumps are those of ``graphs/studies/effects.yaml``, in the robust trial. For each effect and seed the robot sways
with the effect on (``graphs/sway.yaml``), ``aloft robot calibrate`` finds what it is like from that alone, and the
controller that jumps is told what was found. Plans leave the margin of all robots as a bench finds them (``real_tasks.EFFORT``).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import yaml

from ....planner.library.library import shipped_folder
from ....runtime.language.errors import AloftError
from ....studies.batch.jobs import job_results
from ....studies.expansion import Cell, cells, load_cell
from ....studies.reading import read_study
from ..rows import Row
from .real_robot import FOLDER, MISSED_GOAL, calibrated, chosen, missed_row, with_margin

SEEDS = range(96200, 96220)
"""The robots; nothing is tuned on them."""
LARGER_MISSED_GOAL = 0.2
"""The largest good share of robots that do not land with the larger of two sizes of an effect."""
LARGER = (
    "gyroscope 2 ms late", "IMU filter 100 Hz", "velocity filter 2 ms", "encoders before 10 mrad of play",
    "saturation 10 %", "gears of 1000 N m/rad", "links longer or shorter by up to 1 %", "friction at rest twice",
    "cogging 1 % of the peak torque",
)  # fmt: skip


@dataclass(frozen=True)
class EffectJob:
    """A robot by its seed, and the effect it has."""

    seed: int
    effect: str


def known_effects(
    seeds: Sequence[int] = SEEDS, asked: Sequence[str] = (), workers: int = 0
) -> list[Row]:
    """Measure for each effect and jump the share of robots that do not land.

    ``results/real_robot/effects.json`` has the counts of all that are done, in the order of the seeds.

    Args:
        seeds: of the robots.
        asked: some of the effects; none: all.
        workers: processes; 0: as many as there are processors.

    Raises:
        AloftError: there is no such effect.
    """
    effects = chosen("effect", asked, tuple(cells_by_effect()))
    jobs = [EffectJob(seed, effect) for seed in seeds for effect in effects]
    counts: dict[tuple[str, str], dict[str, Any]] = {}
    FOLDER.mkdir(parents=True, exist_ok=True)
    with closing(job_results(landed, jobs, workers=workers)) as results:
        for result in results:
            if result.error:
                raise AloftError(result.error)
            effect = jobs[result.index].effect
            for task, reason in result.value.items():
                new = {"effect": effect, "task": task, "successes": 0, "n": 0, "reasons": []}
                row = counts.setdefault((effect, task), new)
                row["n"] += 1
                row["successes"] += not reason
                row["reasons"] += [reason] if reason else []
            rows = sorted(counts.values(), key=lambda row: effects.index(row["effect"]))
            text = json.dumps({"rows": rows}, indent=1)
            (FOLDER / "effects.json").write_text(text + "\n", encoding="utf-8")
    return [
        missed_row(
            f"{row['task']}, {row['effect']}, calibrated", row["successes"], row["n"],
            LARGER_MISSED_GOAL if row["effect"] in LARGER else MISSED_GOAL,
        )
        for row in rows
    ]  # fmt: skip


def cells_by_effect() -> Mapping[str, Sequence[Cell]]:
    """Return the jumps of each effect."""
    found: dict[str, list[Cell]] = {}
    for cell in cells(read_study(shipped_folder() / "studies" / "effects.yaml")):
        found.setdefault(cell.labels["effect"], []).append(cell)
    return found


def landed(job: EffectJob) -> dict[str, str]:
    """Run the jumps and return the reason of each failure by the jump's name; empty where it
    landed."""
    graphs, effects, found = shipped_folder(), cells_by_effect(), {}
    jumps, name = effects[job.effect], f"effect_{[*effects].index(job.effect)}"
    effect = {k: v for k, v in jumps[0].overrides.items() if k.startswith("robot.")}
    sway = FOLDER.absolute() / f"{name}.yaml"
    include = [str(graphs / "sway.yaml"), *(str(file) for file in jumps[0].include)]
    sway.parent.mkdir(parents=True, exist_ok=True)
    sway.write_text(yaml.safe_dump({"include": include, "set": effect}), encoding="utf-8")
    try:
        fragment = calibrated(sway, job.seed, name)
    except AloftError as error:
        return {cell.task: f"not calibrated: {error}" for cell in jumps}
    for cell in jumps:
        sets = {
            **cell.overrides,
            "plan.task": with_margin(cell.overrides["plan.task"]),
            "robot.seed": job.seed,
        }
        files = [*cell.include, graphs / "controllers/late_sensors.yaml", fragment]
        result = load_cell(cell.graph, files, sets, graphs / "bench.yaml").run(log=False)
        found[cell.task] = "" if result.success else result.reason
    return found
