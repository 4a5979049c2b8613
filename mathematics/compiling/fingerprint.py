"""Fingerprint of the machine code of a kernel, a short text that names its file in the cache.

It covers the byte code of the kernel and of all kernels that it calls, in whichever module, and the
constants that they read. Comments, line numbers and the place of the source count for nothing.
Byte code differs between versions of Python. What a wheel brings along is named by the files of the
sources instead.
"""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable, Iterator, Mapping
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from .arguments import ArgumentType
from .expressions import VERSION
from .kernel_registry import is_kernel, reports_event, written_code
from .kinds import argument_kinds
from .store import file_digest


def fingerprint(
    kernel: Callable[..., Any],
    signature: tuple[ArgumentType, ...],
    tools: str,
    *,
    by_source: bool = False,
    known: dict[Any, bytes] | None = None,
) -> str:
    """Return the name (32 hexadecimal digits) of the machine code of ``kernel`` for these types.

    Args:
        tools: whatever else decides on the machine code: versions, options, the processor.
        by_source: whether the content of the kernels' files counts, and not their byte code.
        known: what other kernels of the same moment have found of the functions that they share.

    Raises:
        OSError: a source file cannot be read, with ``by_source``.
    """
    digest = hashlib.blake2b(digest_size=16)
    digest.update(f"{tools}; equations {VERSION}; {_numbers_digest()}".encode())
    for part in signature:
        digest.update(f"|{part}".encode())
    functions = closure(kernel)
    if by_source:  # in an order that the byte code has no part in
        functions = functions[:1] + sorted(functions[1:], key=_name)
    for function in functions:
        text = None if known is None else known.get(function)
        if text is None:
            parts = (f"|{function.__qualname__}", *_texts(function, by_source))
            text = "".join(parts).encode()
            if known is not None:
                known[function] = text
        digest.update(text)
    return digest.hexdigest()


def _name(function: Any) -> tuple[str, str]:
    return function.__module__, function.__qualname__


def closure(kernel: Any) -> list[Any]:
    """Return the kernel and all that it calls, each once, in the order in which they are met."""
    found: dict[int, Any] = {}
    pending = [kernel]
    while pending:
        function = pending.pop()
        if id(function) not in found:
            found[id(function)] = function
            pending += _called(function)
    return list(found.values())


def numba_functions(kernel: Any) -> list[Any]:
    """Return the functions of Numba that a kernel, and those that it calls, name."""
    from .numba_calls import is_numba

    found: dict[int, Any] = {}
    for each in closure(kernel):
        for name in written_code(each).co_names:
            value = each.__globals__.get(name)
            if is_numba(value):
                found[id(value)] = value
    return list(found.values())


def _called(function: Any) -> list[Any]:
    """Return the kernels that a function names."""
    scope = function.__globals__
    values = (scope.get(name) for name in written_code(function).co_names)
    return [value for value in values if is_kernel(value)]


def _texts(function: Any, by_source: bool) -> Iterator[str]:
    """Yield the byte code or the source of a function, and the constants of its module that it
    reads."""
    code = written_code(function)
    if by_source:
        yield file_digest(code.co_filename)
    else:
        yield from _code_texts(code)
    yield f"|{argument_kinds(function)}{reports_event(function)}"
    scope: Mapping[str, Any] = function.__globals__
    for name in sorted(set(code.co_names)) if by_source else code.co_names:
        if name in scope and not is_kernel(scope[name]):
            value = scope[name]
            if isinstance(value, type) and issubclass(value, IntEnum):
                yield f"|{name}={[(member.name, int(member)) for member in value]}"
                continue
            if type(value).__module__.startswith("numba."):
                from .numba_calls import is_numba, source_of

                if is_numba(value):
                    yield f"|{name}={source_of(value)}"
                    continue
            if isinstance(value, np.ndarray):  # whose text leaves elements out
                digest = hashlib.blake2b(np.ascontiguousarray(value).tobytes(), digest_size=16)
                yield f"|{name}={value.dtype}{value.shape}{digest.hexdigest()}"
                continue
            plain = isinstance(value, types.ModuleType | type) or callable(value)
            yield f"|{name}={getattr(value, '__name__', '') if plain else repr(value)}"


@cache
def _numbers_digest() -> str:
    """Return the digest of what rewritten equations may call."""
    folder = Path(__file__).parent
    files = folder / "numpy_numbers.py", folder.parent / "elementary.py"
    return " ".join(file_digest(str(file)) for file in files)


def _code_texts(code: types.CodeType) -> Iterator[str]:
    yield code.co_code.hex()
    yield repr((code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars))
    yield str(code.co_argcount)
    documented = bool(code.co_consts) and isinstance(code.co_consts[0], str)
    for constant in code.co_consts[1:] if documented else code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _code_texts(constant)
        else:
            yield f"|{constant!r}"
