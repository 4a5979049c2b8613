"""Blocks for tests of the command line."""

from aloft import Block, BlockError, Field, Output, Parameters, Signal, State, parameter


class Number(Signal):
    value = Field(text="a number")


class Counter(Block):
    """Counts up from its seed, and fails or ends the run when told to."""

    class Params(Parameters):
        seed: int = parameter(0, ge=0, text="where it starts")
        goal: float = parameter(1e9, text="the metric must not exceed this")
        fail_at: int = parameter(-1, text="the tick at which it raises")
        stop_at: int = parameter(-1, text="the tick at which it ends the run")
        warning: str = parameter("", text="what the reader of its results is told")
        nan_at: int = parameter(-1, text="the tick at which its output is not a number")

    params: Params
    y = Output(Number)
    count = State(Number)

    def start(self) -> None:
        self.count.value[()] = self.params.seed

    def step(self) -> None:
        if self.tick == self.params.fail_at:
            raise BlockError("the spring broke")
        if self.tick == self.params.stop_at:
            self.request_stop("counted enough")
        self.count.value += 1.0
        self.y.value[()] = float("nan") if self.tick == self.params.nan_at else self.count.value

    def warnings(self) -> list[str]:
        return [self.params.warning] if self.params.warning else []

    def metrics(self) -> dict[str, float | bool | str]:
        value = float(self.count.value)
        good = value <= self.params.goal
        return {"last_count": value, "success": good, "reason": "" if good else "counted too far"}
