"""``--rehearse``: what was learnt is shown, and kept where the graph finds it."""

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from aloft.cli.shared import rehearsal as verb
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.library.rehearsed import Deviation, Rehearsed
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot
from aloft.studies.rehearsing import landing as landings
from aloft.studies.rehearsing import lift_off as study

FILE = SHIPPED.parent / "tasks" / "in_situ_12cm.yaml"
BEFORE = Deviation((0.03, 0.0, 0.0), (0.0, -0.01, 0.0), 0.035, 0.002, 2, 3, 3)
LEARNT = Rehearsed(
    (-0.03, 0.0, 0.0), (0.0, 0.01, 0.0), BEFORE, replace(BEFORE, size=0.004, landed=3),
    (7001, 7002, 7003), "standard", "the correction leaves 11% of the deviation",
)  # fmt: skip


def test_it_is_made_once_kept_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []

    def rehearse(*arguments: Any, **more: Any) -> Rehearsed:
        made.append(arguments)
        return LEARNT

    monkeypatch.setattr(study, "rehearse", rehearse)
    task, library = read_task(FILE), PlanLibrary(find_robot("bruce"), tmp_path)

    def show(wanted: bool) -> tuple[dict[str, Any], str]:
        text = io.StringIO()
        screen = Console(file=text, width=120)
        return verb.rehearsal_of_file(
            FILE, task, library, tmp_path, wanted, screen
        ), text.getvalue()

    assert show(wanted=False) == ({}, "") and not made
    row, text = show(wanted=True)
    assert len(made) == 1
    momentum_unit = made[0][3]
    assert 0.2 < momentum_unit < 2.0  # N m s for 1 m/s
    assert row["rehearsal"]["before"]["velocity"] == (0.03, 0.0, 0.0)
    assert row["rehearsal"]["corrects"] and row["rehearsal"]["momentum_correction"][1] == 0.01
    for words in ("velocity x [mm/s]", "-30.0", "2 of 3", "3 of 3", LEARNT.reason, "rehearsal: "):
        assert words in text.replace("\n", ""), words
    again, shown = show(wanted=False)
    assert len(made) == 1 and again == row and "3 of 3" in shown


def test_the_landing_is_rehearsed_where_that_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Any] = []

    def rehearse_landing(*arguments: Any, **more: Any) -> Rehearsed:
        made.append(arguments)
        return replace(LEARNT, trial="robust")

    def other(*arguments: Any, **more: Any) -> Rehearsed:
        raise AssertionError("the lift-off alone was rehearsed")

    monkeypatch.setattr(landings, "rehearse_landing", rehearse_landing)
    monkeypatch.setattr(study, "rehearse", other)
    task, library = read_task(FILE), PlanLibrary(find_robot("bruce"), tmp_path)
    screen = Console(file=io.StringIO(), width=120)
    row = verb.rehearsal_of_file(FILE, task, library, tmp_path, True, screen, landing=True)
    assert len(made) == 1 and made[0][3].shape == (5, 5)
    assert row["rehearsal"]["trial"] == "robust" and row["rehearsal"]["corrects"]
    again = verb.rehearsal_of_file(FILE, task, library, tmp_path, False, screen)
    assert len(made) == 1 and again == row, "it is found where the graph finds it"
