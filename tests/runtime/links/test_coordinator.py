"""A part's clock keeps the first request to stop, and ends only when all parts have agreed; a change
of parameters is tried with all that a block derives from them."""

from aloft import Block, Output, Parameters, parameter
from aloft.runtime.links.coordinator import DistributedParameters, PartClock
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.graphs import BlockUse, checked_graph

from .example_graphs import Number


class Derived(Block):
    """Has a number that follows from a parameter."""

    class Params(Parameters):
        factor: float = parameter(1.0, live=True, text="what the number is twice of")

    params: Params
    y = Output(Number)
    twice = 0.0

    def prepare(self) -> None:
        self.twice = 2.0 * self.params.factor

    def step(self) -> None:
        self.y.value[()] = self.twice


def test_a_request_alone_does_not_end_the_run() -> None:
    clock = PartClock(0.01)
    assert (clock.stop_reason, clock.stopped_by, clock.stop_request) == (None, "", None)
    clock.stop_reason = "balanced"
    clock.stopped_by = "controller"
    assert (clock.stop_reason, clock.stopped_by) == (None, "")
    assert clock.stop_request == ("balanced", "controller")
    clock.agree("it fell", "score")
    assert (clock.stop_reason, clock.stopped_by) == ("it fell", "score")


def test_the_first_request_is_kept_with_its_block() -> None:
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


def test_what_follows_from_parameters_is_prepared_anew_and_undone() -> None:
    bound = BoundGraph(checked_graph({"a": BlockUse(Derived)}))
    block, parameters = bound.blocks["a"], DistributedParameters(bound.blocks)
    assert isinstance(block, Derived) and block.twice == 2.0
    assert parameters.try_settings({"a.factor": 3.0}) == "" and block.twice == 6.0
    parameters.undo()
    assert block.twice == 2.0 and block.params.factor == 1.0
    assert parameters.try_settings({"a.factor": 4.0}) == ""
    parameters.keep(7)
    assert block.twice == 8.0 and [change.tick for change in parameters.changes] == [7]
