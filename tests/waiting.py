"""What tests of several processes and threads share: waiting, and a free port."""

import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


def wait_for(condition: Callable[[], Any], seconds: float = 60.0) -> Any:
    """Wait until something holds, for so long at most; gives it."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


def is_gone(pid: int, seconds: float = 60.0) -> bool:
    """Whether a process ends within that time; one that nobody waited for counts as ended."""

    def ended() -> bool:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return True
        return state == "Z"

    return bool(wait_for(ended, seconds))


def free_port() -> int:
    """A port of the loopback that nothing listens at just now."""
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        return int(made.getsockname()[1])
