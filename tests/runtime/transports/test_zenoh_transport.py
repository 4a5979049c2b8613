"""Messages over Zenoh on the loopback; nothing is searched for and nothing is left to defaults."""

import json
import socket
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.stages import LEASE, MachineSpec
from aloft.runtime.transports.zenoh_session import Limits, as_chunk, session_config
from aloft.runtime.transports.zenoh_transport import ZenohTransport

from ...waiting import free_port, wait_for


@pytest.fixture
def machines() -> tuple[MachineSpec, ...]:
    return tuple(MachineSpec(name, f"tcp/127.0.0.1:{free_port()}") for name in ("a", "b"))


Pair = tuple[ZenohTransport, ZenohTransport, list[str]]


@pytest.fixture
def pair(machines: tuple[MachineSpec, ...]) -> Iterator[Pair]:
    """Two open transports, and the machines that the first has lost."""
    lost: list[str] = []
    first, second = ZenohTransport("test", machines), ZenohTransport("test", machines)
    try:
        second.open("b", lambda name: None)  # the one that connects may be there first
        first.open("a", lost.append)
        yield first, second, lost
    finally:
        first.close()
        second.close()


def test_messages_arrive_in_order(pair: Pair) -> None:
    first, second, _ = pair
    heard: list[bytes] = []
    second.subscribe("data/a/b/left/gain~delay", heard.append)
    send = first.publisher("data/a/b/left/gain~delay")
    assert wait_for(lambda: send(b"probe") or bool(heard))
    for k in range(500):
        send(k.to_bytes(4, "little") * 50)

    def numbered() -> list[bytes]:
        """Without the probes, some of which may still have been on their way."""
        return [data for data in heard if data != b"probe"]

    assert wait_for(lambda: len(numbered()) == 500)
    assert [int.from_bytes(data[:4], "little") for data in numbered()] == list(range(500))


def test_a_machine_that_closes_is_lost_at_once(pair: Pair) -> None:
    first, second, lost = pair
    heard: list[bytes] = []
    first.subscribe("x", heard.append)
    send = second.publisher("x")
    assert wait_for(lambda: send(b"there") or bool(heard))
    assert lost == []
    second.close()
    assert wait_for(lambda: lost == ["b"])


def test_an_endpoint_that_is_taken(machines: tuple[MachineSpec, ...]) -> None:
    port = int(machines[0].endpoint.rpartition(":")[2])
    transport = ZenohTransport("test", machines)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", port))
        taken.listen()
        with pytest.raises(AloftError) as caught:
            transport.open("a", lambda name: None)
    transport.close()
    assert f"machine 'a' cannot listen at tcp/127.0.0.1:{port}" in str(caught.value)
    assert "--set machines.a=" in str(caught.value)


def test_the_configuration_searches_for_nobody() -> None:
    config = session_config(["tcp/127.0.0.1:7450"], ["tcp/127.0.0.1:7451"])

    def get(key: str) -> object:
        return json.loads(config.get_json(key))

    assert get("scouting/multicast/enabled") is False
    assert get("scouting/gossip/enabled") is False
    assert get("listen/endpoints") == ["tcp/127.0.0.1:7450"]
    assert get("connect/endpoints") == ["tcp/127.0.0.1:7451"]
    assert get("transport/link/tx/lease") == 1e3 * LEASE
    config = session_config([], [], limits=Limits(lease=0.25, patience=7.0, largest=1_000_000))
    assert get("transport/link/tx/lease") == 250
    control = "transport/link/tx/queue/congestion_control"
    assert get(f"{control}/block/wait_before_close") == 7_000_000
    assert get(f"{control}/drop/max_wait_before_drop_fragments") == 1000
    assert get("transport/link/tx/queue/size/real_time") == 16
    assert [Limits(largest=size).batches for size in (0, 512, 65_000, 300_000)] == [2, 2, 3, 6]
    assert get("transport/shared_memory/enabled") is False


def test_congestion_express_and_priority_of_each_link_are_said(
    machines: tuple[MachineSpec, ...],
) -> None:
    """Lockstep waits and sends at once, free links drop, and what is shown never delays a link."""

    class Session:
        def declare_publisher(self, key: str, **settings: Any) -> Any:
            self.settings = settings
            return SimpleNamespace(put=lambda data: None)

    block, drop = zenoh.CongestionControl.BLOCK, zenoh.CongestionControl.DROP
    for wait in (True, False):
        transport = ZenohTransport("test", machines, wait=wait)
        transport._session = session = Session()
        transport.publisher("data/a/b/x")
        assert session.settings == {
            "congestion_control": block if wait else drop, "express": wait,
            "priority": zenoh.Priority.REAL_TIME, "reliability": zenoh.Reliability.RELIABLE,
        }  # fmt: skip
        transport.background_publisher("watch/a")
        assert session.settings == {
            "congestion_control": drop, "express": False,
            "priority": zenoh.Priority.BACKGROUND, "reliability": zenoh.Reliability.BEST_EFFORT,
        }  # fmt: skip


def test_no_thread_of_ours_is_left(pair: Pair) -> None:
    first, second, _ = pair
    before = threading.active_count()
    first.subscribe("y", lambda data: None)
    second.publisher("y")(b"1")
    assert threading.active_count() == before


@pytest.mark.parametrize(
    ("name", "chunk"), [("left/gain~to~b", "left/gain~to~b"), ("a*b?c#d$e f", "a_b_c_d_e_f")]
)
def test_names_in_keys(name: str, chunk: str) -> None:
    assert as_chunk(name) == chunk
