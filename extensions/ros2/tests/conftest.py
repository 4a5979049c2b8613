"""A router of Zenoh on the loopback, in place of ROS 2's."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
from tests.waiting import free_port


@pytest.fixture
def router() -> Iterator[tuple[str, Any]]:
    """Its endpoint, and a session in it."""
    import zenoh

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = zenoh.Config()
    for key, value in {
        "mode": "router", "scouting/multicast/enabled": False, "scouting/gossip/enabled": False,
        "listen/endpoints": [endpoint],
    }.items():  # fmt: skip
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield endpoint, session
