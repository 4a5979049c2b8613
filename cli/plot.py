"""``aloft plot``: some signals of a recording over time, as a picture or in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from ..runtime.language.errors import AloftError
from .shared.output import errors_reported
from .shared.run_panels import run_panels

if TYPE_CHECKING:
    from ..plotting import Panel

_WIDTH, _HEIGHT = 72, 12
"""Characters of a plot in the terminal."""
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""The bits of a Braille character's dots, by column and row."""


def plot(
    run: Annotated[Path, typer.Argument(help="The recording, a .rrd file.")],
    signals: Annotated[
        list[str],
        typer.Argument(
            help="block.port.field, all fields of block.port, or one element: a.b.c[2]. Further "
            "recordings, named before the signals, are drawn over the same axes."
        ),
    ],
    png: Annotated[Path | None, typer.Option("--png", help="Draw into this PNG file.")] = None,
    svg: Annotated[Path | None, typer.Option("--svg", help="Draw into this SVG file.")] = None,
    start: Annotated[float | None, typer.Option("--from", help="From this time [s].")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Up to this time [s].")] = None,
) -> None:
    """Plot signals of one or several recordings: in the terminal, or into a file with --png or --svg."""
    from .shared.viewing import read

    with errors_reported(False):
        files = [run, *(Path(name) for name in signals if name.endswith(".rrd"))]
        names = [name for name in signals if not name.endswith(".rrd")]
        if not names:
            raise AloftError("which signals? aloft log info FILE.rrd lists them")
        recorded = [read(file) for file in files]
        stems = [file.stem for file in files]
        shown = stems if len(set(stems)) == len(stems) else [str(file) for file in files]
        panels = run_panels(recorded, shown, names, start, end)
        if svg is not None or png is not None:
            _draw(panels, run.stem, svg, png)
            return
    for panel in panels:
        typer.echo(in_terminal(panel))


def _draw(panels: Sequence[Panel], title: str, svg: Path | None, png: Path | None) -> None:
    """Write the panels one below the other. Raises ``AloftError`` if a file cannot be written."""
    from ..plotting import image, panels_figure, style, svg_text

    with style():
        figure = panels_figure(panels, title)
        try:
            for path in (svg, png):
                if path is None:
                    continue
                if path == svg:
                    path.write_text(svg_text(figure), encoding="utf-8")
                else:
                    image(figure).save(path, format="PNG")
                typer.echo(f"plot: {path}", err=True)
        except OSError as error:
            raise AloftError(f"cannot write the plot: {error}") from error


def in_terminal(panel: Panel) -> str:
    """Draw a panel as text: Braille dots, the range of values on the left, that of time below."""
    from ..plotting import occurring

    x = np.concatenate([np.asarray(line.x) for line in panel.lines])
    y = np.concatenate([np.asarray(line.y) for line in panel.lines])
    finite = y[np.isfinite(y)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    if low == high:
        low, high = low - 0.5, high + 0.5
    first, last = float(x.min()), float(x.max())
    span = (last - first) or 1.0
    cells = np.full((_HEIGHT, _WIDTH), 0x2800)
    good = np.isfinite(y)
    columns = np.clip((x[good] - first) / span * (2 * _WIDTH - 1), 0, 2 * _WIDTH - 1).astype(int)
    rows = ((high - y[good]) / (high - low) * (4 * _HEIGHT - 1)).round().astype(int)
    for column, row in zip(columns.tolist(), rows.tolist(), strict=True):
        cells[row // 4, column // 2] |= _DOTS[column % 2][row % 4]
    rows_of_text = ["".join(map(chr, row)) for row in cells.tolist()]
    labels = {0: f"{high:.4g}", _HEIGHT - 1: f"{low:.4g}"}
    if panel.y_names:
        step = (high - low) / (_HEIGHT - 1)
        labels = {round((high - v) / step): name[:10] for v, name in occurring(panel).items()}
    names = [line.name for line in panel.lines if line.name]
    head = panel.title + (f": {', '.join(names)}" if names else "")
    body = [f"{labels.get(number, ''):>10} {row}" for number, row in enumerate(rows_of_text)]
    foot = f"{'':>10} {first:<10.4g}{'time [s]':^{_WIDTH - 20}}{last:>10.4g}"
    return "\n".join([head, *body, foot])
