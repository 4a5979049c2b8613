"""Pictures of a jump, a push, a step, a somersault and a comparison show what they must.

They are made by Rerun's viewer without a screen, and once more by its page in a real browser that asks
for a light page, which the viewer is not by itself. ``pixels`` says how they are judged.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aloft import load
from aloft.logs.file.reader import RecordedRun, read
from aloft.logs.recording.drawn_run import write_comparison, write_view
from aloft.logs.recording.recorder import Recorder
from aloft.logs.viewing.viewer import start_viewer

from .browser import PROGRAM, Browser
from .pixels import (
    CONE,
    FORCE,
    FORCES,
    GROUND,
    LEFT,
    PUSH,
    RIGHT,
    SCENE,
    Pixels,
    expect_legend_beside_curves,
    expect_zero_in_flight,
    near,
    needs_vulkan,
    other_robot,
    part,
    photograph,
    pixels_of,
    robot,
    settled,
    wait_until_shown,
)

ROOT = Path(__file__).parents[3]
pytestmark = pytest.mark.long
needs_browser = pytest.mark.skipif(
    PROGRAM is None, reason="looks through a real browser; install Debian's chromium"
)


def recorded(name: str, folder: Path) -> RecordedRun:
    """A run of a shipped graph."""
    path = folder / f"{name}.rrd"
    load(ROOT / "graphs" / f"{name}.yaml").run(sinks=[Recorder(path)], log=False)
    return read(path)


@pytest.fixture(scope="module")
def jump(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    return recorded("jump", tmp_path_factory.mktemp("jump"))


@pytest.fixture(scope="module")
def step(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    return recorded("up_5cm", tmp_path_factory.mktemp("step"))


def flight_of(run: RecordedRun) -> NDArray[np.int64]:
    """The rows of the flight."""
    loaded = (run["robot.truth.contact_force"] != 0.0).any(axis=(1, 2))
    return np.flatnonzero(~loaded & (run.time > 0.5))


def pictures(file: Path, folder: Path, last: float, *instants: float) -> list[Pixels]:
    """What the viewer shows of a file that ends at ``last`` [s], at these instants [s]."""
    from rerun.experimental import ViewerClient

    viewer = start_viewer("headless", [file], size="1600x900")
    try:
        client = ViewerClient.connect(viewer.source)
        state = wait_until_shown(client, last)
        assert [report for view in state.views for report in view.reports] == []
        return [photograph(client, instant, folder / "picture.png") for instant in instants]
    finally:
        viewer.stop()


@needs_vulkan
def test_a_jump(jump: RecordedRun, tmp_path: Path) -> None:
    run, flight = jump, flight_of(jump)
    file = write_view(tmp_path / "view.rrd", run)
    standing, flying = pictures(
        file, tmp_path, float(run.time[-1]), 0.2, float(run.time[flight].mean())
    )
    for pixels in (standing, flying):
        assert robot(part(pixels, SCENE)).sum() > 5000
        expect_legend_beside_curves(pixels)
    assert near(part(standing, SCENE), FORCE).sum() > 20, "forces on the feet"
    assert near(part(standing, SCENE), CONE, 30).sum() > 40, "friction cones under them"
    assert near(part(flying, SCENE), FORCE).sum() == 0, "no force in flight"
    expect_zero_in_flight(flying, jump, flight)
    higher = [np.flatnonzero(robot(part(p, SCENE)).any(axis=1))[0] for p in (standing, flying)]
    assert higher[1] < higher[0] - 20, "the camera does not rise with the robot"


@needs_vulkan
def test_a_push(tmp_path: Path) -> None:
    run = recorded("push", tmp_path)
    pushed = np.flatnonzero((run["push.push.force"] != 0.0).any(axis=1))
    file = write_view(tmp_path / "view.rrd", run)
    before, during = pictures(file, tmp_path, float(run.time[-1]), 0.2, float(run.time[pushed[2]]))
    assert near(part(before, SCENE), PUSH).sum() == 0
    assert near(part(during, SCENE), PUSH).sum() > 50, "the push is an arrow at the torso"
    expect_zero_in_flight(during, run, flight_of(run))


@needs_vulkan
@pytest.mark.parametrize("whole", [True, False], ids=["aloft view", "the file itself"])
def test_a_step(step: RecordedRun, whole: bool, tmp_path: Path) -> None:
    run, flight = step, flight_of(step)
    # 4.3 kB of numbers, 0.7 of them the predictor's memory, some pictures, and once the robot's surfaces
    assert run.path.stat().st_size < 4600 * len(run.ticks) + 400_000
    file = write_view(tmp_path / "view.rrd", run) if whole else run.path
    (flying,) = pictures(file, tmp_path, float(run.time[-1]), float(run.time[flight].mean()))
    assert near(part(flying, SCENE), GROUND, 12).sum() > 5000, "the step is there"
    assert near(part(flying, SCENE), FORCE).sum() == 0
    expect_zero_in_flight(flying, step, flight)


@needs_vulkan
def test_a_somersault(tmp_path: Path) -> None:
    run = recorded("somersault", tmp_path)
    flight = flight_of(run)
    file = write_view(tmp_path / "view.rrd", run)
    instants = np.linspace(*run.time[flight[[0, -1]]], 4)[:3].tolist()
    shapes = []
    for pixels in pictures(file, tmp_path, float(run.time[-1]), *instants):
        drawn = robot(part(pixels, SCENE))
        rows, columns = (np.flatnonzero(drawn.any(axis=axis)) for axis in (1, 0))
        assert len(rows) > 60 and len(columns) > 60
        for found, size in zip((rows, columns), drawn.shape, strict=True):
            assert found[0] > 5 and found[-1] < size - 5, "all of the robot is in the view"
        shapes.append(drawn)
    for one, other in pairwise(shapes):
        assert (one != other).sum() > 3000, "and it turns"
    expect_zero_in_flight(pixels, run, flight)


@needs_vulkan
def test_a_comparison(jump: RecordedRun, step: RecordedRun, tmp_path: Path) -> None:
    file = write_comparison(tmp_path / "both.rrd", jump, step)
    (pixels,) = pictures(file, tmp_path, float(jump.time[-1]), 2.5)
    scene = part(pixels, SCENE)
    assert robot(scene).sum() > 2000 and other_robot(scene).sum() > 2000, "two robots"
    assert near(scene, GROUND, 12).sum() > 2000
    both = np.intersect1d(flight_of(jump), flight_of(step))
    view = part(pixels, FORCES)  # of both runs; where four lines lie on one another they blend
    first, last = (jump.time[both[[0, -1]]] / jump.time[-1] * view.shape[1]).astype(int)
    curves = near(view, LEFT) | near(view, RIGHT)
    zero = np.flatnonzero(curves.any(axis=1))[-1]
    assert curves.sum() > 400
    assert not curves[: zero - 2, first + 6 : last - 6].any(), "no force in flight"


def expect_no_calls_outside(browser: Browser) -> None:
    """The page has asked this machine only, and could not ask another."""
    asked = "performance.getEntriesByType('resource').map(entry => entry.name).join(' ')"
    addresses = browser.ask("Runtime.evaluate", expression=asked)["result"]["value"].split()
    assert any("re_viewer" in address for address in addresses)
    assert [a for a in addresses if not a.startswith("http://127.0.0.1:")] == []
    tried = "fetch('https://example.com').then(() => 'gone out', error => 'refused')"
    answer = browser.ask("Runtime.evaluate", expression=tried, awaitPromise=True)
    assert answer["result"]["value"] == "refused"


@needs_browser
def test_the_page_in_a_browser(step: RecordedRun, tmp_path: Path) -> None:
    file = write_view(tmp_path / "view.rrd", step)

    def there(pixels: Pixels) -> bool:
        """Whether curves and ground are drawn on a light page: it loads for half a minute."""
        background = np.median(part(pixels, FORCES))
        curves = near(part(pixels, FORCES), LEFT) | near(part(pixels, FORCES), RIGHT)
        ground = near(part(pixels, SCENE), GROUND, 12)
        return bool(background > 200 and curves.sum() > 400 and ground.sum() > 2000)

    viewer = start_viewer("web", [file])
    try:
        # small, because each picture is drawn without a graphics card, in seconds
        with Browser(tmp_path / "profile", (1280, 834)) as browser:
            browser.open(viewer.page)
            preferred = [{"name": "prefers-color-scheme", "value": "light"}]
            browser.ask("Emulation.setEmulatedMedia", features=preferred)
            pixels = settled(lambda: pixels_of(browser.picture()), there, still=False)
            expect_no_calls_outside(browser)
    finally:
        viewer.stop()
    expect_zero_in_flight(pixels, step, flight_of(step))
    expect_legend_beside_curves(pixels)
    assert robot(part(pixels, SCENE)).sum() > 4000
