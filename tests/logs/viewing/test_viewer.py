"""The viewer itself, with a real recording: without a screen, and in a real browser."""

import os
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from aloft import load
from aloft.logs.file.reader import read
from aloft.logs.recording.comparison import write_comparison
from aloft.logs.recording.recorder import Recorder
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
    finally:
        viewer.stop()


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
