"""What is wrong with a study's file is reported at once, with places and fixes."""

from pathlib import Path

import pytest

from aloft.runtime.loading import LoadError
from aloft.studies.expansion import cells, checked_cells
from aloft.studies.reading import read_study


def report(folder: Path, text: str) -> str:
    (folder / "wrong.yaml").write_text(text)
    with pytest.raises(LoadError) as caught:
        read_study(Path("wrong.yaml"))
    return str(caught.value)


def test_all_mistakes_at_once(folder: Path) -> None:
    text = report(
        folder,
        """graph: cuont.yaml
sedes: 1
seeds: 5:1
arms: {a: {set: {}, tuen: {}}}
grid:
  seed: {a.b: [1]}
  flat: [1, 2]
  mixed: {a.b: [1, 2], c.d: [1]}
  twice: {a.b: [5 cm, 50 mm]}
  nowhere: {a.b: {from: 1, to: 0, step: 1}}
  good: {e.f: [1, 2]}
goals:
  - {where: {good: 1}}
  - {rate: 95, where: {god: 1, good: 3}}
tune: {seeds: 990:1010, ranges: {a.b: [2, 1], c.d: {form: 1}}}
plots:
  first: {kind: line}
  second: {kind: polar, angle: good, level: 2}
""",
    )
    for line in (
        "wrong.yaml:1:8: file: there is no file cuont.yaml",
        "nearest    count.yaml",
        "wrong.yaml:2:1: unknown-key: 'sedes' is not a key of a study file",
        "fix        seeds: 1",
        "wrong.yaml:3:8: bad-value: seeds '5:1': expected at least one seed, each once and none below zero",
        "wrong.yaml:4:21: unknown-key: 'tuen' is not a key of arm 'a'",
        "wrong.yaml:6:3: bad-value: 'seed' cannot name an axis",
        "wrong.yaml:7:9: wrong-kind: axis 'flat' cannot be a list",
        "wrong.yaml:8:24: bad-value: the values of axis 'mixed' do not go side by side",
        "expected   2 values, as a.b has",
        "wrong.yaml:9:23: duplicate-key: 5 cm is there twice on axis 'twice'",
        "wrong.yaml:10:18: bad-value: 1 does not lead from 1 to 0",
        "wrong.yaml:13:5: missing-key: the goal has no rate",
        "wrong.yaml:14:12: bad-value: rate cannot be the number 95",
        "wrong.yaml:14:24: unknown-key: 'god' is not a key of 'where': no axis",
        "wrong.yaml:14:38: bad-value: axis 'good' has no 3",
        "missing-key: 'tune' does not say its draws",
        "wrong.yaml:15:15: bad-value: seeds from 1000 on are for reports and cannot be tuned on",
        "wrong.yaml:15:39: bad-value: [2, 1] is no range for a.b",
        "'form' is not a key of a range",
        "wrong.yaml:17:17: unknown-reference: 'kind' cannot be the text 'line'",
        "fix        kind: lines",
        "plot 'second' does not say its radius",
    ):
        assert line in text


def test_two_axes_may_not_set_one_parameter(folder: Path) -> None:
    text = report(
        folder,
        "graph: count.yaml\nseeds: 1\ngrid: {a: {x.y: [1]}, b: {cases: {c: {x.y: 2}}}}\n",
    )
    assert "wrong.yaml:3:23: duplicate-key: x.y is set by two axes, 'a' and 'b'" in text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("seeds: 1\n", "wrong.yaml:1:1: missing-key: the study names no graph"),
        ("graph: count.yaml\n", "wrong.yaml:1:1: missing-key: the study does not say its seeds"),
        ("- 1\n", "wrong.yaml:1:1: wrong-kind: a study file is a mapping"),
        ("graph: [\n", "wrong.yaml:"),
        ("seeds: 1\ngraphs: [count.yaml, ./count.yaml]\n", "two tasks are called 'count'"),
        ("seeds: 1\ngraphs: {a: {set: {}}}\n", "wrong.yaml:2:10: missing-key: task 'a' names no"),
        ("seeds: 1\ngraph: count.yaml\ntune: {seeds: 1, draws: 2}\n", "there is nothing to tune"),
        ("seeds: 1\ngraph: count.yaml\ngraphs_of: wrong.yaml\n", "'graph' and 'graphs_of' exclude each"),
        ("seeds: 1\ngraphs_of: [wrong.yaml]\n", "wrong.yaml:2:12: wrong-kind: 'graphs_of' cannot be"),
        ("seeds: 1\ngraphs_of: other.yaml\n", "wrong.yaml:2:12: file: there is no file other.yaml"),
        ("seeds: 1\ngraphs_of: wrong.yaml\n", "wrong.yaml:2:12: bad-value: wrong.yaml has its graphs"),
        ("seeds: 1\ngraphs_of: count.yaml\n", "count.yaml:1:1: missing-key: the study names no graph"),
    ],
)  # fmt: skip
def test_one_mistake(folder: Path, text: str, expected: str) -> None:
    assert expected in report(folder, text)


def test_the_graphs_of_another_study(folder: Path) -> None:
    (folder / "inner").mkdir()
    (folder / "inner" / "tasks.yaml").write_text(
        "seeds: 1000\ntitle: others\nset: {counter.seed: 3}\n"
        "graphs: {to two: {graph: ../count.yaml, set: {counter.goal: 2}}, as it is: ../count.yaml}\n"
    )
    (folder / "right.yaml").write_text(
        "graphs_of: inner/tasks.yaml\nseeds: 4\narms: {a: {}, b: {counter.goal: 5}}\n"
    )
    found = read_study(Path("right.yaml"))
    assert [task.name for task in found.tasks] == ["to two", "as it is"]
    assert [(e.key, e.key_where.file) for e in found.tasks[0].sets] == [
        ("counter.goal", "inner/tasks.yaml")
    ]
    assert (found.title, found.seeds, found.sets) == ("right", (4,), ()), "only graphs are taken"
    expanded = checked_cells(cells(found), found, "")
    assert [(cell.task, cell.arm, dict(cell.overrides)) for cell in expanded] == [
        ("to two", "a", {"counter.goal": 2}),
        ("to two", "b", {"counter.goal": 5}),
        ("as it is", "a", {}),
        ("as it is", "b", {"counter.goal": 5}),
    ]


def test_goals_may_name_values_in_other_units(folder: Path) -> None:
    (folder / "right.yaml").write_text(
        "graph: count.yaml\nseeds: [4, 2]\ngrid: {d: {counter.goal: [5 cm, 10 cm]}}\n"
        "goals: [{rate: 90 %}, {rate: 0.5, where: {d: [50 mm]}}]\n"
    )
    found = read_study(Path("right.yaml"))
    assert found.seeds == (4, 2)
    assert [goal.rate for goal in found.goals] == [0.9, 0.5]
    assert found.goals[1].cells.labels == {"d": ("5 cm",)}


def test_a_graph_is_no_study(folder: Path) -> None:
    text = report(folder, "rate: 10 Hz\nblocks: {wave: {use: blocks.SineWave}}\n")
    assert "wrong.yaml is a graph, not a study" in text
    assert "with graph: wrong.yaml and seeds: 2000:2020" in text and "1 problem" in text


def test_a_study_names_shipped_graphs_by_their_address(folder: Path) -> None:
    (folder / "study.yaml").write_text(
        "graph: aloft:push\nseeds: 1:3\ninclude: aloft:trials/robust\n"
    )
    study = read_study(Path("study.yaml"))
    assert [file.name for file in (study.tasks[0].path, *study.include)] == [
        "push.yaml",
        "robust.yaml",
    ]
    assert "fix        aloft:push" in report(folder, "graph: push.yaml\nseeds: 1:3\n")
