"""Runs the Rerun viewer as a process: in a window, in a browser, or without a screen for tests.

It listens on free ports of 127.0.0.1 only. Neither it nor the server of its page is a
``ChildProcess``: they may outlive this process, and the viewer is not Python.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import Literal

from ...runtime.language.errors import AloftError

ADDRESS = "127.0.0.1"
SILENT = {"CI": "1"}
"""Environment of Rerun's program that stops its usage statistics: it takes itself to be in a test.
Its own switch, ``rerun analytics disable``, is a setting of the user's."""
START_TIME = 60.0
"""Seconds the viewer may take until it listens."""
STOP_TIME = 5.0

ViewerKind = Literal["window", "web", "headless"]


class ViewerError(AloftError):
    """Raised if there is no viewer or if it ended at once. The message says what to do."""


@dataclass
class Viewer:
    """A running viewer.

    Attributes:
        kind: whether it is a window, a page in a browser, or without a screen.
        process: its process.
        port: the port on which it receives data.
        web_port: the port of its page, for a viewer in a browser.
        page_server: the process that serves the page; see ``page_server``.
    """

    kind: ViewerKind
    process: subprocess.Popen[bytes]
    port: int
    web_port: int | None = None
    page_server: subprocess.Popen[bytes] | None = None

    @property
    def source(self) -> str:
        """The address to which a stream is sent."""
        return f"rerun+http://{ADDRESS}:{self.port}/proxy"

    @property
    def page(self) -> str:
        """The address to open in a browser."""
        source = f"rerun%2Bhttp://{ADDRESS}:{self.port}/proxy"
        return f"http://{ADDRESS}:{self.web_port}/?url={source}&renderer=webgl"

    def is_alive(self) -> bool:
        """Tell whether the viewer is running."""
        return self.process.poll() is None

    def wait(self) -> int:
        """Wait until the viewer ends, and return its exit code."""
        return self.process.wait()

    def stop(self) -> None:
        """End the viewer."""
        for process in filter(None, (self.page_server, self.process)):
            process.terminate()
            try:
                process.wait(STOP_TIME)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def start_viewer(
    kind: ViewerKind, files: Sequence[str | PathLike[str]] = (), *, size: str = "1600x900"
) -> Viewer:
    """Start a viewer, with ``files`` or empty, and wait until it listens.

    Raises:
        ViewerError: Rerun is not installed, or the viewer ended at once.
    """
    program = find_program()
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
    if kind == "window" and sys.platform == "linux" and not any(map(os.environ.get, screens)):
        raise ViewerError(_explained(kind, "there is no screen", b""))
    port, inner_port, web_port = free_ports(3)
    command = [str(program), "--bind", ADDRESS, "--port", str(port)]
    if kind == "web":
        command += ["--serve-web", "--web-viewer-port", str(inner_port)]
    else:
        command += ["--window-size", size, "--hide-welcome-screen"]
    if kind == "headless":
        command.append("--headless")
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            [*command, *(str(Path(file).absolute()) for file in files)],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            # not ended by a Ctrl-C that means the run
            start_new_session=True,
            env={**os.environ, "RUST_LOG": "warn", "NO_COLOR": "1", **SILENT},
        )
        viewer = Viewer(kind, process, port)
        try:
            if kind == "web":
                viewer.web_port = web_port
                viewer.page_server = _serve_page(web_port, inner_port, port)
                _wait_for(viewer, inner_port, time.monotonic() + START_TIME)
            _wait_until_it_listens(viewer)
        except ViewerError as error:
            viewer.stop()
            output.seek(0)
            raise ViewerError(_explained(kind, str(error), output.read())) from None
        except BaseException:
            viewer.stop()
            raise
    return viewer


def _wait_until_it_listens(viewer: Viewer) -> None:
    end = time.monotonic() + START_TIME
    for port in filter(None, (viewer.port, viewer.web_port)):
        _wait_for(viewer, port, end)
    if viewer.kind == "window":
        time.sleep(0.5)  # it listens before it opens its window, which may end it
        if not viewer.is_alive():
            raise ViewerError(f"it ended with code {viewer.process.returncode}")


def _wait_for(viewer: Viewer, port: int, end: float) -> None:
    """Wait until the viewer listens on a port, at most until the instant ``end``."""
    while not _listens(port):
        if not viewer.is_alive():
            raise ViewerError(f"it ended with code {viewer.process.returncode}")
        if time.monotonic() > end:
            raise ViewerError(f"it did not listen within {START_TIME:g} s")
        time.sleep(0.05)


def _serve_page(port: int, inner_port: int, data_port: int) -> subprocess.Popen[bytes]:
    """Start the process that hands on Rerun's page without what calls other machines."""
    program = Path(__file__).with_name("page_server.py")
    return subprocess.Popen(
        [sys.executable, "-I", str(program), str(port), str(inner_port), str(data_port)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _explained(kind: ViewerKind, what: str, output: bytes) -> str:
    lines = [line.strip() for line in output.decode(errors="replace").splitlines() if line.strip()]
    said = f" ({lines[-1]})" if lines else ""
    hint = (
        "; without a screen, use the viewer in a browser: --web, or --rerun web"
        if kind == "window"
        else ""
    )
    return f"the Rerun viewer cannot be shown: {what}{said}{hint}"


def _listens(port: int) -> bool:
    with suppress(OSError), socket.create_connection((ADDRESS, port), 0.2):
        return True
    return False


def free_ports(count: int) -> list[int]:
    """Find ports of this machine on which nothing listens at the moment."""
    sockets = [socket.socket() for _ in range(count)]
    try:
        for one in sockets:
            one.bind((ADDRESS, 0))
        return [int(one.getsockname()[1]) for one in sockets]
    finally:
        for one in sockets:
            one.close()


def find_program() -> Path:
    """Find the path of the viewer's own program.

    It is not the script that starts it: stopping the script would leave the viewer running.

    Raises:
        ViewerError: Rerun is not installed.
    """
    spec = find_spec("rerun_cli")
    for folder in spec.submodule_search_locations or () if spec is not None else ():
        for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
            if (program := Path(folder) / name).is_file():
                return program
    raise ViewerError("the Rerun viewer is not installed; pip install rerun-sdk")
