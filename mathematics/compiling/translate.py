"""Translation of a kernel to an object file, by LLVM.

The arguments are read from the words that ``arguments.pack`` wrote. Floating point is strict: no
reordering of sums and no fused multiply-add, so the machine code rounds as plain Python does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from .arguments import HEADER, ArgumentType, ArrayType
from .equations import expanded_definition
from .failures import FAILURES, CompileError, Site
from .kernel_expressions import Translated, origin_of
from .kernel_registry import is_kernel, written_code
from .llvm_code import leaves
from .machine_code import ENTRY, optimised
from .statements import translate


class Translator:
    """Compiles kernels; those that several kernels call are translated once."""

    def __init__(self) -> None:
        self._translated: dict[tuple[int, tuple[ArgumentType, ...]], Translated] = {}
        self._definitions: dict[int, Any] = {}
        self._open: set[tuple[int, tuple[ArgumentType, ...]]] = set()
        """The functions that are being translated at present."""

    def object_code(self, kernel: Callable[..., Any], signature: tuple[ArgumentType, ...]) -> bytes:
        """Return the object file of ``kernel`` for arguments of these types.

        Raises:
            CompileError: the kernel does what compiled code cannot.
        """
        return optimised(self.module(kernel, signature))

    def results(self, kernel: Callable[..., Any], signature: tuple[ArgumentType, ...]) -> int:
        """Return the number of results of a kernel for arguments of these types.

        Raises:
            CompileError: the kernel does what compiled code cannot.
        """
        return len(leaves(self._translate(kernel, signature).returns))

    def module(self, kernel: Callable[..., Any], signature: tuple[ArgumentType, ...]) -> str:
        """``kernel``, all that it calls and its entry point, in LLVM's language.

        Raises:
            CompileError: the kernel does what compiled code cannot.
        """
        made = self._translate(kernel, signature)
        name = f"{kernel.__module__}.{kernel.__qualname__}"
        return "\n".join((_with_callees([made]), _entry_point(made, name, signature), ATTRIBUTES))

    def functions(
        self, kernels: Sequence[tuple[Callable[..., Any], tuple[ArgumentType, ...]]]
    ) -> tuple[str, list[Translated]]:
        """Kernels for arguments of some types: the text of all with what they call, and each.

        Raises:
            CompileError: a kernel does what compiled code cannot.
        """
        made = [self._translate(kernel, signature) for kernel, signature in kernels]
        return _with_callees(made), made

    def failure(
        self, kernel: Callable[..., Any], signature: tuple[ArgumentType, ...], status: int
    ) -> tuple[Any, Site] | None:
        """Find the function and the site that a status tells; ``None`` where they are not known.

        Raises:
            CompileError: the kernel does what compiled code cannot.
        """
        place = (status >> 4 & 255) - 1
        for each in _closure([self._translate(kernel, signature)]):
            if (
                each.text
                and origin_of(each.function) == status >> 12
                and 0 <= place < len(each.sites)
            ):
                return each.function, each.sites[place]
        return None

    def _translate(self, kernel: Any, signature: tuple[ArgumentType, ...]) -> Translated:
        key = id(kernel), signature
        if key in self._open:
            raise CompileError(
                f"kernel {kernel.__module__}.{kernel.__qualname__} calls itself; write a loop, or an "
                "@numba.njit function, which kernels may call"
            )
        if key not in self._translated:
            if id(kernel) not in self._definitions:
                self._definitions[id(kernel)] = expanded_definition(kernel, written_code(kernel))
            name = f"{kernel.__module__}.{kernel.__qualname__}"
            tree = self._definitions[id(kernel)]
            if tree is None:
                raise CompileError(f"kernel {name} does not compile: its source is not in a file")
            name = f"{name}#{len(self._translated)}"
            self._open.add(key)
            try:
                self._translated[key] = translate(kernel, tree, signature, name, self._callee)
            finally:
                self._open.discard(key)
        return self._translated[key]

    def _callee(self, function: Any, signature: tuple[ArgumentType, ...]) -> Translated | None:
        if is_kernel(function):
            return self._translate(function, signature)
        if type(function).__module__.startswith("numba."):
            from .numba_calls import is_numba, numba_function

            return numba_function(function, signature) if is_numba(function) else None
        return None


def _with_callees(made: Sequence[Translated]) -> str:
    """Functions and all that they call, each once, behind what they call of libraries."""
    functions = _closure(made)
    declared: dict[str, str] = {}
    for each in functions:
        declared |= each.declared
    return "\n".join((*declared.values(), *(each.text for each in functions)))


def _closure(made: Sequence[Translated]) -> list[Translated]:
    """Return functions and all that they call, each once."""
    functions: dict[str, Translated] = {}
    pending = list(made)
    while pending:
        each = pending.pop()
        if each.name not in functions:
            functions[each.name] = each
            pending += each.callees.values()
    return list(functions.values())


ATTRIBUTES = """\
attributes #0 = { nounwind }
attributes #1 = { nounwind willreturn memory(none) }
attributes #2 = { nobuiltin }
!0 = !{!"branch_weights", i32 1, i32 4000}"""
"""Attributes that the functions of a module refer to, at its end."""


def _entry_point(made: Translated, name: str, signature: tuple[ArgumentType, ...]) -> str:
    """Write the function that reads the arguments from the words at an address and calls the
    kernel.

    A kernel raises no errors of its own; if one fails, the entry point sets Python's error, and the
    caller raises it.
    """
    lines: list[str] = []
    operands: list[str] = []
    place = HEADER

    def word(leaf: str) -> None:
        nonlocal place
        lines.append(f"  %p{place} = getelementptr i64, ptr %words, i64 {place}")
        if leaf == "i1":
            lines.append(f"  %w{place} = load i64, ptr %p{place}")
            lines.append(f"  %x{place} = icmp ne i64 %w{place}, 0")
        else:
            lines.append(f"  %x{place} = load {leaf}, ptr %p{place}")
        operands.append(f"{leaf} %x{place}")
        place += 1

    def read(kind: ArgumentType) -> None:
        nonlocal place
        if isinstance(kind, ArrayType):
            for leaf in leaves(kind)[: 1 + kind.dimensions]:
                word(leaf)
            if kind.order == "A":
                for _ in range(kind.dimensions):
                    word("i64")
            else:
                place += kind.dimensions
        elif parts := getattr(kind, "parts", ()):
            for part in parts:
                read(part)
        else:
            for leaf in leaves(kind):
                word(leaf)

    for kind in signature:
        read(kind)
    for k, leaf in enumerate(leaves(made.returns)):
        lines.append(f"  %r{k} = alloca {leaf}")
        operands.append(f"ptr %r{k}")
    kinds = sorted({site.failure for each in _closure([made]) for site in each.sites})
    messages, cases, blocks = [], [], []
    for failure in kinds:
        _, said = FAILURES[failure]
        text = f"compiled kernel {name} {said}\0".encode()
        letters = "".join(f"\\{octet:02x}" for octet in text)
        messages.append(f'@message{failure:d} = internal constant [{len(text)} x i8] c"{letters}"')
        cases.append(f"i32 {failure:d}, label %fail{failure:d}")
        blocks += [
            f"fail{failure:d}:",
            f"  call void %report(i64 %record, ptr @message{failure:d}, i64 %code)",
            "  ret void",
        ]
    return "\n".join(
        (
            *messages,
            f"define void @{ENTRY}(i64 %address) #0 {{",
            "  %words = inttoptr i64 %address to ptr",
            *lines,
            f'  %status = call i32 @"{made.name}"({", ".join(operands)})',
            "  %failed = icmp ne i32 %status, 0",
            "  br i1 %failed, label %fail, label %done, !prof !0",
            "fail:",
            "  %report = load ptr, ptr %words",
            "  %second = getelementptr i64, ptr %words, i64 1",
            "  %record = load i64, ptr %second",
            "  %code = zext i32 %status to i64",
            "  %kind = and i32 %status, 15",
            f"  switch i32 %kind, label %done [ {' '.join(cases)} ]",
            *blocks,
            "done:",
            "  ret void",
            "}",
        )
    )
