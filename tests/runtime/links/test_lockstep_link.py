"""Mailboxes give each tick its item, whatever the order in which items come."""

import threading
import time

import pytest

from aloft.runtime.links.lockstep_link import Mailbox, MailTimeoutError


def test_items_that_come_early_are_kept_and_surplus_ones_counted() -> None:
    box: Mailbox[str] = Mailbox(lambda: None)
    for number, item in [(2, "c"), (0, "a"), (0, "again"), (2, "again"), (1, "b")]:
        box.put(number, item)
    assert [box.take(number, 1.0) for number in range(3)] == ["a", "b", "c"]
    assert box.surplus == 2


def test_a_reader_waits() -> None:
    box: Mailbox[int] = Mailbox(lambda: None)
    threading.Timer(0.1, box.put, (7, 42)).start()
    assert box.take(7, 5.0) == 42


def test_waiting_ends() -> None:
    box: Mailbox[int] = Mailbox(lambda: None)
    began = time.monotonic()
    with pytest.raises(MailTimeoutError):
        box.take(0, 0.2)
    assert 0.15 < time.monotonic() - began < 30.0


def test_a_check_ends_the_wait_but_not_before_what_has_come_is_looked_at() -> None:
    failed: list[bool] = []

    def check() -> None:
        if failed:
            raise RuntimeError("the other is gone")

    box: Mailbox[int] = Mailbox(check)
    failed.append(True)
    box.wake()
    box.put(0, 1)
    assert box.take(0, 5.0) == 1
    with pytest.raises(RuntimeError, match="the other is gone"):
        box.take(1, 5.0)
