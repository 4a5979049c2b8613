"""The viewer itself, with a real recording: without a screen, and in a real browser."""

import os
import subprocess
import time
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import numpy as np
import pytest
from PIL import Image

from aloft import load
from aloft.logs.file.reader import read
from aloft.logs.recording.comparison import write_comparison
from aloft.logs.recording.recorder import Recorder
from aloft.logs.recording.whole_view import write_view
from aloft.logs.viewing.page_server import OUTSIDE, policy
from aloft.logs.viewing.viewer import ViewerError, find_program, free_ports, start_viewer

from .browser import PROGRAM, Browser

ROOT = Path(__file__).parents[3]
DRIVERS = [*Path("/usr/share/vulkan/icd.d").glob("lvp*"), *Path("/etc/vulkan/icd.d").glob("lvp*")]
PATIENCE = 180.0
"""Seconds that anything may take on a machine with much else to do."""

needs_vulkan = pytest.mark.skipif(
    not DRIVERS, reason="draws with software Vulkan; install Debian's mesa-vulkan-drivers"
)
needs_browser = pytest.mark.skipif(
    PROGRAM is None, reason="looks through a real browser; install Debian's chromium"
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("viewer") / "jump.rrd"
    graph = load(ROOT / "graphs" / "jump.yaml", ["duration=0.2 s"])
    assert graph.run(sinks=[Recorder(path)], log=False).ticks == 100
    return path


@needs_vulkan
def test_the_viewer_finds_no_fault(recording: Path, tmp_path: Path) -> None:
    from rerun.experimental import ViewerClient

    comparison = write_comparison(tmp_path / "both.rrd", read(recording), read(recording))
    viewer = start_viewer("headless", size="1200x800")
    try:
        client = ViewerClient.connect(viewer.source)
        # live, then from a file, then two runs in one
        graph = load(ROOT / "graphs" / "jump.yaml", ["duration=0.1 s"])
        result = graph.run(sinks=[Recorder(None, live=viewer.source)], log=False)
        assert result.warnings == ()
        for source, ticks in ((None, 50), (recording, 100), (comparison, 100)):
            if source is not None:
                client.open(str(source))
            check_views(client, ticks)
        picture = tmp_path / "viewer.png"
        end = time.monotonic() + PATIENCE
        while not picture.is_file() and time.monotonic() < end:
            try:
                client.save_screenshot(str(picture))
            except TimeoutError:  # the viewer itself waits a few seconds only
                continue
        assert picture.stat().st_size > 40_000  # an empty one has a tenth of that
    finally:
        viewer.stop()


def photograph(client: Any, instant: float, path: Path) -> Any:
    """The pixels of the viewer at an instant [s], (rows, columns, 3)."""
    client.set_time("t", duration=instant, play_state="paused")
    time.sleep(3.0)
    path.unlink(missing_ok=True)
    client.save_screenshot(str(path))
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


@pytest.mark.long
@needs_vulkan
@pytest.mark.parametrize("whole", [False, True], ids=["the file itself", "aloft view"])
def test_the_ground_is_drawn_and_forces_are_zero_in_flight(tmp_path: Path, whole: bool) -> None:
    """What a picture of a jump onto a step must show, counted in pixels of the colours drawn."""
    from rerun.experimental import ViewerClient

    recording, picture = tmp_path / "up.rrd", tmp_path / "up.png"
    graph = load(ROOT / "graphs" / "up_5cm.yaml")
    graph.run(sinks=[Recorder(recording)], log=False)
    run = read(recording)
    # 3.6 kB of numbers, and some pictures; this graph is not the jump but very like it
    assert recording.stat().st_size < 4200 * len(run.ticks)
    force = run["robot.truth.contact_force"]
    flight = np.flatnonzero(~(force != 0.0).any(axis=(1, 2)) & (run.time > 0.5))
    drawn = write_view(tmp_path / "view.rrd", run)
    viewer = start_viewer("headless", [drawn if whole else recording], size="1600x900")
    try:
        client = ViewerClient.connect(viewer.source)
        check_views(client, len(run.ticks))
        standing = photograph(client, 0.2, picture)
        pixels = photograph(client, float(run.time[flight].mean()), picture)
    finally:
        viewer.stop()
    scene, plots = pixels[60:530, :635], pixels[:, 645:]
    cones = near(standing[60:530, :635], (255, 183, 77), 30).sum()
    assert not whole or cones > 40, "friction cones under the feet, where all is drawn"
    assert near(scene, (141, 146, 153), 45).sum() > 2000, "the step is there"
    assert near(scene, (229, 57, 53), 40).sum() == 0, "no force arrow in flight"
    view = plots[365:590, 475:]  # the plot of the forces on the feet
    lines = near(view, (38, 198, 218), 40) | near(view, (255, 167, 38), 40)
    lines = lines[:, 25:]  # without the numbers of the axis
    rows = np.array([np.flatnonzero(column)[-1] if column.any() else -1 for column in lines.T])
    ends = run.time[flight[[0, -1]]] / run.time[-1] * len(rows)
    within = rows[int(ends[0]) + 6 : int(ends[1]) - 6]
    within = within[within >= 0]
    assert len(within) > 20 and np.ptp(within) <= 2, "the curve is flat in flight"
    assert within.max() >= rows.max() - 1, "and lies on zero, below everything else"


def near(pixels: Any, color: tuple[int, int, int], most: int) -> Any:
    """Which pixels differ from a colour by no more than ``most`` in each part."""
    return (np.abs(pixels - np.array(color)) <= most).all(axis=-1)


def check_views(client: Any, ticks: int) -> None:
    """Wait until a recording of so many ticks is shown; no view may have anything to report."""
    last = round((ticks - 1) / 500 * 1e9)
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        state = client.get_state()
        shown = [r for r in state.recordings if r.store_id == state.active_recording]
        ends = [line.end for r in shown for line in r.timelines if line.name == "t"]
        if state.views and not state.loading and ends and (ends[0] or 0) >= 0.9 * last:
            break
        time.sleep(0.2)
    else:
        pytest.fail(f"not shown within {PATIENCE:g} s: {state}")
    names = {str(view.name) for view in state.views}
    assert {"Robot", "States", "Events", "Block times"} <= names
    assert any(name.startswith("base [m], world · ") for name in names)
    reports = [(view.name, report) for view in state.views for report in view.reports]
    assert reports == []


@pytest.mark.long
@needs_browser
def test_a_browser_shows_the_recording(recording: Path, tmp_path: Path) -> None:
    viewer = start_viewer("web", [recording])
    try:
        with Browser(tmp_path / "profile", (1000, 700)) as browser:
            browser.open(viewer.page)
            end, picture = time.monotonic() + PATIENCE, b""
            while len(picture) < 60_000 and time.monotonic() < end:  # until then it is loading
                time.sleep(0.5)
                picture = browser.picture()
            (tmp_path / "page.png").write_bytes(picture)
            assert len(picture) >= 60_000, "the page shows nothing"
            asked = "performance.getEntriesByType('resource').map(entry => entry.name).join(' ')"
            answer = browser.ask("Runtime.evaluate", expression=asked)
            addresses = answer["result"]["value"].split()
            assert any("re_viewer" in address for address in addresses)
            outside = [a for a in addresses if not a.startswith("http://127.0.0.1:")]
            assert outside == [], "the page calls other machines"
            tried = "fetch('https://example.com').then(() => 'gone out', error => 'refused')"
            answer = browser.ask("Runtime.evaluate", expression=tried, awaitPromise=True)
            assert answer["result"]["value"] == "refused"
    finally:
        viewer.stop()


def test_the_page_has_no_links_to_other_machines() -> None:
    viewer = start_viewer("web")
    try:
        with urlopen(viewer.page) as answer:
            page, found = answer.read(), answer.headers["Content-Security-Policy"]
        assert b"<script" in page and not OUTSIDE.search(page)
        assert found == policy(viewer.port) and "https:" not in found
        environment = Path(f"/proc/{viewer.process.pid}/environ").read_bytes().split(b"\0")
        assert b"CI=1" in environment, "Rerun sends no usage statistics then"
        server = viewer.page_server
        assert server is not None and server.poll() is None
    finally:
        viewer.stop()
    assert server.poll() is not None


def test_the_viewer_listens_on_the_loopback_only() -> None:
    viewer = start_viewer("web")
    try:
        inodes = {
            os.readlink(entry)
            for entry in Path(f"/proc/{viewer.process.pid}/fd").iterdir()
            if entry.is_symlink()
        }
        addresses = set()
        for table in ("tcp", "tcp6"):
            for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
                fields = line.split()
                if fields[3] == "0A" and f"socket:[{fields[9]}]" in inodes:  # it listens
                    addresses.add(fields[1].partition(":")[0])
        assert addresses == {"0100007F"}  # 127.0.0.1
    finally:
        viewer.stop()
    assert not viewer.lives()


def test_a_window_without_a_screen_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ViewerError, match=r"cannot be shown.*use the viewer in a browser"):
        start_viewer("window")


def test_the_program_is_no_script() -> None:
    # stopping a script would leave the viewer behind
    assert find_program().read_bytes()[:2] != b"#!"
    assert subprocess.run([find_program(), "--version"], capture_output=True, check=True).stdout
    assert len(set(free_ports(3))) == 3
