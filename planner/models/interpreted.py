"""Functions of CasADi for many instants at once.

CasADi's own virtual machine takes the instants one after the other, and ten times as long. Nothing is compiled for a
function: see ``mathematics.compiling.lanes``. The values are CasADi's own to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array, Indices
from ...mathematics.compiling.lanes import OPERATIONS, Lanes, Program
from .python_function import python_function

_SAME = (
    "add", "sub", "mul", "div", "neg", "sqrt", "fabs", "copysign", "sign", "not", "and", "or",
    "twice", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log",
    "floor", "ceil", "atan2", "pow", "fmin", "fmax",
)  # fmt: skip
_OTHER = {
    "ASSIGN": "copy", "SQ": "square", "INV": "inverse", "LT": "less", "LE": "less_equal", "EQ": "equal",
    "NE": "not_equal", "IF_ELSE_ZERO": "if", "CONSTPOW": "pow",
}  # fmt: skip
"""CasADi's names of operations, of which ``_SAME`` are the same, and those of ``OPERATIONS``."""
_END, _CONSTANT, _READ, _WRITE = (
    OPERATIONS.index(name) for name in ("end", "constant", "input", "output")
)
TOGETHER = 512
"""Steps that may change places; a half and twice as many are slower."""


@cache
def _places() -> dict[int, int]:
    """Return the places in ``OPERATIONS`` of CasADi's numbers of operations."""
    import casadi as ca

    names = {name.upper(): name for name in _SAME} | _OTHER
    return {getattr(ca, f"OP_{name}"): OPERATIONS.index(own) for name, own in names.items()}


def read_program(function: Any) -> Program:
    """Return the instructions of a function that is made of ``SX`` expressions, without those that compute again what
    is known: CasADi's own search for these takes four times as long.

    Raises:
        ValueError: one of them is none of ``OPERATIONS``.
    """
    import casadi as ca

    places = _places()
    values = [0] * function.sz_w()
    """By CasADi's slot the number of the value that is in it now."""
    known: dict[tuple[Any, ...], int] = {}
    steps: list[tuple[int, ...]] = []
    constants: list[float] = []
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        goal = function.instruction_output(k)
        step: tuple[int, ...]
        if operation in places:
            operands = function.instruction_input(k)
            first, second = values[operands[0]], values[operands[-1]]
            key: tuple[Any, ...] = (operation, first, second)
            step = (places[operation], first, second)
        elif operation == ca.OP_CONST:
            number = function.instruction_constant(k)
            key = (number.hex(),)  # which tells zeros apart
            step = (_CONSTANT, len(constants), 0)
        elif operation == ca.OP_INPUT:
            step = (_READ, *function.instruction_input(k))
            key = ("input", *step)
        elif operation == ca.OP_OUTPUT:
            steps.append((_WRITE, goal[0], values[function.instruction_input(k)[0]], goal[1]))
            continue
        else:
            raise ValueError(
                f"{function.name()}: instruction {k} is CasADi's operation {operation}, which is not interpreted"
            )
        if key not in known:
            known[key] = len(known)
            steps.append((step[0], known[key], *step[1:]))
            if operation == ca.OP_CONST:
                constants.append(number)
        values[goal[0]] = known[key]
    return _placed(_grouped(steps), len(known), np.array(constants))


def _operands(step: tuple[int, ...]) -> set[int]:
    """Return the values that a step needs."""
    operation, _, first, second = step
    if operation == _WRITE:
        return {first}
    return set() if operation in (_CONSTANT, _READ) else {first, second}


def _grouped(steps: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return the steps in an order in which equal operations follow each other, so that the processor foresees them.

    They change places only within some that follow each other, or so many values would wait at once that the
    processor's nearest memory could not hold them.
    """
    found: list[tuple[int, ...]] = []
    for first in range(0, len(steps), TOGETHER):
        some = steps[first : first + TOGETHER]
        made = {step[1] for step in some if step[0] != _WRITE}
        missing: list[int] = []
        needed_by: dict[int, list[int]] = {}
        ready: dict[int, list[int]] = {}
        for k, step in enumerate(some):
            own = _operands(step) & made
            missing.append(len(own))
            for value in own:
                needed_by.setdefault(value, []).append(k)
            if not own:
                ready.setdefault(step[0], []).append(k)
        while ready:
            operation = max(ready, key=lambda each: len(ready[each]))
            while operation in ready:  # what becomes ready meanwhile follows
                for k in ready.pop(operation):
                    found.append(some[k])
                    for waiting in needed_by.get(some[k][1], ()) if operation != _WRITE else ():
                        missing[waiting] -= 1
                        if not missing[waiting]:
                            ready.setdefault(some[waiting][0], []).append(waiting)
    return found


def _placed(steps: list[tuple[int, ...]], values: int, constants: Array) -> Program:
    """Give every value a slot, which is free again after the last step that needs it."""
    last = [0] * values
    for k, step in enumerate(steps):
        for value in _operands(step):
            last[value] = k
        if step[0] != _WRITE:
            last[step[1]] = k
    slot_of, free, slots = [0] * values, [], 0
    rows: list[tuple[int, ...]] = []
    for k, (operation, goal, first, second) in enumerate(steps):
        if operation == _WRITE:
            rows.append((_WRITE, goal, slot_of[first], second))
            if last[first] == k:
                free.append(slot_of[first])
            continue
        row = (first, second)
        if operation not in (_CONSTANT, _READ):
            row = (slot_of[first], slot_of[second])
            free += [slot_of[each] for each in {first, second} if last[each] == k]
        if not free:
            free.append(slots)
            slots += 1
        slot_of[goal] = free.pop()
        rows.append((operation, slot_of[goal], *row))
        if last[goal] == k:
            free.append(slot_of[goal])
    rows.append((_END, 0, 0, 0))
    return Program(np.array(rows, np.int32), constants, slots)


class Pattern(NamedTuple):
    """Where a matrix has entries: its shape, and as CasADi has them the columns' starts and the entries' rows."""

    shape: tuple[int, int]
    starts: list[int]
    rows: list[int]


class InterpretedFunction:
    """A function of CasADi as its instructions, with those methods of CasADi's own that the planner uses.

    It can be pickled.

    Args:
        name: of the function.
        instructions, constants: of the program, see ``lanes.Program``.
        layout: whole numbers; how many slots, arguments and results there are, then of each argument and result
            height, width, entries, the columns' starts and the entries' rows.

    Attributes:
        program: the instructions.
        inputs, outputs: where arguments and results have entries.
    """

    def __init__(
        self, name: str, instructions: NDArray[np.int32], constants: Array, layout: Indices
    ) -> None:
        self._name, self._layout = name, layout
        slots, given, found, *numbers = layout.tolist()
        self.program = Program(instructions, constants, slots)
        patterns, place = [], 0
        for _ in range(given + found):
            height, width, entries = numbers[place : place + 3]
            first = place + 3
            middle = first + width + 1
            place = middle + entries
            patterns.append(Pattern((height, width), numbers[first:middle], numbers[middle:place]))
        self.inputs, self.outputs = patterns[:given], patterns[given:]
        self._maps: dict[int, Any] = {}

    def arrays(self) -> tuple[NDArray[np.int32], Array, Indices]:
        """Return the arguments but the name."""
        return self.program.instructions, self.program.constants, self._layout

    def __reduce__(self) -> tuple[Any, ...]:
        """Leave CasADi's objects out."""
        return type(self), (self._name, *self.arrays())

    def name(self) -> str:
        """Return the name."""
        return self._name

    def n_in(self) -> int:
        """Return the number of arguments."""
        return len(self.inputs)

    def size1_in(self, number: int) -> int:
        """Return the height of an argument."""
        return self.inputs[number].shape[0]

    def size1_out(self, number: int) -> int:
        """Return the height of a result."""
        return self.outputs[number].shape[0]

    def sparsity_in(self, number: int) -> Any:
        """Return the pattern of an argument."""
        return _sparsity(self.inputs[number])

    def sparsity_out(self, number: int) -> Any:
        """Return the pattern of a result."""
        return _sparsity(self.outputs[number])

    def lanes(
        self,
        count: int,
        inputs: Sequence[Array] | None = None,
        outputs: Sequence[Array] | None = None,
    ) -> Lanes:
        """Return the function at ``count`` instants, with memory for its arguments and results unless it is given."""
        return Lanes(
            self.program, count,
            [len(each.rows) for each in self.inputs] if inputs is None else inputs,
            [len(each.rows) for each in self.outputs] if outputs is None else outputs,
        )  # fmt: skip

    def map(self, count: int) -> Any:
        """Return the function of CasADi for ``count`` instants, whose arguments and results are side by side."""
        import casadi as ca

        if count not in self._maps:
            lanes = self.lanes(count)

            def compute(values: Sequence[Array]) -> Sequence[Array]:
                for own, entries in zip(lanes.inputs, values, strict=True):
                    own.reshape(-1)[:] = entries
                lanes.run()
                return [each.reshape(-1) for each in lanes.outputs]

            given, found = (
                {
                    f"{letter}{k}": ca.repmat(_sparsity(each), 1, count)
                    for k, each in enumerate(some)
                }
                for letter, some in (("i", self.inputs), ("o", self.outputs))
            )
            self._maps[count] = python_function(f"{self._name}_{count}", given, found, compute)
        return self._maps[count]

    def __call__(self, *arguments: Any) -> Any:
        """Return the values at one instant, as CasADi's matrices."""
        return self.map(1)(*arguments)


def interpreted(function: Any) -> InterpretedFunction:
    """Return a function of CasADi's ``SX`` expressions as its instructions.

    Raises:
        ValueError: see ``read_program``.
    """
    program = read_program(function)
    layout = [program.slots, function.n_in(), function.n_out()]
    for sparsity in (
        *(function.sparsity_in(k) for k in range(function.n_in())),
        *(function.sparsity_out(k) for k in range(function.n_out())),
    ):
        layout += [*sparsity.shape, sparsity.nnz(), *sparsity.colind(), *sparsity.row()]
    return InterpretedFunction(
        function.name(), program.instructions, program.constants, np.array(layout, np.int64)
    )


def _sparsity(pattern: Pattern) -> Any:
    import casadi as ca

    return ca.Sparsity(*pattern.shape, pattern.starts, pattern.rows)
