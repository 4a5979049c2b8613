"""Loading of a graph: from a YAML file to a checked graph, with every mistake in one report.

Its stages have a folder each: ``reading`` (one file as it is written, with the place of every key) ->
``flattening`` (includes and sub-graphs expanded, overrides applied) -> ``checking``
(``stages.CheckedGraph``). Here is what all of them share, and what users call.
"""

from ...files.problems import Code, LoadError, Problem, Report
from .checked import check, checked_again, checked_file, checked_text, flatten, flattened_text

__all__ = [
    "Code",
    "LoadError",
    "Problem",
    "Report",
    "check",
    "checked_again",
    "checked_file",
    "checked_text",
    "flatten",
    "flattened_text",
]
