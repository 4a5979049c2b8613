"""Blocks whose calls of kernels are only known at set-up, such as one for each of a list of tasks.

A block whose step is one kernel marks it with ``@kernel`` (see ``steps``). This is for the others::

    class WholeBody(KernelBlock):
        def setup(self) -> None:
            self.kernel_calls = [task.call(self.terms) for task in self.tasks]
"""

from __future__ import annotations

from types import FunctionType
from typing import Any

from .block import Block
from .errors import DeclarationError
from .steps import step_in_file_of


class KernelBlock(Block):
    """A block whose step makes ``kernel_calls`` in their order, and does nothing else.

    ``setup`` must set ``kernel_calls``. A subclass has no ``step`` of its own. A call whose ``when``
    is zero at its turn, such as one for another phase, is left out; a kernel before it writes that.
    The last call of a block with an ``event`` has no ``when``. One of the kernels must write
    ``event`` in every step; where it is not zero the step calls ``on_event`` after the kernels.
    """

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = vars(cls).get("step")
        if own is not None and not hasattr(own, "binds"):
            raise DeclarationError(
                f"{cls.__name__}: a KernelBlock has no step of its own; setup() sets kernel_calls, "
                "and on_event() does what needs Python. Derive from Block to write a step"
            )
        codes = [each.__code__ for each in vars(cls).values() if isinstance(each, FunctionType)]
        if own is None and codes:  # errors show the class's file, at the line of its first method
            first = min(codes, key=lambda code: code.co_firstlineno)
            setattr(cls, "step", step_in_file_of(cls, "step", first))  # noqa: B010  mypy: a method

    def step(self) -> None:
        for call in self.kernel_calls:
            call.take_turn()
        if self.event is not None and self.event[0]:
            self.on_event()
