"""What came from another machine, in words: closed connections and silence are told apart, with what was measured."""

import pytest

from aloft.runtime.links import traffic as module
from aloft.runtime.links.message import HEADER
from aloft.runtime.links.traffic import Traffic
from aloft.runtime.placement.placed import split_over_machines

from .example_graphs import ring


class SetClock:
    def __init__(self) -> None:
        self.time = 100.0

    def monotonic(self) -> float:
        return self.time


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> SetClock:
    made = SetClock()
    monkeypatch.setattr(module, "time", made)
    return made


def test_a_closed_connection_is_no_silence(now: SetClock) -> None:
    placed = split_over_machines(ring())
    found = Traffic(placed, "near", "far")
    assert found.measured(-1.0) == "nothing has come of it" and found.silence() == 0.0
    found.add(500)
    now.time += 2.0
    found.add(1500)
    now.time += 0.01
    assert found.why_gone().startswith("its process ended, or closed the connection, 0.01 s after")
    now.time += 3.1
    text = found.why_gone()
    assert "its process froze, or the network to it is cut or too slow" in text
    assert "nothing came of it for 3.11 s, and links.lease is 3 s" in text


def test_what_was_measured_stands_beside_what_a_tick_needs(now: SetClock) -> None:
    placed = split_over_machines(ring())
    found = Traffic(placed, "near", "far")
    (link,) = [x for x in placed.sent_by("near") if x.receiver == "far"]
    needed = link.payload + HEADER
    found.add(1000)
    now.time += 0.5
    found.add(1000)
    assert found.measured(0.0123).startswith(
        "2 messages came in 0.5 s, 4 kB/s, with a round trip of 12.3 ms at best; "
        f"a tick needs {needed} B of it, "
    )
