"""The viewer itself, with a real recording: without a screen, and in a real browser."""

import os
import subprocess
import time
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

from aloft import load
from aloft.logs.file.reader import read
from aloft.logs.recording.drawn_run import write_comparison
from aloft.logs.recording.recorder import Recorder
from aloft.logs.viewing.page_server import OUTSIDE, policy
from aloft.logs.viewing.viewer import ViewerError, find_program, free_ports, start_viewer

from .pixels import TIMEOUT, needs_vulkan, wait_until_shown

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("viewer") / "jump.rrd"
    graph = load(ROOT / "graphs" / "jump.yaml", ["duration=0.2 s"])
    assert graph.run(sinks=[Recorder(path)], log=False).ticks == 100
    return path


@pytest.mark.long
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
        end = time.monotonic() + TIMEOUT
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
    state = wait_until_shown(client, (ticks - 1) / 500)
    names = {str(view.name) for view in state.views}
    assert {"Robot", "States", "Events", "Block times"} <= names
    assert any(name.startswith("base [m], world · ") for name in names)
    reports = [(view.name, report) for view in state.views for report in view.reports]
    assert reports == []


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
    assert not viewer.is_alive()


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
