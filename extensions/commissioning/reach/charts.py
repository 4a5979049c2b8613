"""Charts of how far jumps reach: as shares of the theoretical bound, and of two robots in lengths of their legs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....plotting import COLOURS, FAINT, INK, PALE, image, new_figure, style, svg_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = (
    ("theory", "theory: full motors, no margins", PALE, 0.78),
    ("planned", "planned by the recipe", COLOURS[5], 0.46),
    ("reached", "lands at 95 %", COLOURS[0], 0.22),
)
"""The bars from the widest to the narrowest: key, label, colour and width."""


def frontier_chart(found: Sequence[Mapping[str, Any]]) -> str:
    """Draw the chart as SVG text: one row a direction, the first at the top, its bars as shares of
    the theoretical bound, and the values beside them."""
    from matplotlib.ticker import PercentFormatter

    with style():
        figure = new_figure(9.0, 1.5 + 0.42 * max(len(found), 1), "How far jumps reach")
        axes = figure.add_subplot()
        axes.grid(axis="y", visible=False)
        for key, label, colour, width in KINDS:
            shares = [each[key] / each["theory"] if each["theory"] else 0.0 for each in found]
            bars = axes.barh(range(len(found)), shares, width, color=colour, label=label)
            for row, bar in enumerate(bars):
                bar.set_gid(f"{key}-{row}")
        for row, each in enumerate(found):
            axes.annotate(
                f"{_values(each)} {each['unit']}", (1.0, row), (8, 0),
                xycoords=axes.get_yaxis_transform(), textcoords="offset points", va="center",
                fontsize=8, color=FAINT,
            )  # fmt: skip
        axes.set_yticks(range(len(found)), [each["name"] for each in found], color=INK)
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.set_ylim(len(found) - 0.4, -0.6)
        axes.set_xlim(0.0, 1.0)
        axes.xaxis.set_major_formatter(PercentFormatter(1.0, 0))
        axes.set_xlabel("share of the theoretical bound; values: reached / planned / theory")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
        return svg_text(figure)


def save_reach_chart(
    found: Mapping[str, Any], beside: Mapping[str, Any], folder: Path
) -> tuple[Path, Path]:
    """Draw the chart of ``reach`` into ``reach.svg`` and ``reach.png`` of a folder: one row a direction, the robot's
    bars above those of the robot ``beside`` it, in lengths of the legs of each; a turn of 90 degrees counts as one."""
    drawn, pixels = folder / "reach.svg", folder / "reach.png"
    with style():
        figure = _reach_figure(found, beside)
        drawn.write_text(svg_text(figure), encoding="utf-8")
        image(figure).save(pixels, format="PNG")
    return drawn, pixels


def _reach_figure(found: Mapping[str, Any], beside: Mapping[str, Any]) -> Figure:
    rows = found["directions"]
    others = {each["name"]: each for each in beside["directions"]}
    title = f"How far {found['robot']} and {beside['robot']} reach"
    figure = new_figure(9.0, 1.6 + 0.6 * max(len(rows), 1), title)
    axes = figure.add_subplot()
    axes.grid(axis="y", visible=False)
    for key, label, colour, width in KINDS:
        for robot, shift, scale, alpha in ((rows, -0.18, 0.42, 1.0), (others, 0.22, 0.3, 0.45)):
            ours = robot is rows
            each = [row if ours else others.get(row["name"], {}) for row in rows]
            bars = axes.barh(
                [k + shift for k in range(len(rows))],
                [one.get("in_legs", {}).get(key, 0.0) for one in each],
                width * scale / KINDS[0][3], color=colour, alpha=alpha,
                label=label if ours else None,
            )  # fmt: skip
            for row, bar in enumerate(bars):
                bar.set_gid(f"{'' if ours else 'beside-'}{key}-{row}")
    for k, each in enumerate(rows):
        axes.annotate(
            f"{_values(each)} {each['unit']}", (1.0, k - 0.18), (8, 0),
            xycoords=axes.get_yaxis_transform(), textcoords="offset points", va="center",
            fontsize=8, color=FAINT,
        )  # fmt: skip
    axes.set_yticks(range(len(rows)), [each["name"] for each in rows], color=INK)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(left=0.0)
    axes.set_xlabel(
        "lengths of the legs (thigh and shank), or turns of 90 deg; "
        f"{found['robot']} above, {beside['robot']} below it, paler"
    )
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
    return figure


def _values(each: Mapping[str, Any]) -> str:
    """Format a direction's ends; a plus marks those at which the time ran out."""
    return " / ".join(
        f"{each[key]:g}{'' if each[f'{key}_ended'] else '+'}"
        for key in ("reached", "planned", "theory")
    )
