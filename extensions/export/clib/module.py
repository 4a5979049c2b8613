"""Writes a library in LLVM's language: the kernels of a graph, and the functions that call them.

The functions make the calls that a tick of the graph makes, in the same order, with the places of
the arrays in the instance in place of addresses. Nothing is allocated, nothing outside of the
instance is written, and no floating-point number is computed here, so the bytes are the graph's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....mathematics.compiling.arguments import ArgumentType, ArrayType, RecordType, type_of
from ....mathematics.compiling.failures import Failure
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.compiling.llvm_code import leaves, number
from ....mathematics.compiling.machine_code import read_only_arguments
from ....mathematics.compiling.translate import ATTRIBUTES, Translator
from ....runtime.running.tick_calls import TickCall, tick_calls
from .image import Image
from .part import SubGraph, terminal_groups


class Status(IntEnum):
    """Return values of a library's functions. Below zero nothing goes on before a reset."""

    OK = 0
    EVENT = 1
    FALLBACK = 2
    NOT_FINITE = -1
    DIVIDED_BY_ZERO = -2
    BAD_INSTANCE = -3
    BAD_ARGUMENT = -4
    BAD_INPUT = -5
    TOO_LARGE = -6
    OUT_OF_DOMAIN = -7
    OUT_OF_RANGE = -8
    WRONG_LENGTH = -9


STATUS_TEXTS = {
    Status.OK: "the tick is complete",
    Status.EVENT: "the tick is complete; a block asks for attention, see last_block",
    Status.FALLBACK: "the tick is complete; a block found no solution and used what it has instead",
    Status.NOT_FINITE: "a signal is NaN or infinite; reset, or restore a state",
    Status.DIVIDED_BY_ZERO: "a block divided by zero, see last_block",
    Status.BAD_INSTANCE: "the pointer is null, not aligned to 8 bytes, or no instance of this library",
    Status.BAD_ARGUMENT: "a size, a parameter or a value is not one that this function takes",
    Status.BAD_INPUT: "an input is NaN or infinite; the step has done nothing",
    Status.TOO_LARGE: "a block got a whole number that does not fit into 64 bits, see last_block",
    Status.OUT_OF_DOMAIN: "a block called a function outside of its domain, see last_block",
    Status.OUT_OF_RANGE: "a block got a number beyond the largest float, see last_block",
    Status.WRONG_LENGTH: "a block met a slice of another length than what it is combined with, see last_block",
}
MARK, CODE, BLOCK = 0, 8, 12
"""The bytes of an instance that hold the mark of the library, the last code and its block."""


@dataclass(frozen=True)
class ScheduledCall:
    """A call of a kernel in a tick: by the block of a number, in ticks of a period and offset."""

    call: KernelCall
    block: int
    period: int
    offset: int
    last: bool


class Module:
    """The library of a part of a graph in LLVM's language.

    Args:
        name: of the library; its functions begin with it.
        part: what it computes.
        mark: a number that no other library has.
        functions: functions beside the step, by name, which make these calls; ``Status`` is their
            result. All that they work on is in the instance.
        visible: further memory that is to be in the instance.
    """

    def __init__(
        self,
        name: str,
        part: SubGraph,
        mark: int,
        texts: dict[str, str],
        functions: Mapping[str, Sequence[KernelCall]] | None = None,
        visible: Iterable[NDArray[Any]] = (),
    ) -> None:
        self.name, self.part, self.mark, self._texts = name, part, mark, texts
        self._functions = functions or {}
        memory = part.bound.memory
        outputs, updates = tick_calls(part.graph, part.bound.blocks)
        self._calls, self._updates = self._list(outputs), self._list(updates)
        events = [c for p in part.blocks for c in part.bound.blocks[p].event_calls]
        beside = [call for calls in self._functions.values() for call in calls]
        every = [*(each.call for each in (*self._calls, *self._updates)), *events, *beside]
        self._types = {id(c): tuple(type_of(a) for a in c.arguments) for c in every}
        kernels = [(call.kernel, self._types[id(call)]) for call in every]
        self._kernels, made = Translator().functions(kernels)
        self._made = {id(call): each for call, each in zip(every, made, strict=True)}
        self._tick: NDArray[np.int64] = part.bound.clock.present
        known = read_only_arguments(self._kernels + "\n" + ATTRIBUTES, {m.name for m in made})
        written: list[NDArray[Any]] = [self._tick, *visible]
        written += [array for call in beside for array, _ in _arrays(call)]
        read: list[NDArray[Any]] = []
        for call in every:
            if call.when is not None:
                written.append(call.when)
            flags = known[self._made[id(call)].name]
            for array, first in _arrays(call):
                (read if flags[first] else written).append(array)
        for path in part.blocks:
            block = part.bound.blocks[path]
            written += [block.parameter_arrays[n] for n in sorted(block.parameter_arrays)]
            if block.event is not None:
                written.append(block.event)
        self.regions = (memory.bus.buffer, memory.state.buffer)
        self.image = Image.of((*self.regions, memory.own.buffer), written, read)
        self.bus_place, self.state_place = (self._place(r) for r in self.regions)
        self.input_fields, self.input_size = self._struct(part.cut.inputs)
        self.output_fields, self.output_size = self._struct(part.cut.outputs)
        self.state_size = 16 + sum(each.size for each in self.regions)

    def _list(self, called: Sequence[TickCall]) -> list[ScheduledCall]:
        found = []
        for each in called:
            if each.path not in self.part.blocks:  # what is outside has nothing to do
                continue
            calls = getattr(self.part.bound.blocks[each.path], each.calls)
            number, offset = self.part.blocks.index(each.path), each.offset % each.period
            found += [ScheduledCall(c, number, each.period, offset, c is calls[-1]) for c in calls]
        return found

    def _place(self, array: NDArray[Any]) -> int:
        """Return the byte of an instance at which an array that is written begins."""
        return self.image.place(array)[1]

    def _struct(self, terminals: Any) -> tuple[dict[str, tuple[int, int, int]], int]:
        """Return the places of each terminal in the struct of C: first byte, byte on the bus, size."""
        bus, place = self.part.bound.memory.bus, 0
        fields: dict[str, tuple[int, int, int]] = {}
        for group in terminal_groups(terminals).values():
            aligned = max(1 if each.dtype == "bool" else 8 for _, each in group)
            place = -(-place // aligned) * aligned
            for _, each in group:
                first, end = bus.layout.byte_range(each.source)
                unit = 1 if each.dtype == "bool" else 8
                place = -(-place // unit) * unit
                fields[each.name] = place, self.bus_place + first, end - first
                place += end - first
            place = -(-place // aligned) * aligned
        return fields, max(8, -(-place // 8) * 8)

    def text(self) -> str:
        """Return the whole module."""
        size, name = self.image.size, self.name
        parts = [
            self._kernels,
            _NOT_FINITE,
            "declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)",
            _bytes("image", self.image.bytes_of(constant=False)),
            _bytes("constants", self.image.bytes_of(constant=True)),
            *(_string(f"text.{key}", value) for key, value in self._texts.items()),
            *(
                f"define ptr @{name}_{key}() #0 {{\n  ret ptr @text.{key}\n}}"
                for key in self._texts
            ),
            self._names(),
            f"define i64 @{name}_memory_size() #0 {{\n  ret i64 {size}\n}}",
            f"define i64 @{name}_state_size() #0 {{\n  ret i64 {self.state_size}\n}}",
            self._function("init", "ptr %self, i64 %size", self._init, checked=False),
            self._function("reset", "ptr %self", self._reset),
            self._function("step", "ptr %self, ptr %in, ptr %out", self._step),
            self._function("save", "ptr %self, ptr %state", self._save),
            self._function("restore", "ptr %self, ptr %state", self._restore),
            self._function("set", "ptr %self, i32 %parameter, double %value", self._set),
            *(
                self._function(key, "ptr %self", partial(self._beside, calls))
                for key, calls in self._functions.items()
            ),
            self._get(),
            *(
                self._field(key, place)
                for key, place in (("last_error", CODE), ("last_block", BLOCK))
            ),
            ATTRIBUTES,
        ]
        return "\n".join(parts)

    # Functions

    def _function(
        self, key: str, takes: str, body: Callable[[_Code], None], *, checked: bool = True
    ) -> str:
        code = _Code()
        code("%null = icmp eq ptr %self, null")
        code("br i1 %null, label %bad, label %aligned")
        code.label("aligned")
        code("%address = ptrtoint ptr %self to i64")
        code("%low = and i64 %address, 7")
        code("%odd = icmp ne i64 %low, 0")
        code(f"br i1 %odd, label %bad, label %{'there' if checked else 'good'}")
        if checked:
            code.label("there")
            code("%mark = load i64, ptr %self")
            code(f"%other = icmp ne i64 %mark, {self.mark}")
            code("br i1 %other, label %bad, label %good")
        code.label("bad")
        code(f"ret i32 {int(Status.BAD_INSTANCE)}")
        code.label("good")
        body(code)
        return f"define i32 @{self.name}_{key}({takes}) #0 {{\nentry:\n{code.text()}\n}}"

    def _init(self, code: _Code) -> None:
        code(f"%small = icmp ult i64 %size, {self.image.size}")
        code("br i1 %small, label %refuse, label %write")
        code.label("refuse")
        code(f"ret i32 {int(Status.BAD_ARGUMENT)}")
        code.label("write")
        self._reset(code)

    def _reset(self, code: _Code) -> None:
        code(
            f"call void @llvm.memcpy.p0.p0.i64(ptr align 8 %self, ptr align 8 @image, "
            f"i64 {self.image.size}, i1 false)"
        )
        code(f"store i64 {self.mark}, ptr %self")
        code(f"store i32 -1, ptr {code.at(BLOCK)}")
        code("ret i32 0")

    def _save(self, code: _Code) -> None:
        code(f"store i64 {self.mark}, ptr %state")
        code(f"%tick = load i64, ptr {code.at(self._place(self._tick))}")
        code(f"store i64 %tick, ptr {code.at(8, '%state')}")
        self._copy_state(code, save=True)
        code("ret i32 0")

    def _restore(self, code: _Code) -> None:
        code("%from = load i64, ptr %state")
        code(f"%foreign = icmp ne i64 %from, {self.mark}")
        code("br i1 %foreign, label %refuse, label %read")
        code.label("refuse")
        code(f"ret i32 {int(Status.BAD_ARGUMENT)}")
        code.label("read")
        code(f"%tick = load i64, ptr {code.at(8, '%state')}")
        code(f"store i64 %tick, ptr {code.at(self._place(self._tick))}")
        self._copy_state(code, save=False)
        code(f"store i32 0, ptr {code.at(CODE)}")
        code(f"store i32 -1, ptr {code.at(BLOCK)}")
        code("ret i32 0")

    def _copy_state(self, code: _Code, *, save: bool) -> None:
        place = 16
        for region in self.regions:
            own, kept = code.at(self._place(region)), code.at(place, "%state")
            code.copy(*((kept, own) if save else (own, kept)), region.size)
            place += region.size

    def _step(self, code: _Code) -> None:
        code(f"%before = load i32, ptr {code.at(CODE)}")
        code("%broken = icmp slt i32 %before, 0")
        code("br i1 %broken, label %still, label %whole")
        code.label("still")
        code("ret i32 %before")
        code.label("whole")
        self._check_inputs(code)
        code(f"store i32 0, ptr {code.at(CODE)}")
        code(f"store i32 -1, ptr {code.at(BLOCK)}")
        for struct, bus, size in self.input_fields.values():
            code.copy(code.at(bus), code.at(struct, "%in"), size)
        code(f"%tick = load i64, ptr {code.at(self._place(self._tick))}")
        self._make(code, self._calls, events=True)
        self._check_finite(code)
        self._make(code, self._updates, events=False)
        code("%next = add i64 %tick, 1")
        code(f"store i64 %next, ptr {code.at(self._place(self._tick))}")
        for struct, bus, size in self.output_fields.values():
            code.copy(code.at(struct, "%out"), code.at(bus), size)
        code(f"%code = load i32, ptr {code.at(CODE)}")
        code("ret i32 %code")
        self._end(code)

    def _beside(self, calls: Sequence[KernelCall], code: _Code) -> None:
        for call in calls:
            self._call(code, call, -1)
        code("ret i32 0")
        self._end(code)

    def _end(self, code: _Code) -> None:
        """Write the label at which calls that fail go on."""
        if code.failures:
            code.label("failed")
            for name, k in (("who", 0), ("what", 1)):
                code(
                    f"%{name} = phi i32 " + ", ".join(f"[ {e[k]}, %{e[2]} ]" for e in code.failures)
                )
            code("%kind = and i32 %what, 15")
            told = str(int(Status.DIVIDED_BY_ZERO))
            for failure in Failure:  # one with functions of Numba is not exported
                if failure.name in Status.__members__:
                    is_it = code.value(f"icmp eq i32 %kind, {int(failure)}")
                    status = int(Status[failure.name])
                    told = code.value(f"select i1 {is_it}, i32 {status}, i32 {told}")
            code(f"store i32 {told}, ptr {code.at(CODE)}")
            code(f"store i32 %who, ptr {code.at(BLOCK)}")
            code(f"ret i32 {told}")

    def _make(self, code: _Code, calls: Sequence[ScheduledCall], *, events: bool) -> None:
        """Make calls, those of slower blocks in their ticks only."""
        for (period, offset), group in groupby(calls, lambda each: (each.period, each.offset)):
            after = code.name("rate")
            if period > 1:
                rest = code.value(f"urem i64 %tick, {period}")
                due = code.value(f"icmp eq i64 {rest}, {offset}")
                code.branch(due, code.name("due"), after)
            for each in group:
                self._call(code, each.call, each.block)
                block = self.part.bound.blocks[self.part.blocks[each.block]]
                if events and each.last and block.event is not None:
                    self._event(code, each.block)
            if period > 1:
                code.jump(after)

    def _call(self, code: _Code, call: KernelCall, block: int) -> None:
        made, after = self._made[id(call)], ""
        if call.when is not None:
            word = code.value(f"load i64, ptr {code.at(self._place(call.when))}")
            after = code.name("left")
            code.branch(code.value(f"icmp ne i64 {word}, 0"), code.name("take"), after)
        operands = [text for argument in call.arguments for text in self._operands(code, argument)]
        for leaf in leaves(made.returns):
            operands.append(f"ptr {code.room(leaf)}")
        status = code.value(f'call i32 @"{made.name}"({", ".join(operands)})')
        if made.fails:
            failed = code.value(f"icmp ne i32 {status}, 0")
            code.failures.append((block, status, code.current))
            following = code.name("went")
            code(f"br i1 {failed}, label %failed, label %{following}, !prof !0")
            code.label(following)
        if after:
            code.jump(after)

    def _event(self, code: _Code, number_of_block: int) -> None:
        block = self.part.bound.blocks[self.part.blocks[number_of_block]]
        assert block.event is not None
        word = code.value(f"load i64, ptr {code.at(self._place(block.event))}")
        after = code.name("calm")
        code.branch(code.value(f"icmp ne i64 {word}, 0"), code.name("event"), after)
        for call in block.event_calls:
            self._call(code, call, number_of_block)
        status = Status.FALLBACK if block.event_calls else Status.EVENT
        known = code.value(f"load i32, ptr {code.at(CODE)}")
        code.branch(  # what asks for attention is not hidden by a fallback
            code.value(f"icmp ne i32 {known}, {int(Status.EVENT)}"), code.name("tell"), after
        )
        code(f"store i32 {int(status)}, ptr {code.at(CODE)}")
        code(f"store i32 {number_of_block}, ptr {code.at(BLOCK)}")
        code.jump(after)

    def _operands(self, code: _Code, argument: Any) -> Iterator[str]:
        """Yield an argument as the operands of a call."""
        kind = type_of(argument)
        if isinstance(kind, ArrayType):
            constant, place = self.image.place(argument)
            yield f"ptr {code.at(place, '@constants' if constant else '%self')}"
            words = (*argument.shape, *(argument.strides if kind.order == "A" else ()))
            yield from (f"i64 {word}" for word in words)
        elif isinstance(kind, RecordType):
            for each in argument:
                yield from self._operands(code, each)
        else:
            yield f"{leaves(kind)[0]} {number(argument).parts[0]}"

    def _check_finite(self, code: _Code) -> None:
        """Write the check that no number on the bus is NaN or infinite."""
        layout = self.part.bound.memory.bus.layout
        place = code.at(self.bus_place + layout.offsets["float64"])
        count = layout.lengths["float64"]
        wrong = code.value(f"call i1 @not_finite(ptr {place}, i64 {count})")
        code(f"br i1 {wrong}, label %notfinite, label %finite, !prof !0")
        code.label("notfinite")
        code(f"store i32 {int(Status.NOT_FINITE)}, ptr {code.at(CODE)}")
        code(f"store i32 -1, ptr {code.at(BLOCK)}")
        code(f"ret i32 {int(Status.NOT_FINITE)}")
        code.label("finite")

    def _check_inputs(self, code: _Code) -> None:
        wrong = "false"
        for each in self.part.cut.inputs:
            if each.dtype == "float64":
                struct, _, size = self.input_fields[each.name]
                place = code.at(struct, "%in")
                found = code.value(f"call i1 @not_finite(ptr {place}, i64 {size // 8})")
                wrong = code.value(f"or i1 {wrong}, {found}")
        code(f"br i1 {wrong}, label %badinput, label %goodinput, !prof !0")
        code.label("badinput")
        code(f"store i32 -1, ptr {code.at(BLOCK)}")
        code(f"ret i32 {int(Status.BAD_INPUT)}")
        code.label("goodinput")

    # Parameters and texts

    def _elements(self) -> Iterator[tuple[int, str, int, Any]]:
        """Yield the number of each parameter, LLVM's type of it in memory, its place, and itself."""
        for k, each in enumerate(self.part.parameters):
            array = self.part.bound.blocks[each.block].parameter_arrays[each.parameter]
            leaf = {"f": "double", "i": "i64", "b": "i8"}[array.dtype.kind]
            yield k, leaf, self._place(array) + each.element * array.itemsize, each

    def _set(self, code: _Code) -> None:
        found = list(self._elements())
        cases = " ".join(f"i32 {k}, label %set{k}" for k, *_ in found)
        code(f"switch i32 %parameter, label %refuse [ {cases} ]")
        for k, leaf, place, each in found:
            code.label(f"set{k}")
            good = "true"
            limits = (
                ("oge", each.at_least), ("ogt", each.above), ("ole", each.at_most),
                ("olt", each.below), ("olt", float("inf")), ("ogt", float("-inf")),
            )  # fmt: skip
            for comparison, limit in limits:
                if limit is not None:
                    kept = code.value(f"fcmp {comparison} double %value, {number(limit).parts[0]}")
                    good = code.value(f"and i1 {good}, {kept}")
            code(f"br i1 {good}, label %write{k}, label %refuse")
            code.label(f"write{k}")
            value = "%value"
            if leaf != "double":
                value = code.value("fptosi double %value to i64")
                if leaf == "i8":
                    flag = code.value(f"icmp ne i64 {value}, 0")
                    value = code.value(f"zext i1 {flag} to i8")
            code(f"store {leaf} {value}, ptr {code.at(place)}")
            code("ret i32 0")
        code.label("refuse")
        code(f"ret i32 {int(Status.BAD_ARGUMENT)}")

    def _get(self) -> str:
        code = _Code()
        found = list(self._elements())
        cases = " ".join(f"i32 {k}, label %get{k}" for k, *_ in found)
        code(f"switch i32 %parameter, label %unknown [ {cases} ]")
        for k, leaf, place, _ in found:
            code.label(f"get{k}")
            value = code.value(f"load {leaf}, ptr {code.at(place)}")
            if leaf != "double":
                value = code.value(f"sitofp {leaf} {value} to double")
            code(f"ret double {value}")
        code.label("unknown")
        code("ret double 0x7FF8000000000000")
        takes = "ptr %self, i32 %parameter"
        return f"define double @{self.name}_get({takes}) #0 {{\nentry:\n{code.text()}\n}}"

    def _field(self, key: str, place: int) -> str:
        code = _Code()
        code(f"%value = load i32, ptr {code.at(place)}")
        code("ret i32 %value")
        return f"define i32 @{self.name}_{key}(ptr %self) #0 {{\nentry:\n{code.text()}\n}}"

    def _names(self) -> str:
        """Return the names of the blocks, and the function that gives them."""
        code = _Code()
        cases = " ".join(f"i32 {k}, label %name{k}" for k in range(len(self.part.blocks)))
        code(f"switch i32 %block, label %unknown [ {cases} ]")
        texts = []
        for k, path in enumerate(self.part.blocks):
            texts.append(_string(f"block.{k}", path))
            code.label(f"name{k}")
            code(f"ret ptr @block.{k}")
        code.label("unknown")
        code("ret ptr @block.none")
        texts.append(_string("block.none", ""))
        head = f"define ptr @{self.name}_block_name(i32 %block) #0 {{\nentry:"
        return "\n".join((*texts, head, code.text(), "}"))


_NOT_FINITE = f"""\
define internal i1 @not_finite(ptr %floats, i64 %count) #0 {{
entry:
  %empty = icmp eq i64 %count, 0
  br i1 %empty, label %end, label %next
next:
  %k = phi i64 [ 0, %entry ], [ %following, %next ]
  %seen = phi i64 [ 0, %entry ], [ %found, %next ]
  %place = getelementptr i64, ptr %floats, i64 %k
  %bits = load i64, ptr %place
  %exponent = and i64 %bits, {0x7FF << 52}
  %wrong = icmp eq i64 %exponent, {0x7FF << 52}
  %wide = zext i1 %wrong to i64
  %found = or i64 %seen, %wide
  %following = add i64 %k, 1
  %all = icmp eq i64 %following, %count
  br i1 %all, label %end, label %next
end:
  %any = phi i64 [ 0, %entry ], [ %found, %next ]
  %result = icmp ne i64 %any, 0
  ret i1 %result
}}"""
"""Function that finds a NaN or an infinity among numbers: such have the largest exponent."""


class _Code:
    """The lines of one function; rooms and places stand at its beginning."""

    def __init__(self) -> None:
        self._entry: list[str] = []
        self._lines: list[str] = []
        self._count = 0
        self._places: dict[tuple[int, str], str] = {}
        self.current = "entry"
        self.failures: list[tuple[int, str, str]] = []

    def __call__(self, line: str) -> None:
        self._lines.append(f"  {line}")

    def name(self, stem: str) -> str:
        self._count += 1
        return f"{stem}.{self._count}"

    def value(self, text: str) -> str:
        result = f"%{self.name('v')}"
        self(f"{result} = {text}")
        return result

    def label(self, name: str) -> None:
        self._lines.append(f"{name}:")
        self.current = name

    def jump(self, name: str) -> None:
        self(f"br label %{name}")
        self.label(name)

    def branch(self, condition: str, yes: str, no: str) -> None:
        self(f"br i1 {condition}, label %{yes}, label %{no}")
        self.label(yes)

    def at(self, place: int, base: str = "%self") -> str:
        """Return the address of a byte behind a pointer."""
        key = place, base
        if key not in self._places:
            result = f"%{self.name('p')}"
            self._entry.append(f"  {result} = getelementptr i8, ptr {base}, i64 {place}")
            self._places[key] = result
        return self._places[key]

    def room(self, leaf: str) -> str:
        result = f"%{self.name('r')}"
        self._entry.append(f"  {result} = alloca {leaf}")
        return result

    def copy(self, to: str, source: str, size: int) -> None:
        if size:
            self(f"call void @llvm.memcpy.p0.p0.i64(ptr {to}, ptr {source}, i64 {size}, i1 false)")

    def text(self) -> str:
        return "\n".join((*self._entry, *self._lines))


def _arrays(call: KernelCall) -> Iterator[tuple[NDArray[Any], int]]:
    """Yield the arrays of a call, and the number of the operand that is the address of each."""
    first = 0

    def walk(argument: Any) -> Iterator[tuple[NDArray[Any], int]]:
        nonlocal first
        kind: ArgumentType = type_of(argument)
        if isinstance(kind, RecordType):
            for each in argument:
                yield from walk(each)
            return
        if isinstance(kind, ArrayType):
            yield argument, first
        first += len(leaves(kind))

    for argument in call.arguments:
        yield from walk(argument)


def _bytes(name: str, data: bytes | bytearray) -> str:
    """Return a constant that no other file sees."""
    if not any(data):
        return f"@{name} = internal constant [{len(data)} x i8] zeroinitializer, align 64"
    words = np.frombuffer(bytes(data), "<i8")
    text = ", ".join(f"i64 {word}" for word in words)
    return f"@{name} = internal constant [{len(words)} x i64] [{text}], align 64"


def _string(name: str, text: str) -> str:
    data = text.encode() + b"\0"
    letters = "".join(f"\\{octet:02x}" for octet in data)
    return f'@{name} = internal constant [{len(data)} x i8] c"{letters}"'
