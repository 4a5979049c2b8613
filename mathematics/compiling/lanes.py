"""Evaluates straight-line code for several sets of inputs at once.

A program is a list of simple instructions on numbered slots, as automatic differentiation writes it. It is not
compiled: machine code that is the same for all programs walks through the instructions, and each of them works on
its slots of all sets of inputs, the lanes, with the processor's vectors. So finding out what to do costs a lane
little, and a program of a hundred thousand instructions, which a compiler needs half a minute for, is ready at once.

Operations are IEEE's own in double precision, or the C library's; nothing is reordered or contracted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from .kernel_call import aligned_zeros
from .machine_code import ENTRY, MachineCode, machine_code_of

WIDTH = 8
"""Lanes of one vector in the code; a processor may take it in several parts."""
_ARITHMETIC: dict[str, Callable[[Any, Any, Any], Any]] = {
    "add": lambda to, a, b: to.fadd(a, b),
    "sub": lambda to, a, b: to.fsub(a, b),
    "mul": lambda to, a, b: to.fmul(a, b),
    "div": lambda to, a, b: to.fdiv(a, b),
    "neg": lambda to, a, _: to.fneg(a),
    "copy": lambda to, a, _: a,
    "square": lambda to, a, _: to.fmul(a, a),
    "twice": lambda to, a, _: to.fadd(a, a),
    "inverse": lambda to, a, _: to.fdiv(_all_lanes(1.0), a),
    "sqrt": lambda to, a, _: _intrinsic(to, "llvm.sqrt", a),
    "fabs": lambda to, a, _: _intrinsic(to, "llvm.fabs", a),
    "copysign": lambda to, a, b: _intrinsic(to, "llvm.copysign", a, b),
    "sign": lambda to, a, _: _sign(to, a),
    "less": lambda to, a, b: _number(to, to.fcmp_ordered("<", a, b)),
    "less_equal": lambda to, a, b: _number(to, to.fcmp_ordered("<=", a, b)),
    "equal": lambda to, a, b: _number(to, to.fcmp_ordered("==", a, b)),
    "not_equal": lambda to, a, b: _number(to, to.fcmp_unordered("!=", a, b)),
    "not": lambda to, a, _: _number(to, to.fcmp_ordered("==", a, _all_lanes(0.0))),
    "and": lambda to, a, b: _number(to, to.and_(_true(to, a), _true(to, b))),
    "or": lambda to, a, b: _number(to, to.or_(_true(to, a), _true(to, b))),
    "if": lambda to, a, b: to.select(_true(to, a), b, _all_lanes(0.0)),
}
"""The result of each operation on one or two vectors. Truths are 1 and 0; ``if`` is b where a is not zero, else zero."""
_LIBRARY = {
    "sin": 1, "cos": 1, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "sinh": 1, "cosh": 1, "tanh": 1,
    "exp": 1, "log": 1, "floor": 1, "ceil": 1, "atan2": 2, "pow": 2, "fmin": 2, "fmax": 2,
}  # fmt: skip
"""The C library's functions that are operations, and how many operands each has."""
OPERATIONS = ("end", "constant", "input", "output", *_ARITHMETIC, *_LIBRARY)
"""The operations' names.

``end``: nothing follows. ``constant``: slot, place among the constants. ``input``: slot, number of the input, entry. ``output``: number of the
output, slot, entry. All others: slot of the result, slots of the operands; one operand is there twice.
"""


class Program(NamedTuple):
    """Straight-line code.

    Attributes:
        instructions: (n, 4), the operation's place in ``OPERATIONS`` and the three numbers that it says;
            the last one is ``end``.
        constants: (m,).
        slots: the number of slots.
    """

    instructions: NDArray[np.int32]
    constants: Array
    slots: int


class Lanes:
    """A program with memory for a number of lanes.

    Args:
        program: the program.
        lanes: how many sets of inputs there are.
        inputs, outputs: the numbers of entries of each, or memory for the entries of all lanes.

    Attributes:
        inputs, outputs: of each (lanes, entries).
    """

    def __init__(
        self, program: Program, lanes: int,
        inputs: Sequence[int | Array], outputs: Sequence[int | Array],
    ) -> None:  # fmt: skip
        vectors = -(-lanes // WIDTH)
        self.inputs, self.outputs = (
            [
                np.zeros((lanes, each)) if isinstance(each, int) else each.reshape(lanes, -1)
                for each in entries
            ]
            for entries in (inputs, outputs)
        )
        # zeros, because lanes that only fill the last vector up are computed as well
        self._slots = aligned_zeros((program.slots, WIDTH * vectors))
        self._program = program
        self._places = [
            np.array([(each.ctypes.data, each.shape[1]) for each in arrays], np.int64)
            for arrays in (self.inputs, self.outputs)
        ]
        arrays: list[Any] = [program.instructions, program.constants, self._slots, *self._places]
        self._words = np.array([*(each.ctypes.data for each in arrays), vectors, lanes], np.int64)
        self._code: MachineCode = _interpreter()
        self._address: Any = int(self._words.ctypes.data)

    def run(self) -> None:
        """Compute the outputs from the inputs."""
        self._code.function(self._address)


def _vector() -> Any:
    from llvmlite import ir

    return ir.VectorType(ir.DoubleType(), WIDTH)


def _all_lanes(value: float) -> Any:
    from llvmlite import ir

    return ir.Constant(_vector(), [value] * WIDTH)


def _intrinsic(to: Any, name: str, *values: Any) -> Any:
    from llvmlite import ir

    kind = ir.FunctionType(_vector(), [_vector()] * len(values))
    return to.call(ir.Function(to.module, kind, f"{name}.v{WIDTH}f64"), values)


def _true(to: Any, value: Any) -> Any:
    return to.fcmp_unordered("!=", value, _all_lanes(0.0))


def _number(to: Any, truth: Any) -> Any:
    return to.uitofp(truth, _vector())


def _sign(to: Any, value: Any) -> Any:
    above = to.fcmp_ordered(">", value, _all_lanes(0.0))
    below = to.fcmp_ordered("<", value, _all_lanes(0.0))
    return to.select(
        below, _all_lanes(-1.0), to.select(above, _all_lanes(1.0), value)
    )  # zero keeps its sign


@cache
def _interpreter() -> MachineCode:
    return machine_code_of(_module, optimise=True)


def _module() -> Any:
    """Return the interpreter as a module of LLVM."""
    from llvmlite import ir

    word, short, real = ir.IntType(64), ir.IntType(32), ir.DoubleType()
    module = ir.Module("aloft.lanes")
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [word]), ENTRY)
    begin = function.append_basic_block("begin")
    blocks = [function.append_basic_block(name) for name in OPERATIONS]
    to = ir.IRBuilder(begin)
    words = to.inttoptr(function.args[0], word.as_pointer())
    given = [to.load(to.gep(words, [word(k)])) for k in range(7)]
    constants, slots = (to.inttoptr(each, real.as_pointer()) for each in given[1:3])
    inputs, outputs = (to.inttoptr(each, word.as_pointer()) for each in given[3:5])
    vectors, lanes = given[5:]
    size = to.mul(vectors, word(WIDTH))
    at = to.alloca(short.as_pointer())
    to.store(to.inttoptr(given[0], short.as_pointer()), at)
    following = function.append_basic_block("following")
    to.branch(following)

    # LLVM copies this jump to the end of every operation, where the processor foresees it better.
    to = ir.IRBuilder(following)
    here = to.load(at)
    to.store(to.gep(here, [word(4)]), at)
    operation, *numbers = (to.zext(to.load(to.gep(here, [word(k)])), word) for k in range(4))
    goal, left, right = (to.gep(slots, [to.mul(each, size)]) for each in numbers)
    addresses = ir.ArrayType(ir.IntType(8).as_pointer(), len(blocks))
    table = ir.GlobalVariable(module, addresses, "operations")
    table.global_constant, table.linkage = True, "internal"
    table.initializer = ir.Constant(
        addresses, [ir.BlockAddress(function, block) for block in blocks]
    )
    jump = to.branch_indirect(to.load(to.gep(table, [word(0), operation])))
    for block in blocks:
        jump.add_destination(block)

    def loop(block: Any, times: Any, step: Callable[[Any, Any], None]) -> None:
        """Fill a block with a loop over the lanes, or the vectors of lanes."""
        inside = function.append_basic_block()
        ir.IRBuilder(block).branch(inside)
        to = ir.IRBuilder(inside)
        lane = to.phi(word)
        lane.add_incoming(word(0), block)
        step(to, lane)
        then = to.add(lane, word(1))
        lane.add_incoming(then, inside)
        to.cbranch(to.icmp_unsigned("<", then, times), inside, following)

    def element(to: Any, place: Any, lane: Any, kind: Any) -> Any:
        return to.gep(to.bitcast(place, kind.as_pointer()), [lane])

    def constant(to: Any, lane: Any) -> None:
        to.store(to.load(to.gep(constants, [numbers[1]])), to.gep(goal, [lane]))

    def entry(to: Any, lane: Any, table: Any, number: Any) -> Any:
        """Return where a lane's entry of an input or output is."""
        row = to.gep(table, [to.mul(number, word(2))])
        first = to.inttoptr(to.load(row), real.as_pointer())
        entries = to.load(to.gep(row, [word(1)]))
        return to.gep(first, [to.add(to.mul(lane, entries), numbers[2])])

    def read(to: Any, lane: Any) -> None:
        to.store(to.load(entry(to, lane, inputs, numbers[1])), to.gep(goal, [lane]))

    def write(to: Any, lane: Any) -> None:
        to.store(to.load(to.gep(left, [lane])), entry(to, lane, outputs, numbers[0]))

    def arithmetic(to: Any, lane: Any, make: Callable[[Any, Any, Any], Any]) -> None:
        kind = _vector()
        operands = (to.load(element(to, each, lane, kind), align=8) for each in (left, right))
        to.store(make(to, *operands), element(to, goal, lane, kind), align=8)

    def library(to: Any, lane: Any, called: Any) -> None:
        operands = [to.load(to.gep(each, [lane])) for each in (left, right)[: len(called.args)]]
        to.store(to.call(called, operands), to.gep(goal, [lane]))

    for name, block in zip(OPERATIONS, blocks, strict=True):
        if name == "end":
            ir.IRBuilder(block).ret_void()
        elif name in _ARITHMETIC:
            loop(block, vectors, partial(arithmetic, make=_ARITHMETIC[name]))
        elif name in _LIBRARY:
            kind = ir.FunctionType(real, [real] * _LIBRARY[name])
            loop(block, size, partial(library, called=ir.Function(module, kind, name)))
        else:
            steps = {"constant": (size, constant), "input": (lanes, read), "output": (lanes, write)}
            loop(block, *steps[name])
    return module
