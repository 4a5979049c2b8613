"""The garbage collector is off while anybody needs it, and as before when all have ended."""

import gc
import threading

import pytest

from aloft.runtime.language.collector import collector_off, collector_paused


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
