"""Runs the Rerun viewer as a process: in a window, in a browser, or without a screen for tests.

It listens on free ports of 127.0.0.1 only.
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
    """

    kind: ViewerKind
    process: subprocess.Popen[bytes]
    port: int
    web_port: int | None = None

    @property
    def source(self) -> str:
        """The address to which a stream is sent."""
        return f"rerun+http://{ADDRESS}:{self.port}/proxy"

    @property
    def page(self) -> str:
        """The address to open in a browser."""
        source = f"rerun%2Bhttp://{ADDRESS}:{self.port}/proxy"
        return f"http://{ADDRESS}:{self.web_port}/?url={source}&renderer=webgl"

    def lives(self) -> bool:
        """Whether the viewer is running."""
        return self.process.poll() is None

    def wait(self) -> int:
        """Wait until the viewer ends, and return its exit code."""
        return self.process.wait()

    def stop(self) -> None:
        """End the viewer."""
        self.process.terminate()
        try:
            self.process.wait(STOP_TIME)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


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
    port, web_port = free_ports(2)
    command = [str(program), "--bind", ADDRESS, "--port", str(port)]
    if kind == "web":
        command += ["--serve-web", "--web-viewer-port", str(web_port)]
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
            env={**os.environ, "RUST_LOG": "warn", "NO_COLOR": "1"},
        )
        viewer = Viewer(kind, process, port, web_port if kind == "web" else None)
        try:
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
        while not _listens(port):
            if not viewer.lives():
                raise ViewerError(f"it ended with code {viewer.process.returncode}")
            if time.monotonic() > end:
                raise ViewerError(f"it did not listen within {START_TIME:g} s")
            time.sleep(0.05)
    if viewer.kind == "window":
        time.sleep(0.5)  # it listens before it opens its window, which may end it
        if not viewer.lives():
            raise ViewerError(f"it ended with code {viewer.process.returncode}")


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
    """Ports of this machine on which nothing listens at the moment."""
    sockets = [socket.socket() for _ in range(count)]
    try:
        for one in sockets:
            one.bind((ADDRESS, 0))
        return [int(one.getsockname()[1]) for one in sockets]
    finally:
        for one in sockets:
            one.close()


def find_program() -> Path:
    """The path of the viewer's own program.

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
