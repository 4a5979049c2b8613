"""Builds are measured in turns, and a row fails whose whole interval lies above the limit."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from aloft.lab.benchmarks import speed as module
from aloft.lab.benchmarks.earlier_build import ROOT, Build
from aloft.lab.benchmarks.rows import Row
from aloft.lab.benchmarks.speed import Case, paired, run_process, speed
from aloft.runtime.language.errors import AloftError


@pytest.fixture
def build() -> Iterator[Build]:
    made = Build(ROOT)
    yield made
    made.close()


@pytest.mark.parametrize(
    ("own", "met"),
    [
        ([1.06, 1.07, 1.2], False),  # all above the limit
        ([1.04, 1.5, 2.0], True),  # one below it: it may be noise
        ([0.3, 0.4, 0.5], True),
    ],
)
def test_a_row_fails_where_its_whole_interval_lies_above_the_limit(
    own: list[float], met: bool
) -> None:
    row = paired("work", [own, [1.0, 1.0, 1.0]], "s", "before")
    assert (row.value, row.ratio, row.peer) == (own[1], own[1], "before")
    assert (row.ratio_p10, row.ratio_p90) == (own[0], own[2])
    assert row.met is met and row.to_json()["met"] is met
    assert row.note == f"3 pairs, ratio {own[0]:.2f} to {own[2]:.2f}"


def test_pairs_are_compared_and_not_medians() -> None:
    """The machine was slower in the second pair, for both."""
    row = paired("work", [[1.0, 4.0, 1.2], [2.0, 8.0, 2.4]], "s", "before")
    assert (row.ratio_p10, row.ratio, row.ratio_p90) == (0.5, 0.5, 0.5)


def test_without_an_earlier_build_only_growth_has_a_goal() -> None:
    assert paired("work", [[2.0, 1.0, 3.0]], "s", "") == Row("work", 2.0, "s")
    assert paired("growth", [[1.4]], "1", "").met is False


def test_figures_are_those_that_the_process_prints_last(build: Build) -> None:
    rows = json.dumps({"rows": [{"name": "a row", "value": 0.5}, {"name": "none", "value": None}]})
    found = run_process(("-c", f"print('text'); print({rows!r})"), build)
    assert found["a row"] == 0.5 and "none" not in found
    assert 0.0 < found["time"] < 60.0 and 1.0 < found["memory"] < 100.0
    assert run_process(("-c", "print('{\"load\": 0.25}')"), build)["load"] == 0.25


def test_a_process_that_fails_is_no_measurement(build: Build) -> None:
    with pytest.raises(AssertionError, match=r"^-c raise SystemExit\('why'\) ended with 1: why"):
        run_process(("-c", "raise SystemExit('why')"), build)


def test_a_build_is_a_folder_or_a_commit(tmp_path: Path, build: Build) -> None:
    (tmp_path / "__init__.py").write_text("print('that build')")
    earlier = Build(tmp_path)
    assert earlier.environment()["PYTHONPATH"].split(":")[0] == str(earlier.folder)
    assert (earlier.folder / "aloft" / "__init__.py").read_text() == "print('that build')"
    earlier.close()
    with pytest.raises(AloftError, match="the sources of no_such_commit are not at hand"):
        Build("no_such_commit")


def test_every_case_is_measured_in_turns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "__init__.py").touch()
    turns: list[tuple[str, bool]] = []

    def process(
        arguments: list[str], build: Build, codes: object, forgets: object
    ) -> dict[str, float]:
        earlier = (build.folder / "aloft").resolve() == tmp_path.resolve()
        turns.append((arguments[0], earlier))
        return {"time": 2.0 if earlier else 1.0}

    monkeypatch.setattr(module, "run_process", process)
    monkeypatch.setattr(module, "mujoco_alone", lambda: [Row("ticks", 1.0, "s")])
    monkeypatch.setattr(
        module, "CASES", (Case("a", {"one": "time"}), Case("b", {"two": "time"}, long=True))
    )
    monkeypatch.setattr(module, "PEERS", {"peer": ("no_such_module", "")})
    quick = speed(str(tmp_path))
    assert [row.name for row in quick] == ["one", "ticks", "import and first run of two blocks"]
    assert quick[0].ratio == 0.5 and quick[0].met
    assert quick[2].value is None and quick[2].note == "peer is not installed"
    own = [earlier for _, earlier in turns]
    assert len(own) == 2 * (module.PAIRS + 1) and own[:4] in (
        [True, False, False, True],
        [False, True, True, False],
    )
    turns.clear()
    assert [row.name for row in speed(str(tmp_path), everything=True)][:2] == ["one", "two"]
    assert sum(name == "b" for name, _ in turns) == 2 * (module.LONG_PAIRS + 1)
    assert speed()[0].ratio is None


@pytest.mark.long
def test_mujoco_alone_goes_through_the_same_states() -> None:
    rows = module.mujoco_alone(rounds=1)
    assert [row.peer for row in rows] == [
        "MuJoCo alone, same torques",
        "MuJoCo alone, same torques and integrators",
    ]
    for row in rows:
        assert row.ratio is not None and row.ratio > 0.0
        assert row.note.startswith("1400 ticks of 4 steps")
