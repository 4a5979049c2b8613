"""Another process that takes part in a measurement and is told by lines what to do."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any


class OtherProcess:
    """The near end of such a process, which reads lines and answers each by one line of JSON."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        assert process.stdin is not None and process.stdout is not None
        self._process = process
        self._said: IO[str] = process.stdin
        self._heard: IO[str] = process.stdout

    def ask(self, line: str) -> Any:
        """Say a line, and wait for what is answered."""
        self._said.write(f"{line}\n")
        self._said.flush()
        return json.loads(self._heard.readline())

    def freeze(self) -> None:
        """Stop the process where it is, as if its machine were gone."""
        self._process.send_signal(signal.SIGSTOP)


@contextmanager
def other_process(code: str) -> Iterator[OtherProcess]:
    """A process that runs Python code, and is killed in the end."""
    command = [sys.executable, "-c", code]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield OtherProcess(process)
        finally:
            process.kill()
