"""A motion as a strip of frames, each with its time and what happens then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..charts.svg import FAINT, INK
from .canvas import font
from .offscreen import Offscreen, View

if TYPE_CHECKING:
    from PIL.Image import Image

    from ...hal.simulated.scenes import Scene
    from ...robots.description import RobotDescription

Array = NDArray[np.float64]

FRAME = (340, 360)
MARGIN, HEAD, CAPTION, LINE = 12, 44, 26, 20


@dataclass(frozen=True)
class Motion:
    """Poses over time: base position [m], quaternion x, y, z, w and joint angles [rad]."""

    time: Array
    base: Array
    quaternion: Array
    joints: Array

    def at(self, instant: float) -> tuple[Array, Array, Array]:
        """The pose nearest to a time."""
        k = int(np.argmin(np.abs(self.time - instant)))
        return self.base[k], self.quaternion[k], self.joints[k]


@dataclass(frozen=True)
class Moment:
    """When a frame is, and what is written under it."""

    time: float
    text: str


def draw_strip(
    title: str,
    notes: Sequence[str],
    motion: Motion,
    moments: Sequence[Moment],
    robot: RobotDescription,
    scene: Scene,
    view: View,
    columns: int = 4,
) -> Image:
    """Frames in rows, read like a text.

    Raises:
        NoRendererError: there is nothing here to draw with.
    """
    from PIL import Image, ImageDraw

    width, height = FRAME
    rows = -(-len(moments) // columns)
    head = HEAD + LINE * len(notes)
    size = (
        MARGIN + columns * (width + MARGIN),
        head + rows * (height + CAPTION + MARGIN),
    )
    picture = Image.new("RGB", size, "white")
    pen = ImageDraw.Draw(picture)
    pen.text((MARGIN, 12), title, fill=INK, font=font(19))
    for number, note in enumerate(notes):
        pen.text((MARGIN, HEAD - 4 + LINE * number), note, fill=FAINT, font=font(13))
    with Offscreen(robot, scene, width * 3 // 2, height * 3 // 2) as renderer:
        for number, moment in enumerate(moments):
            left = MARGIN + (number % columns) * (width + MARGIN)
            top = head + (number // columns) * (height + CAPTION + MARGIN)
            pixels = renderer.picture(*motion.at(moment.time), view)
            frame = Image.fromarray(pixels).resize(FRAME, Image.Resampling.LANCZOS)
            picture.paste(frame, (left, top))
            pen.text((left, top + height + 5), moment.text, fill=INK, font=font(14))
    return picture


def moments_of(start: float, lift_off: float, touchdown: float, end: float) -> list[Moment]:
    """Two frames before lift-off, two between it and touchdown, two of the landing until rest."""
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
