"""Draws a motion as a strip of frames, each with its time and what happens at it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...mathematics.arrays import Array
from ...plotting import FAINT, image, new_figure, style
from ...robots.terrain import Terrain
from ...studies.offscreen import Offscreen, View

if TYPE_CHECKING:
    from PIL.Image import Image

    from ...robots.description import RobotDescription


FRAME = (2.3, 2.43)
"""The size of a frame [inch]."""
PIXELS = (510, 540)
"""The size in which a frame is rendered: more than its pixels in the picture, which smooths it."""
MARGIN, HEAD, NOTE, CAPTION = 0.08, 0.42, 0.2, 0.26
"""Between frames, above the notes, of one note, and below a frame [inch]."""


@dataclass(frozen=True)
class Motion:
    """Poses over time: base position [m], quaternion x, y, z, w and joint angles [rad]."""

    time: Array
    base: Array
    quaternion: Array
    joints: Array

    def at(self, instant: float) -> tuple[Array, Array, Array]:
        """Return the pose nearest to a time."""
        k = int(np.argmin(np.abs(self.time - instant)))
        return self.base[k], self.quaternion[k], self.joints[k]


@dataclass(frozen=True)
class Moment:
    """The time of a frame, and the text below it."""

    time: float
    text: str


def draw_strip(
    title: str,
    notes: Sequence[str],
    motion: Motion,
    moments: Sequence[Moment],
    robot: RobotDescription,
    scene: Terrain,
    view: View,
    columns: int = 4,
) -> Image:
    """Draw the frames in rows, each with its text below, under a title and lines of notes.

    Raises:
        NoRendererError: there is nothing here to draw with.
    """
    rows = -(-len(moments) // columns)
    head = HEAD + NOTE * len(notes)
    height = head + rows * (FRAME[1] + CAPTION)
    with style(), Offscreen(robot, scene, *PIXELS) as renderer:
        figure = new_figure(columns * (FRAME[0] + MARGIN) + MARGIN, height)
        figure.set_layout_engine("none")
        width = figure.get_figwidth()
        figure.text(MARGIN / width, 1.0 - 0.1 / height, title, va="top", size=12, weight="bold")
        for number, note in enumerate(notes):
            y = 1.0 - (HEAD + NOTE * number) / height
            figure.text(MARGIN / width, y, note, va="top", size=8, color=FAINT)
        for number, moment in enumerate(moments):
            row, column = divmod(number, columns)
            left = MARGIN + column * (FRAME[0] + MARGIN)
            below = height - head - row * (FRAME[1] + CAPTION) - FRAME[1]
            axes = figure.add_axes(
                (left / width, below / height, FRAME[0] / width, FRAME[1] / height)
            )
            axes.imshow(renderer.picture(*motion.at(moment.time), view), aspect="auto")
            axes.set_axis_off()
            axes.text(
                0.0, -0.015, moment.text, transform=axes.transAxes, ha="left", va="top", size=9
            )
        return image(figure)


def moments_of(start: float, lift_off: float, touchdown: float, end: float) -> list[Moment]:
    """Choose two frames before lift-off, two between it and touchdown, two of the landing until
    rest."""
    flight = touchdown - lift_off
    chosen = (
        (start, "stand"),
        (0.35 * start + 0.65 * lift_off, "squat"),
        (lift_off, "lift-off"),
        (lift_off + 0.35 * flight, "flight"),
        (lift_off + 0.7 * flight, "flight"),
        (touchdown, "touchdown"),
        (min(touchdown + 0.15, end), "landing"),
        (end, "end"),
    )
    return [Moment(time, f"{time:.2f} s  {words}") for time, words in chosen]
