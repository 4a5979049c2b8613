"""Robots with one effect each are calibrated with that effect, and jump with it."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from aloft.lab.benchmarks.jumps import known_effects
from aloft.lab.benchmarks.jumps.known_effects import LARGER, EffectJob, cells_by_effect, landed
from aloft.lab.benchmarks.jumps.real_tasks import EFFORT
from aloft.runtime.language.errors import AloftError
from aloft.studies.expansion import load_cell


def test_effects_are_those_of_the_study_and_each_has_both_jumps() -> None:
    found = cells_by_effect()
    assert {*LARGER} <= {*found}
    assert all(
        [cell.task for cell in cells] == ["in place 12 cm", "ahead 20 cm"]
        for cells in found.values()
    )


def test_an_effect_that_there_is_not() -> None:
    with pytest.raises(AloftError, match="there is no effect 'gremlins'; there is 'none'"):
        known_effects.known_effects([1], ["gremlins"])


def test_the_robot_that_sways_has_the_effect_and_the_one_that_jumps_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked, told = [], []

    def calibrate(graph: Path, seed: int, name: str) -> Path:
        asked.append((yaml.safe_load(graph.read_text())["set"], seed))
        fragment = tmp_path / f"{name}.yaml"
        fragment.write_text("set: {timing.rate: 2 ms}\n")
        return fragment

    def loaded(*cell: Any) -> Any:
        told.append(load_cell(*cell).checked)
        return SimpleNamespace(
            run=lambda log: SimpleNamespace(success=log, reason="it did not run")
        )

    monkeypatch.setattr(known_effects, "FOLDER", tmp_path)
    monkeypatch.setattr(known_effects, "calibrated", calibrate)
    monkeypatch.setattr(known_effects, "load_cell", loaded)
    found = landed(EffectJob(3, "gyroscope 2 ms late"))
    assert found == {"in place 12 cm": "it did not run", "ahead 20 cm": "it did not run"}
    assert asked == [({"robot.sensors.imu.gyro_delay": "2 ms"}, 3)]
    for graph in told:
        robot = graph.block("robot").params
        assert (robot.sensors.imu.gyro_delay, robot.seed) == (0.002, 3)
        assert graph.block("timing").params.rate == 0.002
        assert graph.block("plan").params.task["effort"] == EFFORT


@pytest.mark.long
def test_a_late_gyroscope_is_found_and_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    rows = known_effects.known_effects([97900], ["gyroscope 1 ms late"], workers=1)
    assert [row.value for row in rows] == [0.0, 0.0]
    written = json.loads((tmp_path / known_effects.FOLDER / "effects.json").read_text())["rows"]
    assert [(row["task"], row["n"]) for row in written] == [
        ("in place 12 cm", 1),
        ("ahead 20 cm", 1),
    ]


def test_a_robot_that_cannot_be_calibrated_lands_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refuse(graph: Path, seed: int, name: str) -> Path:
        raise AloftError("it never stands")

    monkeypatch.setattr(known_effects, "FOLDER", tmp_path)
    monkeypatch.setattr(known_effects, "calibrated", refuse)
    reasons = landed(EffectJob(3, "cable of 1 N"))
    assert {*reasons.values()} == {"not calibrated: it never stands"}
