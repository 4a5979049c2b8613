"""Chromium without a screen, driven through the pipe of its developer tools."""

import base64
import json
import os
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from shutil import which
from typing import Any, Self

PROGRAM = which("chromium") or which("chromium-browser") or which("google-chrome")
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-dev-shm-usage",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", "--remote-debugging-pipe",
)  # fmt: skip
LOADING = 60.0
"""Seconds that the document of a page may take."""


class Browser:
    """One page; its messages are JSON that end with a zero byte, on descriptors 3 and 4."""

    def __init__(self, folder: Path, size: tuple[int, int]) -> None:
        assert PROGRAM is not None
        their_input, self._out = os.pipe()
        self._in, their_output = os.pipe()
        command = f'exec "$@" 3<&{their_input} 4>&{their_output}'
        self._process = subprocess.Popen(
            ["bash", "-c", command, "bash", PROGRAM, *FLAGS, f"--user-data-dir={folder}",
             f"--window-size={size[0]},{size[1]}", "about:blank"],
            pass_fds=[their_input, their_output],
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        os.close(their_input)
        os.close(their_output)
        self._number, self._buffer, self._session = 0, b"", ""
        pages = self.ask("Target.getTargets")["targetInfos"]
        page = next(p["targetId"] for p in pages if p["type"] == "page")
        attached = self.ask("Target.attachToTarget", targetId=page, flatten=True)
        self._session = attached["sessionId"]

    def ask(self, method: str, **params: Any) -> Any:
        """Send one command and wait for its answer."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self._buffer:
                part = os.read(self._in, 1 << 20)
                if not part:
                    raise RuntimeError("Chromium has ended")
                self._buffer += part
            line, _, self._buffer = self._buffer.partition(b"\0")
            answer = json.loads(line)
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def open(self, page: str) -> None:
        """Go to a page, and wait until its document is there."""
        self.ask("Page.navigate", url=page)
        end = time.monotonic() + LOADING
        while time.monotonic() < end:
            with suppress(RuntimeError):  # between two pages there is none to ask
                answer = self.ask("Runtime.evaluate", expression="document.readyState")
                if answer["result"]["value"] == "complete":
                    return
            time.sleep(0.2)
        raise RuntimeError(f"{page} is not there after {LOADING:g} s")

    def picture(self) -> bytes:
        """What the page looks like now, as PNG."""
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._in)
        os.close(self._out)
