"""Recordings as moving pictures: robot and forces in 3D with a caption, several runs side by side or in one
picture, and plots beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..files.pip_line import pip_line
from ..hal.simulated.scenes import flat
from ..logs.file.reader import RecordedRun
from ..logs.viewing.contacts import force_scale, thruster_forces
from ..logs.viewing.scene_ports import scene_ports
from ..mathematics.arrays import Array
from ..plotting import DPI, Panel, draw_panels, image, new_figure, style
from ..robots.kinematics import link_poses
from ..robots.robot_description import Appearance, RobotDescription
from ..runtime.language.errors import AloftError
from .offscreen import Offscreen, Pixels, View

if TYPE_CHECKING:
    from PIL.Image import Image

ENDINGS = (".gif", ".mp4", ".png")
FRAMING = 1.7
"""The camera's distance, in sizes of the robot: the largest extent of its shapes at the start."""
FOLLOW_WINDOW = 0.5
"""The seconds over which the place of a base is averaged that the camera follows."""
COLORS = 128
"""The colours of a GIF: few make the file small, and the scene has few."""
SAMPLES = 8
"""The pictures from which they are chosen."""
CURSOR = (204, 38, 51)
"""The colour of the line in plots at the time that is shown."""


@dataclass(frozen=True)
class Camera:
    """The settings of a film.

    Attributes:
        width, height: of one run's picture [pixels].
        azimuth, elevation: where the camera looks to [deg]; at 90 deg along the world's y axis.
        distance: from the robot [m]; zero: so that the whole motion is in the picture.
        follow: whether it goes with the robot.
        forces: whether contact forces and pushes are drawn.
        overlay: whether several runs are drawn into one picture, the robots half transparent, as the first
            run's camera sees them.
    """

    width: int = 480
    height: int = 400
    azimuth: float = 135.0
    elevation: float = -9.0
    distance: float = 0.0
    follow: bool = False
    forces: bool = True
    overlay: bool = False


class Plots:
    """Panels under each other, of the size of a run's picture, with a line at the time that is shown."""

    def __init__(self, panels: Sequence[Panel], camera: Camera) -> None:
        with style():
            figure = new_figure(camera.width / DPI, camera.height / DPI)
            axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
            draw_panels(list(zip(axes, panels, strict=True)))
            self._image = image(figure)
        self._areas = [
            (each.get_window_extent(), each.get_xlim()) for each in axes
        ]  # in pixels from below, and the times of its sides

    def picture(self, instant: float) -> Pixels:
        """Draw the panels with the line, (height, width, 3)."""
        from PIL import ImageDraw

        shown = self._image.copy()
        draw = ImageDraw.Draw(shown)
        for area, (first, last) in self._areas:
            x = area.x0 + (instant - first) / (last - first) * (area.x1 - area.x0)
            if area.x0 <= x <= area.x1:
                sides = (x, shown.height - area.y1), (x, shown.height - area.y0)
                draw.line(sides, fill=CURSOR, width=2)
        return np.asarray(shown)


class Take:
    """One run as it is filmed.

    Args:
        run: its recording.
        caption: what stands below its pictures.
        camera: how it is taken.

    Raises:
        AloftError: nothing in the recording says where a robot is, or it holds no tick.
    """

    def __init__(self, run: RecordedRun, caption: str, camera: Camera) -> None:
        ports, robot = scene_ports(run.header), run.header.robot
        if ports is None or robot is None:
            raise AloftError(f"{run.path} has no robot: nothing in it says where one is")
        if not len(run.time):
            raise AloftError(f"{run.path} holds no tick; there is nothing to draw")
        self.caption = caption
        self.robot = robot
        self.terrain = run.header.terrain or flat()
        self.time = run.time
        count = len(self.time)
        pose = ports.pose
        self.joints = run[pose.joint_position]
        self.base, self.turn = pose.base(run.__getitem__, count)
        self._points = self._forces = np.zeros((count, 0, 3))
        if camera.forces and ports.contact_position and ports.contact_force:
            self._points, self._forces = run[ports.contact_position], run[ports.contact_force]
        if camera.forces and ports.thrust:
            poses = link_poses(robot, self.base, self.turn, self.joints)
            places, forces = thruster_forces(robot, poses, run[ports.thrust])
            self._points = np.concatenate([self._points, places], axis=1)
            self._forces = np.concatenate([self._forces, forces], axis=1)
        self._push = None
        if camera.forces and ports.push:
            self._push = run[f"{ports.push}.point"], run[f"{ports.push}.force"]
        standing = max(float(self.base[0, 2]), 0.3)
        self._arrow = force_scale(robot)
        self._phases = _named_phase(run)
        self._camera = camera
        self._middle = _smoothed(self.base, self.time) if camera.follow else None
        low, high = self.base.min(axis=0), self.base.max(axis=0)
        travel = (high - low)[2:] if camera.follow else high - low
        bottom, top = extent(robot, self.base[:1], self.turn[:1], self.joints[:1])
        size = max(standing, float((top - bottom).max()))
        self._center = 0.5 * (low + high)
        # Between the lowest and the highest that is seen, head and soles included.
        self._center[2] += 0.5 * float(bottom[2] + top[2]) - float(self.base[0, 2])
        self._distance = camera.distance or FRAMING * size + float(np.linalg.norm(travel))

    def row(self, instant: float) -> int:
        """Return the tick that is shown at a time: the latest until then."""
        return int(np.clip(np.searchsorted(self.time, instant + 1e-9) - 1, 0, len(self.time) - 1))

    def view(self, row: int) -> View:
        """Return the view of the camera."""
        at = self._center if self._middle is None else self._middle[row]
        place = (float(at[0]), float(at[1]), float(self._center[2]))
        return View(place, self._distance, self._camera.azimuth, self._camera.elevation)

    def arrows(self, row: int) -> Iterator[tuple[Array, Array]]:
        """Yield the forces: on the feet and of thrusters from their points of action, a push to its
        point."""
        for point, force in zip(self._points[row], self._forces[row], strict=True):
            if np.linalg.norm(force) * self._arrow > 0.01:
                yield point, point + self._arrow * force
        if self._push is not None:
            point, force = self._push[0][row], self._push[1][row]
            if np.linalg.norm(force) * self._arrow > 0.01:
                yield point - self._arrow * force, point

    def text(self, row: int) -> str:
        """Return the caption below the picture."""
        phase = "" if self._phases is None else f"  {self._phases[row]}"
        return f"{self.caption}  {self.time[row]:.2f} s{phase}"


def extent(robot: RobotDescription, base: Array, turn: Array, joints: Array) -> tuple[Array, Array]:
    """Return the least and the greatest coordinates of a robot's links and their shapes [m]."""
    poses = link_poses(robot, base, turn, joints)
    low, high = poses.position[0].min(axis=0), poses.position[0].max(axis=0)
    for number, link in enumerate(robot.links):
        look = robot.looks.get(link.name, Appearance())
        balls = [
            (corner, shape.radius)
            for shape in (*link.shapes, *look.shapes)
            for corner in shape.corners
        ]
        balls += [(box.position, 0.5 * max(box.size)) for box in look.boxes]
        for point, radius in balls:
            place = poses.position[0, number] + poses.rotation[0, number] @ np.asarray(point)
            low, high = np.minimum(low, place - radius), np.maximum(high, place + radius)
    return low, high


def _named_phase(run: RecordedRun) -> list[str] | None:
    """Return the name of the phase in each tick, of the first signal ``phase`` whose numbers have
    names."""
    for field in run.header.bus.fields:
        if (
            field.values
            and field.field_name == "phase"
            and not field.shape
            and "~" not in field.name
        ):
            return [field.values.get(int(value), "").lower() for value in run[field.name]]
    return None


def _smoothed(base: Array, time: Array) -> Array:
    """Return the place of the base, averaged over ``FOLLOW_WINDOW``."""
    period = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    half = max(1, round(0.5 * FOLLOW_WINDOW / period))
    padded = np.concatenate([np.repeat(base[:1], half, 0), base, np.repeat(base[-1:], half, 0)])
    sums = np.cumsum(np.concatenate([np.zeros((1, 3)), padded]), axis=0)
    size = 2 * half + 1
    means: Array = (sums[size:] - sums[:-size]) / size
    return means


def instants(takes: Sequence[Take], start: float | None, end: float | None, step: float) -> Array:
    """Return the times of the pictures [s]; by default from the first tick to the longest run's
    last.

    Raises:
        AloftError: there is no such time in any of the recordings.
    """
    first = min(float(take.time[0]) for take in takes)
    last = max(float(take.time[-1]) for take in takes)
    start, end = first if start is None else start, last if end is None else end
    if not first <= start <= end <= last + step:
        raise AloftError(
            f"no pictures from {start:g} s to {end:g} s: what was recorded is from {first:g} s to {last:g} s"
        )
    return np.asarray(start + step * np.arange(max(1, int((end - start) / step + 1e-9) + 1)), float)


def pictures(
    takes: Sequence[Take],
    times: Array,
    camera: Camera,
    advance: Callable[[], None] = lambda: None,
    panels: Sequence[Panel] = (),
) -> Iterator[Image]:
    """Draw the picture at each time, with the runs side by side or in one, each over its caption,
    and plots at the right.

    Raises:
        NoRendererError: there is nothing here to draw with.
    """
    columns: list[list[Pixels]] = []
    for take in takes:  # one after another, as one renderer is current at a time
        column, seen = [], takes[0] if camera.overlay else take
        with Offscreen(take.robot, take.terrain, camera.width, camera.height) as renderer:
            for instant in times:
                row, view = take.row(float(instant)), seen.view(seen.row(float(instant)))
                pose = take.base[row], take.turn[row], take.joints[row]
                column.append(renderer.picture(*pose, view, take.arrows(row)))
                advance()
        columns.append(column)
    plots = Plots(panels, camera) if panels else None
    for k, instant in enumerate(times):
        texts = [take.text(take.row(float(instant))) for take in takes]
        parts = [column[k] for column in columns]
        if camera.overlay:
            mean = np.mean(np.asarray(parts, np.float64), axis=0)
            parts = [np.rint(mean).astype(np.uint8)]
            others = [take.caption for take in takes[1:]]
            texts = [", ".join([texts[0], *others])]
        if plots is not None:
            parts, texts = [*parts, plots.picture(float(instant))], [*texts, ""]
        yield _captioned(parts, texts)


def _captioned(parts: Sequence[Pixels], texts: Sequence[str]) -> Image:
    """Join pictures side by side, each over its text."""
    from PIL import Image as Images
    from PIL import ImageDraw, ImageFont

    height, width = parts[0].shape[:2]
    size = max(11, height // 26)
    canvas = Images.new("RGB", (width * len(parts), height + 2 * size), (255, 255, 255))
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(size)
    for k, (part, text) in enumerate(zip(parts, texts, strict=True)):
        canvas.paste(Images.fromarray(np.ascontiguousarray(part)), (k * width, 0))
        draw.text((k * width + size // 2, height + size // 3), text, (40, 44, 52), font=font)
    return canvas


def write_film(path: Path, frames: Iterator[Image], rate: float) -> int:
    """Write ``.gif``, ``.mp4`` or, from the first picture, ``.png``; returns how many pictures it has.

    Raises:
        AloftError: MP4 without the library PyAV.
        OSError: the file cannot be written.
    """
    if path.suffix == ".mp4":
        return _write_mp4(path, frames, rate)
    first = next(frames)
    if path.suffix == ".png":
        first.save(path)
        return 1
    from PIL.Image import Dither

    rest = list(frames)
    palette = _sample([first, *rest]).quantize(COLORS)
    others = [frame.quantize(palette=palette, dither=Dither.NONE) for frame in rest]
    first.quantize(palette=palette, dither=Dither.NONE).save(
        path,
        save_all=True,
        append_images=others,
        duration=round(1000.0 / rate),
        loop=0,
        optimize=True,
    )
    return 1 + len(others)


def _sample(frames: Sequence[Image]) -> Image:
    """Join some of the pictures, one below the other: one that has the colours of all."""
    from PIL import Image as Images

    some = frames[:: max(1, len(frames) // SAMPLES)]
    width, height = some[0].size
    sheet = Images.new("RGB", (width, height * len(some)))
    for k, frame in enumerate(some):
        sheet.paste(frame, (0, k * height))
    return sheet


def _write_mp4(path: Path, frames: Iterator[Image], rate: float) -> int:
    try:
        import av
    except ImportError:
        raise AloftError(f"MP4 needs PyAV: {pip_line('pictures')}; GIF does not") from None
    count = 0
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("libx264", rate=Fraction(rate).limit_denominator(1000))
        for frame in frames:
            pixels: NDArray[np.uint8] = np.asarray(frame)
            even = np.ascontiguousarray(
                pixels[: pixels.shape[0] // 2 * 2, : pixels.shape[1] // 2 * 2]
            )
            if count == 0:
                stream.height, stream.width = even.shape[:2]
                stream.pix_fmt = "yuv420p"
                stream.options = {"crf": "20"}
            for packet in stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")):
                container.mux(packet)
            count += 1
        for packet in stream.encode():
            container.mux(packet)
    return count
