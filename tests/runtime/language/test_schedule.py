"""The order of execution: ties, Moore blocks, rings reported whole, phases of several rates."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.schedule import (
    LoopError,
    ScheduleBlock,
    find_loops,
    hyperperiod,
    order_blocks,
    phases,
    runs_at,
)


def blocks(text: str) -> list[ScheduleBlock]:
    """Blocks from lines ``name [moore]: source, source``; input i is called ``u<i>``."""
    result = []
    for line in text.strip().splitlines():
        head, _, sources = line.strip().partition(":")
        name, *kind = head.split()
        names = [source.strip() for source in sources.split(",") if source.strip()]
        wires = {f"u{i}": f"{source}.y" for i, source in enumerate(names)}
        result.append(ScheduleBlock(name, kind == ["moore"], wires))
    return result


def test_sources_come_first_and_ties_follow_the_file() -> None:
    graph = blocks("d: b, c\n c: a\n b: a\n z:\n a:")
    assert order_blocks(graph) == ("z", "a", "c", "b", "d")


def test_moore_blocks_come_first_and_break_loops() -> None:
    graph = blocks("pd: robot\n robot moore: pd\n source:\n clock moore:")
    assert order_blocks(graph) == ("robot", "clock", "pd", "source")


def test_a_ring_is_reported_as_ports_from_its_first_block() -> None:
    graph = blocks("x:\n a: b\n b: a")
    with pytest.raises(LoopError) as caught:
        order_blocks(graph)
    assert [str(loop) for loop in caught.value.loops] == ["a.y -> b.u0 -> b.y -> a.u0"]
    assert caught.value.loops[0].blocks == ("a", "b")
    assert str(caught.value) == (
        "loop without a delay: a.y -> b.u0 -> b.y -> a.u0. Give one wire of each ring "
        "'delay: 1', or put a block with state between, such as blocks.UnitDelay"
    )


def test_a_block_wired_to_itself_is_a_ring() -> None:
    assert [str(loop) for loop in find_loops(blocks("a: a"))] == ["a.y -> a.u0"]


def test_all_rings_are_reported() -> None:
    graph = blocks("a: c\n b: a\n c: b, d\n d: c\n e: f\n f: e\n g: f")
    assert [str(loop) for loop in find_loops(graph)] == [
        "a.y -> b.u0 -> b.y -> c.u0 -> c.y -> a.u0",
        "c.y -> d.u0 -> d.y -> c.u1",
        "e.y -> f.u0 -> f.y -> e.u0",
    ]


def test_what_leads_into_a_loop_or_out_of_it_is_no_part_of_it() -> None:
    graph = blocks("in0:\n in1: in0\n a: in1, b\n b: a\n out0: b\n out1: out0, in0")
    assert [str(loop) for loop in find_loops(graph)] == ["a.y -> b.u0 -> b.y -> a.u1"]


def test_no_loops_where_there_are_none() -> None:
    assert find_loops(blocks("a:\n b: a\n c: a, b")) == ()


@given(st.data())
def test_random_graphs_are_ordered_or_have_a_ring(data: st.DataObject) -> None:
    count = data.draw(st.integers(1, 8))
    graph = [
        ScheduleBlock(
            f"b{i}",
            data.draw(st.booleans()),
            {
                f"u{k}": f"b{source}.y"
                for k, source in enumerate(data.draw(st.lists(st.integers(0, count - 1))))
            },
        )
        for i in range(count)
    ]
    moore = {block.path for block in graph if block.is_moore}
    try:
        order = order_blocks(graph)
    except LoopError as error:
        for loop in error.loops:
            assert not moore & set(loop.blocks)
            inputs = {f"{b.path}.{n}": source for b in graph for n, source in b.sources.items()}
            assert all(
                inputs[loop.ports[i + 1]] == loop.ports[i] for i in range(0, len(loop.ports), 2)
            )
        return
    assert sorted(order) == sorted(block.path for block in graph)
    assert find_loops(graph) == ()
    for block in graph:
        if not block.is_moore:
            for source in block.sources.values():
                assert order.index(source[:-2]) < order.index(block.path)


def test_phases_of_several_rates() -> None:
    table = phases([(1, 0), (2, 0), (3, 1)])
    assert table == ((0, 1), (0, 2), (0, 1), (0,), (0, 1, 2), (0,))
    assert table[0] is table[2]


def test_offsets() -> None:
    assert [runs_at(tick, 3, 2) for tick in range(6)] == [False, False, True, False, False, True]


def test_a_hyperperiod_out_of_reason_is_an_error() -> None:
    assert hyperperiod([2, 3, 10]) == 30
    with pytest.raises(AloftError, match="periods of 997, 1009, 1013 ticks repeat only after"):
        hyperperiod([1009, 997, 1013, 997])
