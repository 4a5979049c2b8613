"""Checks of a graph from a file, a text or changes: a checked graph, or a report."""

from __future__ import annotations

from pathlib import Path

from ...files.problems import LoadError, Problems, Report
from ..language.collector import collector_paused
from ..language.flat_graph import FlatGraph
from ..language.stages import CheckedGraph
from .checking.check_graph import check_graph
from .flattening.change import change
from .flattening.flatten import flatten_file, flatten_text
from .reading.files import graph_path
from .reading.overrides import Overrides


def checked_file(path: str | Path, overrides: Overrides = ()) -> CheckedGraph:
    """Load and check the graph in a file, ready to be bound and run.

    Args:
        path: the graph file; messages show it as it is given.
        overrides: ``{"landing.w_l": [0.03, 0.04]}`` or ``["landing.w_l=[0.03, 0.04]"]``.

    Raises:
        LoadError: the graph is wrong; the error carries the report of all problems.
    """
    problems = Problems()
    with collector_paused():
        graph = check_graph(flatten_file(graph_path(path), overrides, problems), problems)
    return _result(graph, problems, str(path))


def checked_text(text: str, path: str | Path, overrides: Overrides = ()) -> CheckedGraph:
    """Load and check the graph in a text; files it names are searched for as if the text were the
    file ``path``.

    Raises:
        LoadError: the graph is wrong; the error carries the report of all problems.
    """
    problems = Problems()
    with collector_paused():
        graph = check_graph(flatten_text(text, Path(path), overrides, problems), problems)
    return _result(graph, problems, str(path))


def checked_again(graph: FlatGraph, overrides: Overrides) -> CheckedGraph:
    """Check a flat graph with other parameters and keys; those it had before stay.

    Raises:
        LoadError: the changed graph is wrong; the error carries the report of all problems.
    """
    problems = Problems()
    with collector_paused():
        checked = check_graph(change(graph, overrides, problems), problems)
    return _result(checked, problems, graph.file)


def check(path: str | Path, overrides: Overrides = ()) -> Report:
    """Check a graph file and return the report; ``ok`` when it may run."""
    problems = Problems()
    with collector_paused():
        check_graph(flatten_file(graph_path(path), overrides, problems), problems)
    return problems.report(str(path))


def flatten(path: str | Path, overrides: Overrides = ()) -> FlatGraph:
    """Flatten a graph: expand includes and sub-graphs, and apply overrides; see its ``text``.

    Raises:
        LoadError: some file cannot be read or expanded. Wires and values are not checked here.
    """
    problems = Problems()
    with collector_paused():
        graph = flatten_file(graph_path(path), overrides, problems)
    if len(problems):
        raise LoadError(problems.report(str(path)))
    return graph


def flattened_text(text: str, path: str | Path) -> FlatGraph:
    """Flatten the graph in a text that stands for the file ``path``.

    Raises:
        LoadError: the text cannot be read or expanded. Wires and values are not checked here.
    """
    problems = Problems()
    graph = flatten_text(text, Path(path), (), problems)
    if len(problems):
        raise LoadError(problems.report(str(path)))
    return graph


def _result(graph: CheckedGraph | None, problems: Problems, file: str) -> CheckedGraph:
    if graph is None:
        raise LoadError(problems.report(file))
    return graph
