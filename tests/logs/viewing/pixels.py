"""What a picture of the viewer shows, counted in pixels of the colours that are drawn.

Places are shares of the picture's width and height, so they serve the window and the page.
"""

import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from aloft.logs.file.reader import RecordedRun

Pixels = NDArray[np.int64]
DRIVERS = [*Path("/usr/share/vulkan/icd.d").glob("lvp*"), *Path("/etc/vulkan/icd.d").glob("lvp*")]
TIMEOUT = 1800.0
"""Seconds that anything may take on a machine with much else to do."""
SCENE = (0.07, 0.57, 0.0, 0.395)
"""Top, bottom, left and right of the robot in 3D."""
FORCES = (0.41, 0.65, 0.72, 1.0)
"""Those of the plot of the forces on the feet, without the numbers of its axis."""
LEGEND = (0.41, 0.49, 0.94, 1.0)
"""Those of its legend."""
LEFT, RIGHT = (38, 198, 218), (255, 167, 38)
"""The colours of the feet."""
FORCE, PUSH, GROUND, CONE = (229, 57, 53), (255, 64, 129), (141, 146, 153), (255, 183, 77)

needs_vulkan = pytest.mark.skipif(
    not DRIVERS, reason="draws with software Vulkan; install Debian's mesa-vulkan-drivers"
)


def pixels_of(picture: bytes | Path) -> Pixels:
    """The pixels of a PNG, (rows, columns, 3)."""
    opened = Image.open(BytesIO(picture) if isinstance(picture, bytes) else picture)
    return np.asarray(opened.convert("RGB")).astype(np.int64)


def part(pixels: Pixels, place: tuple[float, float, float, float]) -> Pixels:
    """The part of a picture at a place."""
    rows, columns, _ = pixels.shape
    top, bottom, left, right = place
    return pixels[int(top * rows) : int(bottom * rows), int(left * columns) : int(right * columns)]


def near(pixels: Pixels, color: tuple[int, int, int], most: int = 40) -> NDArray[np.bool_]:
    """Which pixels differ from a colour by no more than ``most`` in each part."""
    result: NDArray[np.bool_] = (np.abs(pixels - np.array(color)) <= most).all(axis=-1)
    return result


def robot(pixels: Pixels) -> NDArray[np.bool_]:
    """Which pixels have the bluish grey of the robot, in light or shadow."""
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    shade = (blue - red > 6) & (blue - red < 50) & (green > red) & (blue >= green)
    result: NDArray[np.bool_] = shade & (pixels.max(axis=-1) > 60) & (pixels.max(axis=-1) < 215)
    return result


def other_robot(pixels: Pixels) -> NDArray[np.bool_]:
    """Which pixels have the light brown of the robot of a second run."""
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    result: NDArray[np.bool_] = (
        (red - blue > 30) & (red > green) & (green > blue) & (red - blue < 130)
    )
    return result


def expect_zero_in_flight(pixels: Pixels, run: RecordedRun, flight: NDArray[np.int64]) -> None:
    """The curve of the forces on the feet is flat in flight and lies below everything else."""
    view = part(pixels, FORCES)
    lines = near(view, LEFT) | near(view, RIGHT)
    rows = np.array([np.flatnonzero(column)[-1] if column.any() else -1 for column in lines.T])
    ends = run.time[flight[[0, -1]]] / run.time[-1] * len(rows)
    inside = rows[int(ends[0]) + 6 : int(ends[1]) - 6]
    within = inside[inside >= 0]  # the line of the time hides some
    assert len(within) > max(6, 0.6 * len(inside)) and np.ptp(within) <= 2, (
        "the curve is flat in flight"
    )
    assert within.max() >= rows.max() - 1, "and lies on zero, below everything else"


def expect_legend_beside_curves(pixels: Pixels) -> None:
    """The legend of the forces has its marks, one a foot, and no curve runs through it."""
    for color in (LEFT, RIGHT):
        count = near(part(pixels, LEGEND), color).sum()
        assert 20 < count < 250, "the legend's marks and nothing else of that colour"


def settled(
    picture: Callable[[], Pixels],
    good: Callable[[Pixels], bool] = lambda _: True,
    *,
    still: bool = True,
) -> Pixels:
    """The picture when ``good`` is content with it and, if it is ``still``, it changes no more."""
    end, before = time.monotonic() + TIMEOUT, picture()
    while time.monotonic() < end:
        time.sleep(0.5)
        now = picture()
        if good(now) and not (still and (now != before).any(axis=-1).mean() > 1e-3):
            return now
        before = now
    pytest.fail(f"the picture is not as it should be within {TIMEOUT:g} s")


def wait_until_shown(client: Any, last: float) -> Any:
    """The state of the viewer when it has all of a recording that ends at ``last`` [s]."""
    if not hasattr(client, "get_state"):
        pytest.skip("a viewer before Rerun 0.41 cannot be asked what it shows")
    end = time.monotonic() + TIMEOUT
    while time.monotonic() < end:
        state = client.get_state()
        shown = [r for r in state.recordings if r.store_id == state.active_recording]
        ends = [line.end for r in shown for line in r.timelines if line.name == "t"]
        if state.views and not state.loading and ends and (ends[0] or 0) >= 0.9e9 * last:
            return state
        time.sleep(0.2)
    pytest.fail(f"not shown within {TIMEOUT:g} s: {state}")


def photograph(client: Any, instant: float, path: Path) -> Pixels:
    """The pixels of the viewer at an instant [s]."""
    client.set_time("t", duration=instant, play_state="paused")
    time.sleep(1.0)

    def picture() -> Pixels:
        path.unlink(missing_ok=True)
        client.save_screenshot(str(path))
        return pixels_of(path)

    return settled(picture)
