"""Functions of Numba that kernels call: each gets a C function of a kernel's own convention.

A kernel calls ``i32 symbol(leaves of the arguments..., ptr to each result)``. Numba compiles that function once;
its object file is kept beside those of kernels, so a later process compiles nothing; only code that needs objects of
Python, such as what ``print`` writes, is made anew. Plain Python calls the ``@numba.njit`` function itself, so all
tiers run Numba's machine code.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
import textwrap
from collections.abc import Iterator
from importlib.metadata import version
from itertools import pairwise
from types import CodeType
from typing import Any

import numpy as np

from . import store
from .arguments import ArgumentType, ArrayType, NumberType, RecordType
from .failures import CompileError
from .kernel_expressions import Translated
from .llvm_code import leaves
from .machine_code import linked, object_of, tools

SYMBOL = "numba_"
"""Beginning of the names of the made functions; 32 hexadecimal digits follow."""

NO_CODE = "does not compile"
_OBJECTS = {"print", "objmode"}
"""Names in functions that need objects of Python, which Numba keeps in its own process; others need them for errors only."""

_addresses: dict[str, int] = {}
_alive: list[Any] = []
_made: dict[tuple[int, tuple[ArgumentType, ...]], Translated] = {}


def is_numba(function: object) -> bool:
    """Return whether a function is one of ``@numba.njit``; Numba is not imported for that."""
    kind = type(function)
    return (
        kind.__module__.startswith("numba.")
        and hasattr(kind, "inspect_llvm")
        and hasattr(function, "py_func")
    )


def name_of(function: Any) -> str:
    """Return a function's name with its module."""
    return f"{function.py_func.__module__}.{function.py_func.__qualname__}"


def functions_below(function: Any) -> list[Any]:
    """Return a function of Numba and those that it calls, each once."""
    found: dict[int, Any] = {}
    pending = [function]
    while pending:
        each = pending.pop()
        if id(each) not in found:
            found[id(each)] = each
            pending += [value for _, value in _outer_values(each.py_func) if is_numba(value)]
    return list(found.values())


def _outer_values(function: Any) -> Iterator[tuple[str, Any]]:
    """Yield what a function reads of its module and of the functions around it."""
    for code in _codes(function.__code__):
        for name in code.co_names:
            if name in function.__globals__:
                yield name, function.__globals__[name]
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=False):
        yield name, cell.cell_contents


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def source_of(function: Any) -> str:
    """Return what the machine code of a function depends on, in all that it calls."""
    texts = [f"numba {version('numba')}, with its objects"]
    for each in functions_below(function):
        texts.append(
            f"{name_of(each)} {sorted(each.targetoptions.items())!r} {each.py_func.__defaults__!r}"
        )
        for code in _codes(each.py_func.__code__):
            constants = [c for c in code.co_consts if not isinstance(c, CodeType)]
            texts.append(
                f"{code.co_code.hex()} {constants!r} {code.co_names!r} {code.co_varnames!r}"
            )
        for name, value in _outer_values(each.py_func):
            if isinstance(value, np.ndarray):
                texts.append(
                    f"{name}={value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
                )
            elif isinstance(value, bool | int | float | str | tuple):
                texts.append(f"{name}={value!r}")
    return "|".join(texts)


def names_read(function: Any) -> set[str]:
    """Return all attributes that a function of Numba, and those that it calls, name."""
    return {
        name
        for each in functions_below(function)
        for code in _codes(each.py_func.__code__)
        for name in code.co_names
    }


def unseeded(function: Any) -> str:
    """Return which function draws random numbers without a seed of its own; empty where none does."""
    for each in functions_below(function):
        values = dict(_outer_values(each.py_func))
        names = {name for code in _codes(each.py_func.__code__) for name in code.co_names}
        drawn = any(
            getattr(value, "__name__", "") in ("random", "numpy.random")
            for value in values.values()
        ) or ("random" in names and any(value is np for value in values.values()))
        if drawn and "seed" not in names:
            return name_of(each)
    return ""


def uses_blas(function: Any) -> str:
    """Return which function multiplies or solves by BLAS or LAPACK; empty where none does."""
    for each in functions_below(function):
        names = {name for code in _codes(each.py_func.__code__) for name in code.co_names}
        if names & {"linalg", "dot", "vdot", "matmul"} or "@" in _operators(each.py_func):
            return name_of(each)
    return ""


def _operators(function: Any) -> set[str]:
    import inspect

    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, SyntaxError, TypeError):
        return set()
    return {"@" for node in ast.walk(tree) if isinstance(node, ast.MatMult)}


def numba_function(function: Any, signature: tuple[ArgumentType, ...]) -> Translated:
    """Return a function of Numba for arguments of these types, as kernels call it.

    Raises:
        CompileError: Numba does not compile it, it returns no numbers, or it draws random numbers.
    """
    key = id(function), signature
    if key not in _made:
        _made[key] = _make(function, signature)
    return _made[key]


def address_of(symbol: str) -> int:
    """Return the address of a made function, from memory or from the cache.

    Raises:
        ValueError: it is not there; the kernel that calls it is translated again.
    """
    if symbol not in _addresses:
        kept = store.load(symbol.removeprefix(SYMBOL))
        if kept is None:
            raise ValueError(f"{symbol} is not in the cache")
        head, _, code = kept.partition(b"\n")
        library = linked(code, symbol, _needed(json.loads(head)["needs"]))
        _alive.append(library)
        _addresses[symbol] = library[symbol]
    return _addresses[symbol]


def _needed(names: list[str]) -> dict[str, int]:
    """Find the functions of Numba's runtime that an object file needs.

    Raises:
        ValueError: one is not there.
    """
    from llvmlite import binding

    found = {name: binding.address_of_symbol(name) for name in names}
    if not all(found.values()):
        _start_numba()
        found = {name: binding.address_of_symbol(name) for name in names}
    missing = [name for name, address in found.items() if not address]
    if missing:
        raise ValueError(f"Numba has no {missing[0]}")
    return {name: address for name, address in found.items() if address}


def _start_numba() -> None:
    """Let Numba make its runtime, which adds the functions that its machine code needs."""
    import numba

    def nothing() -> int:
        return 0

    _alive.append(numba.cfunc(numba.types.int32())(nothing))


def _make(function: Any, signature: tuple[ArgumentType, ...]) -> Translated:
    from numba import types

    name = name_of(function)
    if drawing := unseeded(function):
        raise CompileError(
            f"numba function {drawing} draws random numbers without a seed, so no run could be repeated; "
            "let a block such as blocks.WhiteNoise draw them"
        )
    kinds = tuple(_type(part) for part in signature)
    try:
        function.compile(kinds)
    except Exception as error:  # whatever Numba says
        raise CompileError(f"numba function {name} {NO_CODE}: {_reason(error)}") from error
    result = function.overloads[kinds].signature.return_type
    several = isinstance(result, types.BaseTuple)
    parts = () if result is types.none else tuple(result) if several else (result,)
    returns = tuple(_number(part, name) for part in parts)
    digest = hashlib.blake2b(f"{tools()}|{source_of(function)}|".encode(), digest_size=16)
    digest.update("|".join(map(str, signature)).encode())
    symbol = f"{SYMBOL}{digest.hexdigest()}"
    if not store.holds(symbol.removeprefix(SYMBOL)):
        entry = _entry(function, signature, returns, several)
        _alive.append(entry)
        if names_read(function) & _OBJECTS:
            _addresses[symbol] = entry.address
        else:
            code, needs = object_of(entry.inspect_llvm(), entry.native_name, symbol)
            kept = json.dumps({"needs": needs}).encode() + b"\n" + code
            store.save(symbol.removeprefix(SYMBOL), kept)
            _addresses.setdefault(symbol, linked_address(code, symbol, needs))
    operands = [
        leaf + (" zeroext" if leaf == "i1" else "") for kind in signature for leaf in leaves(kind)
    ]
    takes = ", ".join([*operands, *("ptr" for _ in returns)])
    made: ArgumentType = (
        returns[0] if len(returns) == 1 and not several else RecordType(tuple, returns)
    )
    declared = {symbol: f"declare i32 @{symbol}({takes})"}
    return Translated(symbol, "", made, True, {}, declared, function)


def _reason(error: Exception) -> str:
    """Return why Numba does not compile a function, with the line: the first reason of its own, without its candidates."""
    text = re.sub(r"\x1b\[\d*m", "", str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    lines = [line for line in lines if not line.startswith("Failed in nopython mode pipeline")]
    own = [after for line, after in pairwise(lines) if line.endswith("raised a specific error:")]
    place = re.search(r'File "(.+?)", line (\d+):', text)
    where = f"line {place[2]} of {place[1]}: " if place else ""
    return where + (own[0] if own else " ".join(lines[:2]))[:300]


def linked_address(code: bytes, symbol: str, needs: list[str]) -> int:
    """Link an object file now, and return the address of its function."""
    library = linked(code, symbol, _needed(needs))
    _alive.append(library)
    address: int = library[symbol]
    return address


def _entry(
    function: Any,
    signature: tuple[ArgumentType, ...],
    returns: tuple[NumberType, ...],
    several: bool,
) -> Any:
    """Let Numba compile the function that makes arrays and records of the leaves, and calls."""
    import numba
    from numba import types

    scope: dict[str, Any] = {
        "function": function, "carray": numba.carray, "farray": numba.farray,
        "as_strided": np.lib.stride_tricks.as_strided,
    }  # fmt: skip
    names: list[str] = []
    c_types: list[Any] = []

    def argument(kind: ArgumentType) -> str:
        if isinstance(kind, RecordType):
            record = f"Record{len(scope)}"
            scope[record] = kind.kind
            return f"{record}({', '.join([argument(part) for part in kind.parts])})"
        first = len(names)
        for leaf in leaves(kind):
            names.append(f"a{len(names)}")
            c_types.append(
                {"double": types.float64, "i64": types.int64, "i1": types.boolean}.get(leaf)
            )
        if not isinstance(kind, ArrayType):
            return names[first]
        c_types[first] = types.CPointer(numba.from_dtype(np.dtype(kind.dtype)))
        n = kind.dimensions
        shape = "(" + "".join(f"a{first + 1 + k}, " for k in range(n)) + ")"
        if kind.order == "A":
            strides = "(" + "".join(f"a{first + 1 + n + k}, " for k in range(n)) + ")"
            return f"as_strided(carray(a{first}, (1,)), {shape}, {strides})"
        return f"{'carray' if kind.order == 'C' else 'farray'}(a{first}, {shape})"

    operands = [argument(kind) for kind in signature]
    numbers = {"float": types.float64, "int": types.int64, "bool": types.boolean}
    for k, kind in enumerate(returns):
        names.append(f"r{k}")
        c_types.append(types.CPointer(numbers[kind.kind]))
    call = f"function({', '.join(operands)})"
    lines = [f"result = {call}" if returns else call]
    lines += [f"r{k}[0] = result{f'[{k}]' if several else ''}" for k in range(len(returns))]
    body = textwrap.indent("\n".join(lines), " " * 8)
    text = f"def entry({', '.join(names)}):\n    try:\n{body}\n    except Exception:\n        return 1\n    return 0\n"
    exec(text, scope)  # noqa: S102  # of the text above
    return numba.cfunc(types.int32(*c_types))(scope["entry"])


def _number(part: Any, name: str) -> NumberType:
    from numba import types

    for kind, of in ((types.Boolean, "bool"), (types.Integer, "int"), (types.Float, "float")):
        if isinstance(part, kind):
            return NumberType(of)
    raise CompileError(
        f"numba function {name} returns {part}; a kernel takes numbers, or a tuple of numbers: "
        "let it write into an array that it gets"
    )


def _type(part: ArgumentType) -> Any:
    import numba
    from numba import types

    if isinstance(part, NumberType):
        return {"float": types.float64, "int": types.int64, "bool": types.boolean}[part.kind]
    if isinstance(part, ArrayType):
        return types.Array(numba.from_dtype(np.dtype(part.dtype)), part.dimensions, part.order)
    return types.BaseTuple.from_types([_type(inner) for inner in part.parts], part.kind)
