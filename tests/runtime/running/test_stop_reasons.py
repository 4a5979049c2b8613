"""Why a run ended is told, whoever asked for its end."""

from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.running.executor import run
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class EmptyTank(Block):
    """Ends the run in tick 2."""

    y = Output(Vector, text="nothing")

    class Params(Parameters):
        n: int = 1

    def step(self) -> None:
        if self.tick == 2:
            self.request_stop("the tank is empty")


class Judge(EmptyTank):
    """Says that all went well; may end the run itself."""

    def step(self) -> None:
        if self.tick == 3:
            self.request_stop("seen enough")

    def metrics(self) -> dict[str, bool | str]:
        return {"success": True, "reason": "it flew"}


def test_a_score_does_not_hide_why_another_block_ended_the_run() -> None:
    both = checked_graph({"stopper": BlockUse(EmptyTank), "judge": BlockUse(Judge)})
    assert run(both, 10).reason == "it flew; block 'stopper' ended the run: the tank is empty"
    assert run(checked_graph({"judge": BlockUse(Judge)}), 10).reason == "it flew"
