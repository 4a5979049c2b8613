"""Cost of a run of `aloft falsify`: whole, and from the tick where it first differs from the run
that all draws share."""

from __future__ import annotations

import random
from pathlib import Path
from time import process_time

import numpy as np

from ...extensions.analysis.studies.falsification import searched_cells
from ...runtime.language.errors import AloftError
from ...studies.expansion import Job, job, seeded_graph
from ...studies.reading import read_study
from ...studies.shared_start import shared_result
from ...studies.tuning import draw_runs, value_at
from .rows import Row

STUDY = Path(__file__).parents[2] / "graphs" / "studies" / "worst_push_12cm.yaml"
RUNS, MINUTES, CORES = 5000, 15.0, 2
"""The goal: so many runs in this time on so many processors."""


def falsification(rounds: int = 20) -> list[Row]:
    """Measure the processor time of random draws of the worst push, each made in both ways in turn.

    Raises:
        AloftError: a run has other bytes than the whole one.
    """
    draws = list(_draws(rounds + 1))
    shared_result(draws[0])
    whole, shared = np.zeros(rounds), np.zeros(rounds)
    for k, work in enumerate(draws[1:]):
        begin = process_time()
        plain = seeded_graph(work).run(log=False)
        middle = process_time()
        result = shared_result(work)
        whole[k], shared[k] = middle - begin, process_time() - middle
        if result is None or result.run_hash != plain.run_hash:
            raise AloftError(f"the draw {dict(work.drawn)} has not the bytes of its whole run")
    p10, p50, p90 = (float(value) for value in np.percentile(shared / whole, (10, 50, 90)))
    minutes = RUNS * float(np.mean(shared)) / CORES / 60.0
    return [
        Row("a whole run of a pushed jump, loaded anew, processor time", float(np.median(whole)), "s"),
        Row(
            "the same from where it first differs", float(np.median(shared)), "s", "a whole run",
            p50, 0.5, p10, p90,
        ),
        Row(f"{RUNS:,} such runs on {CORES} processors", minutes, "min", goal=MINUTES),
    ]  # fmt: skip


def _draws(count: int) -> list[Job]:
    study = read_study(STUDY)
    section, (cell,) = study.falsification, searched_cells(study)
    assert section is not None
    source = random.Random(0)
    found = []
    for _ in range(count):
        values = {
            each.key: value_at(each, [source.random() for _ in each.bounds])
            for each in section.ranges
        }
        (run,) = draw_runs(values, "a draw", [cell], study.seeds[:1])
        found.append(job(run.cell, run.seed))
    return found
