"""A block that hangs in tick 3: in Python, or in compiled code that keeps the interpreter."""

import ctypes

from aloft.blocks.general.vector import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.parameters import Parameters, parameter


class Hanging(Block):
    """Ends by itself after two minutes, so that a failure does not hang."""

    y = Output(Vector, text="nothing")

    class Params(Parameters):
        n: int = parameter(1, text="the number of elements")
        compiled: bool = parameter(False, text="whether the interpreter is kept")

    def step(self) -> None:
        if self.tick != 3:
            return
        if self.params.compiled:
            # PyDLL keeps the interpreter during a call; libc sleeps again when a signal wakes it
            while ctypes.PyDLL(None).sleep(120):
                pass
        while True:
            pass
