"""The page of a running graph: its diagram with values and times, and its live parameters."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Literal

from ..drawing.page import Addition, page, policy
from ..language.stages import CheckedGraph

Opened = Literal["diagram", "parameters"]
"""What the side of the page shows at first."""
_HERE = Path(__file__).parent
_CONTROLS = (
    '<span id="state" role="status">connecting</span>'
    '<label><input type="checkbox" id="numbers" checked>numbers</label>'
)


def live_page(
    graph: CheckedGraph,
    closed: Collection[str],
    token: str,
    *,
    tuning: bool = True,
    save: str = "",
    opened: Opened = "diagram",
) -> str:
    """The page's text.

    Args:
        graph: what runs.
        closed: the sub-graphs that are closed.
        token: without which the server answers nothing.
        tuning: whether parameters can be changed.
        save: the name of the file for changed values, as it is shown.
        opened: what its side shows at first.
    """
    button = '<button id="tune">parameters</button>' if tuning else ""
    data = {"token": token, "tuning": tuning, "save": save, "opened": opened}
    addition = Addition(
        "live",
        data,
        f'{_CONTROLS}{button}<output id="parts"></output><output id="line"></output>',
        (_HERE / "live.css").read_text(encoding="utf-8"),
        _script(),
    )
    return page(graph, closed, addition=addition)


def live_policy() -> str:
    """The Content-Security-Policy of the page."""
    return policy(_script())


def _script() -> str:
    return (_HERE / "live.js").read_text(encoding="utf-8")
