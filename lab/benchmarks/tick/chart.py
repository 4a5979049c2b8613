"""The tick as a picture: bars of the controller's blocks in every way in which it was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ....plotting import COLOURS, FAINT, INK, PALE, new_figure, style, svg_text

BARS = (
    ("fused block ", "fused"),
    ("block ", "kernels one by one"),
    ("TSID block ", "whole-body controller in TSID"),
    ("OSQP block ", "whole-body program by OSQP"),
    ("old block ", "at an earlier commit"),
)
"""The bars from the top down: the prefix of the names of their rows, and their labels."""
SMALL = 0.04
"""Blocks that take less than this share of the first complete bar are one piece together."""


def tick_chart(rows: Sequence[Mapping[str, Any]]) -> str:
    """Draw the chart as SVG text, light or dark as its reader's screen is, from the rows of ``aloft
    bench tick``: a bar of stacked blocks for each way, those that take longest first, in
    microseconds; a broken bar has its sum beside it."""
    bars = [(label, _pieces(rows, prefix)) for prefix, label in BARS]
    bars = [(label, pieces) for label, pieces in bars if pieces]
    reference = dict(bars)[BARS[1][1]]
    least = SMALL * sum(reference.values())
    named = sorted((b for b in reference if reference[b] >= least), key=lambda b: -reference[b])
    with style():
        figure = new_figure(9.0, 1.6 + 0.5 * len(bars), "One tick of a jump's controller")
        axes = figure.add_subplot()
        axes.grid(axis="y", visible=False)
        colours = dict(zip(named, COLOURS * 3, strict=False))
        for block in (*named, ""):
            lefts, widths = [], []
            for _, pieces in bars:
                before = named[: named.index(block)] if block else named
                lefts.append(sum(pieces.get(b, 0.0) for b in before))
                rest = sum(pieces.values()) - lefts[-1]
                widths.append(pieces.get(block, 0.0) if block else rest)
            axes.barh(
                range(len(bars)), widths, 0.62, lefts, color=colours.get(block, PALE),
                label=block or "the others",
            )  # fmt: skip
        for row, (_, pieces) in enumerate(bars):
            total = sum(pieces.values())
            axes.annotate(
                f"{total:.0f} us", (total, row), (5, 0), textcoords="offset points", va="center",
                fontsize=8, color=FAINT,
            )  # fmt: skip
        axes.set_yticks(range(len(bars)), [label for label, _ in bars], color=INK)
        axes.tick_params(axis="y", length=0)
        axes.set_ylim(len(bars) - 0.4, -0.6)
        axes.margins(x=0.1)
        axes.set_xlabel("medians of the blocks [us]")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=7, fontsize=8)
        return svg_text(figure)


def _pieces(rows: Sequence[Mapping[str, Any]], prefix: str) -> dict[str, float]:
    """Return the median time of each block [us] in the rows whose names begin so."""
    found = [row for row in rows if row["name"].startswith(prefix) and row["value"] is not None]
    return {row["name"].removeprefix(prefix): float(row["value"]) for row in found}
