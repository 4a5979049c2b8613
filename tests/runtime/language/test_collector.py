"""The garbage collector is off while anybody needs it, and as before when all have ended."""

import gc
import threading
import weakref
from collections.abc import Iterator

import pytest

import aloft
from aloft.runtime.language import collector
from aloft.runtime.language.collector import collector_off, collector_paused, objects_frozen
from aloft.runtime.loading.checking import check_graph


def test_threads_that_end_in_any_order_leave_the_collector_on() -> None:
    first_is_in, second_is_in, first_is_out = (threading.Event() for _ in range(3))
    seen = []

    def second() -> None:
        assert first_is_in.wait(60.0)
        with collector_off():
            second_is_in.set()
            assert first_is_out.wait(60.0)
            seen.append(gc.isenabled())

    assert gc.isenabled()
    thread = threading.Thread(target=second)
    thread.start()
    with collector_paused():
        first_is_in.set()
        assert second_is_in.wait(60.0) and not gc.isenabled()
    first_is_out.set()
    thread.join(60.0)
    assert seen == [False], "one that has ended does not switch it on for the other"
    assert gc.isenabled()


def test_what_was_off_stays_off() -> None:
    gc.disable()
    try:
        with collector_paused(), collector_off():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_an_error_switches_it_on_again() -> None:
    with pytest.raises(ValueError, match="wrong"), collector_paused():
        raise ValueError("wrong")
    assert gc.isenabled()


@pytest.fixture
def nothing_frozen(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(collector, "_frozen_elsewhere", False)
    gc.unfreeze()
    yield
    gc.freeze()  # as tests/conftest.py leaves it


def test_objects_are_frozen_until_the_last_one_has_ended(nothing_frozen: None) -> None:
    first, second = objects_frozen(), objects_frozen()
    with first:
        second.__enter__()
        with collector_paused():
            pass
        assert gc.get_freeze_count() > 0
    assert gc.get_freeze_count() > 0
    second.__exit__(None, None, None)
    assert gc.get_freeze_count() == 0


def test_what_others_froze_stays_frozen_and_is_counted_once(
    nothing_frozen: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    gc.freeze()
    frozen, counted = gc.get_freeze_count(), []
    count = gc.get_freeze_count
    monkeypatch.setattr(gc, "get_freeze_count", lambda: counted.append(None) or count())
    for _ in range(3):
        with collector_paused(), objects_frozen():
            made = [[] for _ in range(1000)]
    assert len(made) == 1000 and len(counted) == 1
    assert 0.999 * frozen <= count() <= frozen


def test_a_load_leaves_nothing_to_collect() -> None:
    # Not at its end, and not when the graph is given up: else each load of thousands of blocks adds to memory.
    blocks = [f"  g{k}: {{use: blocks.Gain, in: {{u: g{k - 1}.y}}}}" for k in range(1, 9)]
    text = "\n".join(["rate: 100 Hz", "blocks:", "  g0: {use: blocks.SineWave}", *blocks])
    aloft.load(text)  # what is made once
    gc.collect()
    with collector_off():
        graph = aloft.load(text)
        known = [weakref.ref(block) for block in graph.checked.flat.blocks]
        drafts = [o for o in gc.get_objects() if type(o).__module__ == check_graph.__name__]
        assert len(known) == 9 and drafts == []
        del graph
        assert [ref() for ref in known] == [None] * 9
