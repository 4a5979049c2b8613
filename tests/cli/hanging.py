"""Blocks that hang in tick 3: in Python, in compiled code that keeps the interpreter, in a kernel."""

import ctypes
import time

import numpy as np

from aloft.blocks.general.vectors import Vector
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.kernel import kernel
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.kernel_block import KernelBlock
from aloft.runtime.language.parameters import Parameters, parameter


class Hanging(Block):
    """Ends by itself after two minutes, so that a failure does not hang."""

    y = Output(Vector, text="nothing")

    class Params(Parameters):
        n: int = parameter(1, text="the number of elements")
        compiled: bool = parameter(False, text="whether the interpreter is kept")

    def setup(self) -> None:
        # PyDLL keeps the interpreter during a call. A signal does not end the wait for a lock.
        self._wait = ctypes.PyDLL(None).pthread_mutex_timedlock
        self._lock = ctypes.create_string_buffer(64)  # an open one, as all zeros
        ctypes.PyDLL(None).pthread_mutex_lock(self._lock)

    def step(self) -> None:
        if self.tick != 3:
            return
        if self.params.compiled:
            until = (ctypes.c_long * 2)(int(time.time()) + 120, 0)
            self._wait(self._lock, until)
        while True:
            pass


@kernel
def turn(count, at, y):
    count[0] += 1
    rounds = 10**13 if count[0] == at else 1
    for _ in range(rounds):  # no compiler may leave out what rounds differently every time
        y[0] = 0.75 * y[0] + 1.0


class Turning(KernelBlock):
    """Turns for hours in step ``at``."""

    y = Output(Vector, text="a number")

    class Params(Parameters):
        n: int = parameter(1, text="the number of elements")
        at: int = parameter(-1, text="the step that hangs")

    def setup(self) -> None:
        count = np.zeros(1, np.int64)
        self.kernel_calls = (KernelCall(turn, count, self.params.at, self.y.value),)
