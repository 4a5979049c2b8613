"""What a part sends of itself is what its window showed, and bytes that nobody meant are refused."""

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest

from aloft.runtime.live.part_feed import _HEAD, PartFeed, packed, read_part
from aloft.runtime.live.window import digest
from aloft.runtime.loading import checked_file
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.transports.transport import window_key


class Kept:
    """A transport that keeps what is shown."""

    def __init__(self) -> None:
        self.is_open = False
        self.keys: list[str] = []
        self.messages: list[bytes] = []

        self.farewells: list[Callable[[], None]] = []

    def background_publisher(self, key: str) -> Any:
        self.keys.append(key)
        return self.messages.append

    def before_close(self, call: Callable[[], None]) -> None:
        self.farewells.append(call)


def wait_until(holds: Any) -> None:
    end = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.fixture
def messages(graph_file: Path) -> tuple[BoundGraph, Kept]:
    """What a run sends that is told to end."""
    bound, transport = BoundGraph(checked_file(graph_file)), Kept()
    sender: Any = transport

    class Disconnecting(PartFeed):
        """Its transport closes when the run has ended, as that of a part does."""

        def close(self) -> None:
            for call in transport.farewells:
                call()
            super().close()

    executor = Executor(bound, log=False, plain=True, sinks=[Disconnecting("near", sender)])
    thread = threading.Thread(target=executor.run)
    thread.start()
    transport.is_open = True  # as once the links are there
    wait_until(lambda: len(transport.messages) > 2)
    bound.clock.stop_reason = "enough"
    thread.join(60.0)
    assert not thread.is_alive()
    return bound, transport


def test_a_message_says_what_the_part_shows_and_the_last_why_it_ends(
    messages: tuple[BoundGraph, Kept],
) -> None:
    bound, transport = messages
    assert transport.keys == [window_key("near")] == ["watch/near/window"]
    looks = [read_part(message) for message in transport.messages]
    first, last = looks[0], looks[-1]
    assert first is not None and last is not None
    assert first.digest == digest(bound.memory.bus.layout, bound.graph)
    assert (first.ended, last.ended) == (None, "enough")
    assert last.look.tick >= first.look.tick and last.look.bus.size == bound.memory.bus.layout.size
    assert first.shape.blocks == ["wave", "inner/twice", "pid"]
    (stamps,) = last.look.stamps
    assert len(stamps) and (np.diff(stamps, axis=1) >= 0).all()


def test_bytes_that_nobody_meant(messages: tuple[BoundGraph, Kept]) -> None:
    message = messages[1].messages[0]
    rng = np.random.default_rng(1)
    for size in (0, 3, 8, 200):
        assert read_part(rng.bytes(size)) is None
    assert read_part(message[:-1]) is None and read_part(message + b" ") is None
    for place in rng.integers(len(message), size=50):
        damaged = bytearray(message)
        damaged[place] ^= 1
        assert read_part(bytes(damaged)) is None
    for said in (b"", b"[" * 100_000, b"{}", b'{"shape": {}}', b'{"shape": 3, "digest": ""}'):
        assert read_part(_HEAD.pack(crc32(said), len(said)) + said) is None
    # whole, but not what it says it is
    length = _HEAD.unpack_from(message)[1]
    about, copy = json.loads(message[8 : 8 + length]), message[8 + length :]
    assert read_part(packed(about, copy)) is not None
    for wrong in (
        {"bus": about["shape"]["bus"] + 8},
        {"blocks": 7},
        {"programs": [["a"] * 10**6]},
        {"orders": [[99]]},
    ):
        assert read_part(packed({**about, "shape": {**about["shape"], **wrong}}, copy)) is None


def test_a_transport_that_fails_hinders_nothing(graph_file: Path) -> None:
    class Broken(Kept):
        def background_publisher(self, key: str) -> Any:
            self.keys.append(key)
            raise OSError("no network")

    broken = Broken()
    broken.is_open = True
    sender: Any = broken
    bound = BoundGraph(checked_file(graph_file))
    result = Executor(bound, log=False, plain=True, sinks=[PartFeed("near", sender)]).run(100)
    assert result.success and result.warnings == () and broken.keys
