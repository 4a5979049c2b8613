"""Reads a study's file and reports every mistake in it at once, as for graphs.

The keys: ``graph``, ``graphs`` or ``graphs_of``, ``include``, ``seeds``, ``title``, ``set``, ``arms``,
``grid``, ``goals``, ``tune``, ``falsify``, ``plots``; docs/studies.md explains them. What overrides mean to the
graphs is checked by ``expansion``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..files.document import read_file
from ..files.nodes import Entry, ListNode, MapNode, Node, ScalarNode, plain
from ..files.problems import Code, LoadError, Position, Problems
from ..runtime.loading.reading.files import files_like, graph_path
from ..runtime.loading.reading.written import unknown_key, wrong_kind
from .axes import read_axes, read_sets
from .sections import (
    Labels,
    read_falsification,
    read_goals,
    read_plots,
    read_seeds,
    read_tuning,
)
from .study import Arm, CellFilter, Falsification, Range, Study, StudyTask
from .tuning import read_range

KEYS = (
    "graph", "graphs", "graphs_of", "include", "seeds", "title", "set", "arms", "grid", "goals",
    "tune", "falsify", "plots",
)  # fmt: skip
GRAPH_KEYS = ("graph", "graphs", "graphs_of")
ARM_KEYS = ("set", "tune", "include")
TASK_KEYS = ("graph", "set")


def read_study(path: Path) -> Study:
    """Read the study in a file.

    Raises:
        LoadError: something is wrong with the file; the text reports everything that is.
    """
    problems = Problems()
    tree = read_file(path, str(path), problems, ("a study file", "graph, seeds, grid"))
    if tree is not None and tree.get("blocks") and not any(map(tree.get, GRAPH_KEYS)):
        problems.add(
            Code.WRONG_KIND, f"{path} is a graph, not a study", Position(str(path), 1, 1),
            expected="a file that names a graph, seeds and what differs", found="blocks",
            fix=f"a file of its own with graph: {path.name} and seeds: 2000:2020",
        )  # fmt: skip
        tree = None
    study = _read(tree, path, problems) if tree is not None else None
    if study is None or len(problems):
        raise LoadError(problems.report(str(path)))
    return study


def rows_where(study: Study, texts: Sequence[str]) -> CellFilter:
    """Return the filter that texts such as ``axis=value`` mean. Several values of one axis are
    alternatives.

    Raises:
        LoadError: there is no such axis, or it has no such value.
    """
    problems = Problems()
    labels = Labels(
        {name: study.labels_of(name) for name in study.axis_names},
        {axis.name: axis for axis in study.axes},
    )
    nodes: dict[str, list[Node]] = {}
    for text in texts:
        axis, _, value = text.partition("=")
        node = ScalarNode(value.strip(), Position(f"--where {text}", 0, 0))
        nodes.setdefault(axis.strip(), []).append(node)
    entries = [
        Entry(axis, found[0].where, ListNode(tuple(found), found[0].where))
        for axis, found in nodes.items()
    ]
    whole = MapNode(tuple(entries), Position("--where", 0, 0))
    part = labels.read_filter(Entry("where", whole.where, whole), problems)
    if len(problems):
        raise LoadError(problems.report(str(study.path)))
    return part


def _read(tree: MapNode, path: Path, problems: Problems) -> Study:
    keys = {entry.key: entry for entry in tree if not entry.key.startswith("_")}
    for entry in keys.values():
        if entry.key not in KEYS:
            unknown_key(entry, KEYS, "of a study file", problems)

    def section(key: str) -> MapNode:
        entry = keys.get(key)
        if entry is None:
            return MapNode((), tree.where)
        if isinstance(entry.value, MapNode):
            return entry.value
        if not (isinstance(entry.value, ScalarNode) and entry.value.value is None):
            wrong_kind(entry.value, repr(key), "a mapping", problems)
        return MapNode((), entry.value.where)

    tasks = _read_tasks(keys, path, problems)
    sets = (read_sets(keys["set"], problems) or ()) if "set" in keys else ()
    seeds: tuple[int, ...] = ()
    if "seeds" in keys:
        seeds = read_seeds(keys["seeds"].value, "seeds", problems)
    else:
        problems.add(
            Code.MISSING_KEY, "the study does not say its seeds", Position(str(path), 1, 1),
            expected="seeds, from 1000 on where results are reported", fix="seeds: 2000:2040",
        )  # fmt: skip
    common = _read_ranges(section("tune").get("ranges"), problems)
    arms = tuple(_read_arm(entry, common, path, problems) for entry in section("arms"))
    arms = arms or (Arm("default", (), common),)
    axes = read_axes(section("grid"), problems)
    labels = Labels(
        {
            "task": tuple(task.name for task in tasks),
            "arm": tuple(arm.name for arm in arms),
            **{axis.name: tuple(case.label for case in axis.cases) for axis in axes},
        },
        {axis.name: axis for axis in axes},
    )
    tuning = read_tuning(section("tune"), labels, problems) if "tune" in keys else None
    if tuning is not None and not any(arm.ranges for arm in arms):
        problems.add(
            Code.MISSING_KEY, "there is nothing to tune", keys["tune"].key_where,
            expected="ranges here, or 'tune' in an arm",
            fix="ranges: {block.parameter: [low, high]}",
        )  # fmt: skip
    title = keys.get("title")
    return Study(
        path.stem,
        path,
        str(plain(title.value)) if title else path.stem.replace("_", " "),
        tasks,
        tuple(p for _, p in _files(keys.get("include"), path, problems)),
        seeds,
        sets,
        arms,
        axes,
        read_goals(keys["goals"].value, labels, problems) if "goals" in keys else (),
        tuning,
        _read_falsification(section("falsify"), labels, problems) if "falsify" in keys else None,
        read_plots(section("plots"), labels, problems),
    )


def _read_tasks(keys: dict[str, Entry], path: Path, problems: Problems) -> tuple[StudyTask, ...]:
    given = [keys[key] for key in GRAPH_KEYS if key in keys]
    if len(given) != 1:
        written = " and ".join(repr(entry.key) for entry in given)
        problems.add(
            Code.DUPLICATE_KEY if given else Code.MISSING_KEY,
            f"{written} exclude each other" if given else "the study names no graph",
            given[0].key_where if given else Position(str(path), 1, 1),
            expected="graph: FILE, graphs: {task: FILE}, or graphs_of: STUDY",
            fix="" if given else "graph: ../jump.yaml",
        )
        return ()
    (entry,) = given
    if entry.key == "graphs_of":
        return _tasks_of(entry, path, problems)
    if entry.key == "graphs" and isinstance(entry.value, MapNode):
        named = [_read_task(item, path, problems) for item in entry.value]
        tasks = [task for task in named if task is not None]
    else:
        tasks = [StudyTask(p.stem, p, node.where) for node, p in _files(entry, path, problems)]
    names: set[str] = set()
    for task in tasks:
        if task.name in names:
            problems.add(
                Code.DUPLICATE_KEY, f"two tasks are called {task.name!r}", task.where,
                fix="name them: graphs: {first: FILE, second: FILE}",
            )  # fmt: skip
        names.add(task.name)
    return tuple(tasks)


def _tasks_of(entry: Entry, path: Path, problems: Problems) -> tuple[StudyTask, ...]:
    """Read the tasks of another study, which has to name them itself."""
    if not isinstance(entry.value, ScalarNode):
        wrong_kind(entry.value, "'graphs_of'", "a study's file, relative to this one", problems)
        return ()
    tasks: list[StudyTask] = []
    for node, file in _files(entry, path, problems):
        tree = read_file(file, str(file), problems, ("a study file", "graph, seeds, grid"))
        if tree is None:
            continue
        keys = {item.key: item for item in tree if item.key in GRAPH_KEYS}
        if "graphs_of" in keys:
            name = str(plain(node))
            further = Path(name).parent / str(plain(keys["graphs_of"].value))
            problems.add(
                Code.BAD_VALUE, f"{file} has its graphs from another study itself", node.where,
                at=entry.key, expected="a study with 'graph' or 'graphs'", found=name,
                fix=f"graphs_of: {further.as_posix()}",
            )  # fmt: skip
            continue
        tasks += _read_tasks(keys, file, problems)
    return tuple(tasks)


def _read_task(entry: Entry, path: Path, problems: Problems) -> StudyTask | None:
    """Read ``name: FILE`` or ``name: {graph: FILE, set: {...}}``."""
    file = entry
    sets: tuple[Entry, ...] = ()
    if isinstance(entry.value, MapNode):
        for item in entry.value:
            if item.key not in TASK_KEYS:
                unknown_key(item, TASK_KEYS, f"of task {entry.key!r}", problems)
        graph, given = entry.value.get("graph"), entry.value.get("set")
        if graph is None:
            problems.add(
                Code.MISSING_KEY, f"task {entry.key!r} names no graph", entry.key_where,
                expected="graph", fix="graph: ../jump.yaml",
            )  # fmt: skip
            return None
        file, sets = graph, (read_sets(given, problems) or ()) if given else ()
    found = _files(file, path, problems)
    return StudyTask(entry.key, found[0][1], entry.key_where, sets) if found else None


def _files(entry: Entry | None, path: Path, problems: Problems) -> list[tuple[Node, Path]]:
    """Read the files that a key names, relative to the study's file. Missing files are noted as
    problems."""
    if entry is None:
        return []
    found = []
    for node in entry.value.items if isinstance(entry.value, ListNode) else (entry.value,):
        name = plain(node)
        if not isinstance(name, str):
            wrong_kind(node, repr(entry.key), "a file, relative to this one", problems)
            continue
        file = graph_path(name, path.parent)
        if not file.is_file():
            near = files_like(name, file.parent)
            problems.add(
                Code.FILE, f"there is no file {file}", node.where, at=entry.key, found=name,
                expected="a file, relative to this one, or a shipped one such as aloft:jump", nearest=near, fix=near[0] if near else "",
            )  # fmt: skip
            continue
        found.append((node, file))
    return found


def _read_ranges(entry: Entry | None, problems: Problems) -> tuple[Range, ...]:
    if entry is None:
        return ()
    if not isinstance(entry.value, MapNode):
        wrong_kind(entry.value, repr(entry.key), "{block.parameter: [low, high]}", problems)
        return ()
    found = [read_range(item, problems) for item in entry.value if not item.key.startswith("_")]
    return tuple(each for each in found if each is not None)


def _read_falsification(node: MapNode, labels: Labels, problems: Problems) -> Falsification | None:
    ranges = _read_ranges(node.get("ranges"), problems)
    if not ranges:
        problems.add(
            Code.MISSING_KEY, "'falsify' has no ranges to search in", node.where, at="falsify",
            expected="ranges", fix="ranges: {block.parameter: [low, high]}",
        )  # fmt: skip
    return read_falsification(node, ranges, labels, problems)


def _read_arm(entry: Entry, common: tuple[Range, ...], path: Path, problems: Problems) -> Arm:
    """Read ``name: {block.parameter: value}``, or ``name: {set: {...}, tune: {...}, include:
    FILE}``."""
    node = entry.value
    if isinstance(node, MapNode) and any(node.get(key) for key in ARM_KEYS):
        for item in node:
            if item.key not in ARM_KEYS:
                unknown_key(item, ARM_KEYS, f"of arm {entry.key!r}", problems)
        given, own = node.get("set"), node.get("tune")
        sets = (read_sets(given, problems) or ()) if given else ()
        ranges = _read_ranges(own, problems) if own else common
        files = tuple(file for _, file in _files(node.get("include"), path, problems))
        return Arm(entry.key, sets, ranges, files)
    return Arm(entry.key, read_sets(entry, problems) or (), common)
