"""Common parts of all pictures: one look, panels of lines over time, and files of them.

matplotlib draws everything. It is imported inside the functions, because most commands draw
nothing. The same data give the same bytes: the fonts are matplotlib's own, and neither dates nor
random names are written.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .mathematics.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL.Image import Image


COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#6d4c41", "#7f7f7f",
)  # fmt: skip
"""The colours of Okabe and Ito, which most eyes can tell apart; lines take them in turn."""
DASHES = ("-", (0, (5, 2)), (0, (1.5, 2)))
"""After each round through the colours the lines get another dash pattern."""
INK, FAINT, PALE = "#1f2933", "#66727f", "#dde2e7"
"""Text and frames, secondary text and limits, and grid lines."""
SHADES = {
    "squat": "#f4f1e6", "thrust": "#fdeadb", "flight": "#e3edf7", "landing": "#e7f4e8",
    "recover": "#f3f3f3", "push": "#f6c89f",
}  # fmt: skip
"""Background colours of stretches of time, by what happens in them."""
DARK = {
    "#ffffff": "#14191f", INK: "#e6eaee", FAINT: "#9aa7b3", PALE: "#38424c",
    "#f4f1e6": "#2a2820", "#fdeadb": "#35261b", "#e3edf7": "#1c2b3b", "#e7f4e8": "#1b2d20",
    "#f3f3f3": "#252a30", "#f6c89f": "#5c4028", "#0072b2": "#4ea8dd", "#6d4c41": "#b08b7d",
}  # fmt: skip
"""Colours of a dark screen in an SVG file for light colours, and for lines that are too dark."""
DPI = 150
"""Pixels per inch of pictures that are not vector graphics."""
LABEL_SIZE = 7.5
"""The font size of the labels at the ends of lines [pt]."""

_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Helvetica", "Arial"],
    "font.size": 9.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.0,
    "axes.unicode_minus": False,
    "axes.formatter.useoffset": False,
    "grid.color": PALE,
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "lines.solid_joinstyle": "round",
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.constrained_layout.w_pad": 0.09,
    "figure.constrained_layout.h_pad": 0.09,
    "svg.fonttype": "none",  # text stays text: it can be searched, and files are small
    "svg.hashsalt": "aloft",
}


@contextmanager
def style() -> Iterator[None]:
    """Draw in aloft's look within the context. Figures are made and written inside it."""
    import matplotlib

    with matplotlib.rc_context(_STYLE):
        yield


def new_figure(width: float, height: float, title: str = "") -> Figure:
    """Make an empty figure of this size [inch], with its title at the top left.

    The figure belongs to no window, so no display is needed.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
    return figure


def svg_text(figure: Figure) -> str:
    """Write the figure as the text of an SVG file, light in print and dark where its reader's
    screen is.

    The same figure always gives the same text.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": "aloft"})
    text = "\n".join(line.rstrip() for line in buffer.getvalue().splitlines()) + "\n"
    rules = [
        f'[style*="{what}: {light}"]{{{what}:{dark}!important}}'
        for light, dark in DARK.items()
        for what in ("fill", "stroke")
        if f"{what}: {light}" in text
    ]
    rules.append(f"text:not([style*=fill]){{fill:{DARK[INK]}}}")
    sheet = f"<style>@media screen and (prefers-color-scheme:dark){{{''.join(rules)}}}</style>"
    head, end, rest = text.partition("<defs>")
    return f"{head}{sheet}\n {end}{rest}"


def image(figure: Figure) -> Image:
    """Draw the figure as a picture of ``DPI`` pixels per inch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def look(number: int) -> dict[str, Any]:
    """Return the colour and the dash pattern of the line with that number, counted from zero."""
    rounds = number // len(COLOURS)
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": DASHES[rounds % len(DASHES)],
    }


@dataclass(frozen=True)
class Curve:
    """One line of a panel. It is interrupted where ``y`` is not finite.

    Attributes:
        name: the label at the line's right end; empty for none.
        x, y: the points, (n,) each.
        colour: by default the next one in turn.
        dashed: whether the line is dashed.
        limit: whether the line is a limit, which is thin, dashed and grey.
    """

    name: str
    x: Array
    y: Array
    colour: str = ""
    dashed: bool = False
    limit: bool = False


@dataclass(frozen=True)
class Shade:
    """A stretch of x with another background; ``kind`` is one of ``SHADES``.

    A stretch with a ``name`` has it written above it, where there is room.
    """

    start: float
    end: float
    kind: str = "flight"
    name: str = ""


@dataclass(frozen=True)
class Panel:
    """Lines over one axis.

    Attributes:
        title: what y is, with its unit in brackets.
        lines: what is drawn.
        x_label: what x is, with its unit in brackets; empty where a panel below says it.
        x_range: from where to where x goes; by default all that the lines have.
        shades: stretches of x with another background.
        y_names: the names of the values of an enumeration, which y has on its axis.
    """

    title: str
    lines: Sequence[Curve]
    x_label: str = "time [s]"
    x_range: tuple[float, float] | None = None
    shades: Sequence[Shade] = ()
    y_names: Mapping[int, str] = field(default_factory=dict)


def draw_panels(panels: Sequence[tuple[Axes, Panel]]) -> None:
    """Draw every panel into its axes, and then label the lines at their right ends.

    All axes belong to one figure. The labels come last because their distances depend on the
    height that the axes have once everything else has its place.
    """
    for axes, panel in panels:
        _draw_panel(axes, panel)
    if not panels:
        return
    figure = panels[0][0].get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    for axes, panel in panels:
        numbers = _numbers(panel.lines)
        label_ends(
            axes,
            [
                (line.name, _last(line, axes.get_xlim()), _colour(line, number))
                for line, number in zip(panel.lines, numbers, strict=True)
                if line.name
            ],
        )


def panels_figure(panels: Sequence[Panel], title: str) -> Figure:
    """Draw panels one below the other, each as wide as a page."""
    figure = new_figure(9.0, 0.6 + 2.4 * len(panels), title)
    axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    # x is named once where all panels share it
    shared = len({panel.x_label for panel in panels}) == 1
    shown = [
        *(replace(panel, x_label="") if shared else panel for panel in panels[:-1]),
        panels[-1],
    ]
    draw_panels(list(zip(axes, shown, strict=True)))
    return figure


def panels_svg(panels: Sequence[Panel], title: str) -> str:
    """Draw panels one below the other, as the text of an SVG file."""
    with style():
        return svg_text(panels_figure(panels, title))


def save_panels(panels: Sequence[Panel], title: str, path: Path) -> None:
    """Draw panels one below the other into a file, as its ending says.

    Raises:
        ValueError: the ending is neither ``.svg`` nor ``.png``.
        OSError: the file cannot be written.
    """
    if path.suffix not in (".svg", ".png"):
        raise ValueError(f"{path}: a plot is written as .svg or .png")
    if path.suffix == ".svg":
        path.write_text(panels_svg(panels, title), encoding="utf-8")
        return
    with style():
        image(panels_figure(panels, title)).save(path, format="PNG")


def _draw_panel(axes: Axes, panel: Panel) -> None:
    x = [line.x[np.isfinite(line.x)] for line in panel.lines]
    known = np.concatenate(x) if x else np.zeros(0)
    start, end = panel.x_range or (
        (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    )
    if end - start < 1e-12:
        start, end = start - 0.5, end + 0.5
    for shade in panel.shades:
        left, right = max(shade.start, start), min(shade.end, end)
        if left >= right:
            continue
        axes.axvspan(left, right, color=SHADES.get(shade.kind, SHADES["flight"]), lw=0, zorder=0)
        if shade.name and (right - left) / (end - start) > 0.018 * len(shade.name):
            axes.text(
                0.5 * (left + right), 1.01, shade.name, transform=axes.get_xaxis_transform(),
                ha="center", va="bottom", fontsize=6.5, color=FAINT,
            )  # fmt: skip
    for line, number in zip(panel.lines, _numbers(panel.lines), strict=True):
        drawn = axes.plot(
            line.x, line.y, color=_colour(line, number), linewidth=0.8 if line.limit else None,
            linestyle=(0, (4, 2)) if line.dashed or line.limit else "-",
            zorder=1.5 if line.limit else 2.0,
        )  # fmt: skip
        drawn[0].set_gid("limit" if line.limit else "line")
    axes.set_xlim(start, end)
    axes.margins(y=0.06)
    if panel.y_names:
        marks = occurring(panel)
        axes.set_yticks(list(marks), labels=list(marks.values()))
    if panel.title:
        named = any(shade.name for shade in panel.shades)
        axes.set_title(panel.title, pad=13.0 if named else 5.0)
    axes.set_xlabel(panel.x_label)


def occurring(panel: Panel) -> dict[int, str]:
    """Return the named values of y that occur in a panel, from the lowest."""
    values = {float(y) for line in panel.lines for y in np.unique(line.y[np.isfinite(line.y)])}
    return {value: name for value, name in sorted(panel.y_names.items()) if float(value) in values}


def _numbers(lines: Sequence[Curve]) -> list[int]:
    """Return the index of each line's colour: limits and lines with a colour of their own take
    none."""
    numbers, used = [], 0
    for line in lines:
        numbers.append(used)
        used += not (line.limit or line.colour)
    return numbers


def _colour(line: Curve, number: int) -> str:
    return line.colour or (FAINT if line.limit else COLOURS[number % len(COLOURS)])


def _last(line: Curve, x_range: tuple[float, float]) -> float:
    """Return the last finite value that a line has within the range; NaN where it has none."""
    shown = np.isfinite(line.y) & (line.x >= x_range[0]) & (line.x <= x_range[1])
    return float(line.y[shown][-1]) if shown.any() else float("nan")


def label_ends(axes: Axes, labels: Sequence[tuple[str, float, str]]) -> None:
    """Write labels (text, y, colour) beside the right edge, near their y and never on each other."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    height = axes.get_position().height * figure.get_figheight() * 72.0
    low, high = axes.get_ylim()
    wanted = [(y - low) / (high - low) if np.isfinite(y) else 0.0 for _, y, _ in labels]
    for (text, _, colour), place in zip(
        labels, spread(wanted, 1.2 * LABEL_SIZE / height), strict=True
    ):
        axes.text(
            1.012, place, text, transform=axes.transAxes, ha="left", va="center", color=colour,
            fontsize=LABEL_SIZE,
        )  # fmt: skip


def spread(wanted: Sequence[float], gap: float) -> list[float]:
    """Spread places near the wanted ones, in the same order, between 0 and 1 and ``gap`` apart.

    Where there is no room for all between 0 and 1, the lowest ones go below 0.
    """
    order = sorted(range(len(wanted)), key=lambda k: wanted[k])
    found = list(wanted)
    lowest = 0.0
    for k in order:
        found[k] = max(found[k], lowest)
        lowest = found[k] + gap
    highest = 1.0
    for k in reversed(order):
        found[k] = min(found[k], highest)
        highest = found[k] - gap
    return found
