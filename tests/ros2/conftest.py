"""A router of Zenoh on the loopback, in place of ROS 2's."""

import json
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest


@pytest.fixture
def router() -> Iterator[tuple[str, Any]]:
    """Its endpoint, and a session in it."""
    import zenoh

    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{made.getsockname()[1]}"
    config = zenoh.Config()
    for key, value in {
        "mode": "router", "scouting/multicast/enabled": False, "scouting/gossip/enabled": False,
        "listen/endpoints": [endpoint],
    }.items():  # fmt: skip
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield endpoint, session


def wait_for(condition: Callable[[], Any], seconds: float = 20.0) -> Any:
    """Wait until something holds; gives it."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()
