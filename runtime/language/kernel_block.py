"""Blocks whose step is nothing but calls of kernels, which the runtime may make for them.

::

    class Gain(KernelBlock):
        def setup(self) -> None:
            self.kernel_calls = (KernelCall(scale, self.u.value, self._gain, self.y.value),)

What a tick needs lies in arrays: signals, state, scratch, and for a live parameter an array of one
element that ``on_parameters`` writes. So the runtime can make the calls of many blocks that follow
each other as one (see ``runtime/running/chain.py``), with the same bytes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.kernel_call import KernelCall
from .block import Block
from .errors import DeclarationError


class KernelBlock(Block):
    """A block whose step makes ``kernel_calls`` in their order, and does nothing else.

    ``setup`` must set ``kernel_calls``. A subclass has no ``step`` of its own. A call whose ``when``
    is zero at its turn, such as one for another phase, is left out; a kernel before it writes that.
    The last call of a block with ``attention`` has no ``when``.

    What happens rarely and needs Python, such as asking for the end of the run, is done by
    ``attend``: the step calls it after the kernels where ``attention`` is not zero. One of the
    kernels must write ``attention`` in every step. A block without ``attend`` leaves it ``None``.

    Attributes:
        kernel_calls: what a step consists of.
        attention: written by a kernel, (1,); not zero asks for ``attend`` after this step.
    """

    kernel_calls: Sequence[KernelCall] = ()
    attention: NDArray[np.int64] | None = None

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "step" in vars(cls):
            raise DeclarationError(
                f"{cls.__name__}: a KernelBlock has no step of its own; setup() sets kernel_calls, "
                "and attend() does what needs Python. Derive from Block to write a step"
            )
        cls.step = _step_in_file_of(cls)  # type: ignore[assignment]  # one for each class

    def step(self) -> None:
        for call in self.kernel_calls:
            call.take_turn()
        if self.attention is not None and self.attention[0]:
            self.attend()

    def attend(self) -> None:
        """Do in Python what the step's kernels asked for by ``attention``."""


def _step_in_file_of(cls: type[KernelBlock]) -> Callable[[KernelBlock], None]:
    """The common step, in the name of a class: stacks and reports of errors show the class's file.

    The step begins at the line of the class's first method. Its calls are two lines further down,
    which a class with a ``setup`` still has, so their line is one of the class's.
    """
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    own = [value.__code__ for value in vars(cls).values() if isinstance(value, FunctionType)]
    common = _COMMON
    if file is None or not own:
        return common
    line = min(code.co_firstlineno for code in own)
    code = common.__code__.replace(co_filename=own[0].co_filename, co_firstlineno=line)
    return FunctionType(code, common.__globals__, "step", common.__defaults__)


_COMMON: FunctionType = vars(KernelBlock)["step"]
