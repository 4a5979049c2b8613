"""The benchmark of links measures round trips beside bare Zenoh, the cost of sending, and loss."""

import pytest

from aloft.lab.benchmarks.links.links import COUNT, graph, links


@pytest.mark.long
def test_rows() -> None:
    rows = {row.name: row for row in links(rounds=2, repetitions=5, ticks=100)}
    assert list(rows) == [
        "round trip through links", "sending a message", "sending one of ten messages",
        "sending one of ten messages to a frozen machine",
        "lost by ten links at 1 kHz", "from the last command to damping",
    ]  # fmt: skip
    trip = rows["round trip through links"]
    # how much longer is for ``aloft bench``: on a busy machine so few trips may take any time
    assert trip.peer == "bare Zenoh" and trip.ratio is not None and trip.ratio > 0.0
    for row in rows.values():
        assert row.value is not None and row.goal is not None
    lost = rows["lost by ten links at 1 kHz"]
    assert f"of {COUNT * 100} messages of 512 B came" in lost.note
    assert 15.0 <= (rows["from the last command to damping"].value or 0.0) < 10_000.0
    assert 0.0 <= (lost.value or 0.0) < COUNT * 100  # some came


def test_the_graph_has_ten_links_there_and_one_back() -> None:
    placed = graph((7450, 7451))
    assert [link.sender for link in placed.links].count("a") == COUNT
    assert [link.source for link in placed.links if link.sender == "b"] == ["reader0"]
