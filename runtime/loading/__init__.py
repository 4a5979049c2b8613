"""From a YAML file to a checked graph, with every mistake in one report.

written (one file, with the place of every key) -> flat (includes and sub-graphs expanded,
overrides applied) -> checked (``stages.CheckedGraph``).
"""

from .load import check, flatten, load, load_text
from .problems import Code, LoadError, Problem, Report
from .schema import graph_schema, schema_text

__all__ = [
    "Code",
    "LoadError",
    "Problem",
    "Report",
    "check",
    "flatten",
    "graph_schema",
    "load",
    "load_text",
    "schema_text",
]
