"""A part's clock keeps the first wish to end, and ends only when all parts have agreed."""

from aloft.runtime.links.coordinator import PartClock


def test_a_wish_alone_does_not_end_the_run() -> None:
    clock = PartClock(0.01)
    assert (clock.stop_reason, clock.stopped_by, clock.stop_request) == (None, "", None)
    clock.stop_reason = "balanced"
    clock.stopped_by = "controller"
    assert (clock.stop_reason, clock.stopped_by) == (None, "")
    assert clock.stop_request == ("balanced", "controller")
    clock.agree("it fell", "score")
    assert (clock.stop_reason, clock.stopped_by) == ("it fell", "score")


def test_the_first_wish_is_kept_with_its_block() -> None:
    clock = PartClock(0.01)
    clock.stop_reason = "stopped by SIGINT"
    clock.stop_reason = "balanced"
    clock.stopped_by = "controller"
    assert clock.stop_request == ("stopped by SIGINT", "")


def test_a_restored_graph_begins_anew() -> None:
    clock = PartClock(0.01)
    clock.stop_reason = "balanced"
    clock.agree("balanced", "")
    clock.stop_reason = None
    clock.stopped_by = ""
    assert clock.stop_request is None and clock.stop_reason is None


def test_commands_were_heard_when_their_links_say_so() -> None:
    clock = PartClock(0.01)
    assert clock.commands_heard() == 0
    clock.heard = lambda: 17
    assert clock.commands_heard() == 17
