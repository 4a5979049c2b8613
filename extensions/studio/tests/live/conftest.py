"""The page of a graph that runs in real time."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from tests.runtime.live.conftest import Running, graph_file, running, socket_path

from aloft.extensions.studio.live.live_run import LiveRun
from aloft.extensions.studio.live.live_server import LiveServer

__all__ = ["graph_file", "running", "socket_path"]


@contextmanager
def serving(live: LiveRun, save: Path) -> Iterator[LiveServer]:
    """The page of a graph that runs, served in a thread."""
    made = LiveServer(live, save)
    threading.Thread(target=made.serve_forever, args=(0.02,), daemon=True).start()
    yield made
    made.shutdown()
    made.server_close()


@pytest.fixture
def live(running: Running) -> Iterator[LiveRun]:
    run = LiveRun(running.path)
    yield run
    run.close()


@pytest.fixture
def server(live: LiveRun, tmp_path: Path) -> Iterator[LiveServer]:
    """The page of the graph that runs, served in a thread."""
    with serving(live, tmp_path / "waves-tuned.yaml") as made:
        yield made
