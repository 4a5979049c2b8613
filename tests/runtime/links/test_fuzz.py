"""Bytes that nobody meant: they raise nothing on a thread of the network, and reach no block."""

import json
import random
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.runtime.links.peers import PeerStates
from aloft.runtime.placement.placed import split_over_machines
from aloft.runtime.running.executor import run
from aloft.runtime.testing.spread import run_spread
from aloft.runtime.transports.hub import Hub

from .example_graphs import ring

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=6,
)
KEYS = ("problem", "ended", "hashes", "heard",
        "graph", "schema")  # fmt: skip
BEACON = st.fixed_dictionaries(
    {"machine": st.sampled_from(["near", "far"]) | VALUES, "run": st.just("00" * 8) | VALUES,
     "phase": st.integers(0, 2) | VALUES, "clock": st.just([1, 0, 0]) | VALUES,
     "checked": st.just([]) | VALUES},
    optional=dict.fromkeys(KEYS, VALUES),
)  # fmt: skip


@pytest.mark.long
@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200) | BEACON.map(lambda state: json.dumps(state).encode()))
def test_no_beacon_raises(data: bytes) -> None:
    placed = split_over_machines(ring())
    peers = PeerStates(placed, "onboard", Hub().transport(), lambda: None)
    peers._on_beacon(data)
    peers._on_beacon(data)
    assert peers.names == ("near", "far")


def test_beacons_as_deep_as_a_parser_goes() -> None:
    peers = PeerStates(split_over_machines(ring()), "onboard", Hub().transport(), lambda: None)
    peers._on_beacon(b"[" * 100_000)
    peers._on_beacon(b'{"machine":"far","run":"' + b"00" * 8 + b'","phase":1e999,"checked":[]}')
    assert peers.run_of("far") is None


class Storm:
    """Puts before each message on any key a few that are changed, cut, repeated or random."""

    def __init__(self) -> None:
        self.rng = random.Random(7)
        self.sent = 0

    def __call__(self, key: str, data: bytes) -> Iterator[bytes]:
        rng = self.rng
        for _ in range(rng.randrange(3)):
            self.sent += 1
            yield self._spoilt(data)
        yield data

    def _spoilt(self, data: bytes) -> bytes:
        rng = self.rng
        kind = rng.randrange(4)
        if kind == 0:
            return rng.randbytes(rng.randrange(len(data) + 20))
        if kind == 1:
            return data[: rng.randrange(len(data))]
        changed = bytearray(data)
        changed[0] ^= 1 << rng.randrange(8)  # the checksum, the run, or a beacon's brace
        return bytes(changed) if kind == 2 else bytes(changed) + rng.randbytes(5)


def test_a_run_in_a_storm_of_bytes_gives_the_bytes_of_one_process() -> None:
    graph = ring(ticks=40)
    storm = Storm()
    spread = run_spread(graph, interfere=storm, timeout=60.0)
    for machine, result in spread.results.items():
        assert result.success, (machine, result.reason)
    assert storm.sent > 200
    assert spread.run_hash == run(graph).run_hash
    damaged: Any = [box.damaged for part in spread.parts.values() for box in part.receivers]
    assert sum(damaged) > 20
