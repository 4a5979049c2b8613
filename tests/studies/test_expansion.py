"""From a study's file to cells: products, order, precedence, keys."""

from collections.abc import Callable
from pathlib import Path

import pytest

from aloft.runtime.loading import LoadError
from aloft.studies.expansion import Cell, cells, checked_cells, job, load_cell, seeded_graph
from aloft.studies.study import Study

Read = Callable[[str], Study]


def test_every_combination_once_the_last_axis_fastest(study: Read) -> None:
    found = study(
        """
arms: {a: {}, b: {counter.goal: 3}}
grid:
  stop: {counter.stop_at: [10, 20, 30]}
  which: {cases: {one: {}, two: {double.stop_at: 5}}}
"""
    )
    expanded = list(cells(found))
    assert len(expanded) == 12
    assert [c.labels["which"] for c in expanded[:3]] == ["one", "two", "one"]
    assert expanded[-1].labels == {"task": "count", "arm": "b", "stop": "30", "which": "two"}
    assert expanded[-1].overrides == {
        "counter.stop_at": 30, "double.stop_at": 5, "counter.goal": 3,
    }  # fmt: skip
    assert expanded[-1].coordinates == {"stop": 30.0, "which": "two"}


def test_axes_are_spaced_shown_and_have_units_in_their_names(study: Read) -> None:
    found = study(
        """
grid:
  angle: {counter.goal: {from: 0 deg, to: 345 deg, step: 15 deg}}
  impulse: {double.goal: [40, 70], shown: [0.4 N s, 0.7 N s]}
  step: {counter.stop_at: {from: 0.1, to: 0.3, step: 0.1}}
"""
    )
    angle, impulse, step = found.axes
    assert (angle.column, len(angle.cases), angle.cases[-1].label) == ("angle_deg", 24, "345 deg")
    assert impulse.column == "impulse_n_s"
    assert [case.value for case in impulse.cases] == [0.4, 0.7]
    assert [case.value for case in step.cases] == [0.1, 0.2, 0.3]
    assert next(iter(cells(found))).overrides["double.goal"] == 40


def test_what_is_set_later_wins(folder: Path, study: Read) -> None:
    (folder / "study.yaml").unlink(missing_ok=True)
    found = study("set: {counter.goal: 1, double.goal: 1}\narms: {a: {counter.goal: 2}}\n")
    (cell,) = cells(found, {"a": {"double.goal": 3}})
    assert cell.overrides == {"counter.goal": 2, "double.goal": 3}


def test_included_files_come_before_the_graphs_own(folder: Path, study: Read) -> None:
    (folder / "trial.yaml").write_text("set: {counter.goal: 7, double.goal: 7}\n")
    graph = (folder / "count.yaml").read_text()
    (folder / "count.yaml").write_text(f"{graph}set: {{double.goal: 9}}\n")
    found = study("include: trial.yaml\n")
    (cell,) = cells(found)
    loaded = load_cell(cell.graph, cell.include, cell.sets, cell.origin).checked
    goals = [loaded.block(name).params.goal for name in ("counter", "double")]  # type: ignore[attr-defined]
    assert goals == [7, 9]


def test_what_an_arm_includes_follows_the_graph(folder: Path, study: Read) -> None:
    (folder / "more.yaml").write_text(
        "blocks: {last: {use: blocks.Constant, with: {value: [1]}}}\nset: {counter.goal: 9}\n"
    )
    found = study("arms: {plain: {}, more: {set: {double.goal: 8}, include: more.yaml}}\n")
    plain, more = (seeded_graph(job(cell, 3)).checked for cell in cells(found))
    assert [spec.path for spec in more.blocks if spec.path == "last"] == ["last"]
    assert not any(spec.path == "last" for spec in plain.blocks)
    goals = [more.block(name).params.goal for name in ("counter", "double")]  # type: ignore[attr-defined]
    assert goals == [9, 8]
    first, second = keys_of(found)
    assert first != second


def test_a_file_that_an_arm_includes_must_exist(study: Read) -> None:
    with pytest.raises(LoadError, match=r"there is no file .*missing.yaml"):
        study("arms: {more: {include: missing.yaml}}\n")


def keys_of(found: Study) -> list[str]:
    return [cell.key for cell in checked_cells(cells(found), found, "code")]


def test_a_key_changes_with_whatever_decides_the_outcome(folder: Path, study: Read) -> None:
    text = "grid: {stop: {counter.stop_at: [1, 2]}}\n"
    first = keys_of(study(text))
    assert len(set(first)) == 2
    assert keys_of(study(f"title: renamed\n{text}")) == first
    assert keys_of(study(f"set: {{counter.goal: 5}}\n{text}")) != first
    found = study(text)
    assert [c.key for c in checked_cells(cells(found), found, "other code")] != first
    (folder / "counter.py").write_text((folder / "counter.py").read_text() + "\n# changed\n")
    assert keys_of(study(text)) != first


def test_overrides_that_mean_nothing_are_reported_where_they_are_written(study: Read) -> None:
    found = study("arms:\n  a: {counter.goall: 3}\ngrid:\n  x: {counter.stop_at: [1, word]}\n")
    with pytest.raises(LoadError) as caught:
        checked_cells(cells(found), found, "")
    text = str(caught.value)
    assert "study.yaml:4:7: unknown-parameter: counter (counter:Counter) has no parameter" in text
    assert "fix        goal: 3" in text
    assert "study.yaml:6:28: bad-parameter: counter.stop_at cannot be word" in text
    assert text.endswith("study.yaml: 2 problems")


def test_a_graph_without_seed_cannot_be_studied(folder: Path, study: Read) -> None:
    (folder / "count.yaml").write_text(
        "rate: 1 Hz\nblocks: {c: {use: blocks.Constant, with: {value: [1]}}}\n"
    )
    found = study("")
    assert isinstance(next(cells(found)), Cell)
    with pytest.raises(
        LoadError,
        match=r"study.yaml:1:8: .*has no parameter called 'seed'(.|\n)*use: blocks.WhiteNoise",
    ):
        checked_cells(cells(found), found, "")
