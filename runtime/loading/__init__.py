"""Loading of a graph: from a YAML file to a checked graph, with every mistake in one report.

Its stages have a folder each: ``reading`` (one file as it is written, with the place of every key) ->
``flattening`` (includes and sub-graphs expanded, overrides applied) -> ``checking``
(``stages.CheckedGraph``). Here is what all of them share, and what users call.
"""

from ...files.problems import Code, LoadError, Problem, Report
from .load import check, flatten, load, load_text

__all__ = [
    "Code",
    "LoadError",
    "Problem",
    "Report",
    "check",
    "flatten",
    "load",
    "load_text",
]
