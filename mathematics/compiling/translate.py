"""From a kernel to an object file, by numba.

The arguments are read from the words that ``arguments.pack`` wrote. Floating point is strict: no
reordering of sums and no fused multiply-add, so the machine code rounds as plain Python does.
Memory management is off, so that a kernel that would allocate an array does not compile.
"""

from __future__ import annotations

import types as python_types
from collections.abc import Callable
from typing import Any

from ..kernel import expand
from .arguments import HEADER, ArgumentType, ArrayType, NumberType
from .kernel_registry import kernels, written_code
from .linking import LIBRARY, linked_once
from .machine_code import ENTRY, assemble
from .pipeline import kernel_pipeline


class CompileError(Exception):
    """A kernel cannot be compiled; the text says which and why."""


class Translator:
    """Compiles kernels; those that several kernels call are prepared once.

    Raises:
        ImportError: numba is not installed.
    """

    def __init__(self) -> None:
        import numba

        self._numba: Any = numba
        self._marked = {id(function): name for name, function in kernels().items()}
        self._dispatchers: dict[str, Any] = {}

    def object_code(self, kernel: Callable[..., Any], signature: tuple[ArgumentType, ...]) -> bytes:
        """The object file of ``kernel`` for arguments of these types.

        Raises:
            CompileError: numba refuses the kernel.
        """
        name = f"{kernel.__module__}.{kernel.__qualname__}"
        try:
            with linked_once():
                return self._compile(self._prepare(kernel), name, signature)
        except Exception as error:
            raise CompileError(f"kernel {name} does not compile: {_reason(error)}") from error

    def _prepare(self, kernel: Any) -> Any:
        """numba's dispatcher of a kernel, in whose scope the kernels it calls are dispatchers."""
        name = self._marked.get(id(kernel), f"{kernel.__module__}.{kernel.__qualname__}")
        if name not in self._dispatchers:
            expand(kernel)
            scope = dict(kernel.__globals__)
            for used in written_code(kernel).co_names:
                if id(scope.get(used)) in self._marked:
                    scope[used] = self._prepare(scope[used])
            copy = python_types.FunctionType(kernel.__code__, scope, kernel.__name__)
            copy.__module__ = kernel.__module__
            self._dispatchers[name] = dispatcher = self._numba.njit(
                copy,
                fastmath=False,
                error_model="python",
                _nrt=False,
                no_cpython_wrapper=True,
                no_cfunc_wrapper=True,
                pipeline_class=kernel_pipeline(),
            )
            dispatcher.get_call_template = _for_any_value(dispatcher.get_call_template)
        return self._dispatchers[name]

    def _compile(self, dispatcher: Any, name: str, signature: tuple[ArgumentType, ...]) -> bytes:
        numba = self._numba
        read = _reader(tuple(self._numba_type(part) for part in signature))

        def entry(address: int) -> None:
            dispatcher(*read(address))

        compiled = numba.njit(
            numba.types.void(numba.types.intp),
            fastmath=False,
            error_model="python",
            _nrt=False,
            no_cpython_wrapper=True,
            no_cfunc_wrapper=True,
        )(entry)
        library = _with_entry_point(next(iter(compiled.overloads.values())), name)
        return assemble(library.get_llvm_str())

    def _numba_type(self, part: ArgumentType) -> Any:
        numba = self._numba
        if isinstance(part, NumberType):
            kinds = {"float": "float64", "int": "int64", "bool": "boolean"}
            return getattr(numba.types, kinds[part.kind])
        if isinstance(part, ArrayType):
            dtype = numba.from_dtype(_dtype(part.dtype))
            return numba.types.Array(dtype, part.dimensions, part.order)
        parts = [self._numba_type(inner) for inner in part.parts]
        return numba.types.BaseTuple.from_types(parts, part.kind)


def _for_any_value(find: Callable[..., Any]) -> Callable[..., Any]:
    """``get_call_template`` of a dispatcher for arguments of which numba knows the value.

    A variable that begins as zero is that zero for numba until it has met all that is assigned to it.
    By itself it compiles a kernel for the zero first and for any number later, and all that the
    kernel calls with it; of several such arguments every combination.
    """

    def find_for_any(args: Any, kws: Any) -> Any:
        from numba.core.types import unliteral

        return find(
            tuple(unliteral(arg) for arg in args), {k: unliteral(arg) for k, arg in kws.items()}
        )

    return find_for_any


def _reason(error: Exception) -> str:
    """What numba's message says, in one line."""
    text = str(error)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if "NRT required" in text or "ol_np_empty" in text:
        place = next((line for line in lines if line.startswith(("During: lowering", "File"))), "")
        return f"it allocates an array, or copies one by a slice; {place}"[:300]
    telling = [line for line in lines if "rror" in line or "nvalid" in line]
    return " ".join((telling or lines or [type(error).__name__])[:1])[:300]


def _dtype(name: str) -> Any:
    import numpy as np

    return np.dtype(name)


def _reader(parts: tuple[Any, ...]) -> Any:
    """A function for numba that reads the arguments from the words at an address."""
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    word = ir.IntType(64)
    everything = types.Tuple(parts)

    @intrinsic  # type: ignore[untyped-decorator]  # numba is not typed
    def read(context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            words = builder.inttoptr(values[0], word.as_pointer())

            def value_at(kind: Any, place: int) -> tuple[Any, int]:
                pointer = builder.gep(words, [ir.Constant(word, place)])
                if isinstance(kind, types.Array):
                    record = context.get_value_type(kind)
                    loaded = builder.load(builder.bitcast(pointer, record.as_pointer()))
                    return loaded, place + 5 + 2 * kind.ndim
                if isinstance(kind, types.BaseTuple):
                    parts = []
                    for inner in kind.types:
                        part, place = value_at(inner, place)
                        parts.append(part)
                    return context.make_tuple(builder, kind, parts), place
                if isinstance(kind, types.Boolean):
                    return builder.trunc(builder.load(pointer), ir.IntType(1)), place + 1
                if isinstance(kind, types.Float):
                    double = builder.bitcast(pointer, ir.DoubleType().as_pointer())
                    return builder.load(double), place + 1
                return builder.load(pointer), place + 1

            return value_at(everything, HEADER)[0]

        return everything(types.intp), generate

    return read


def _with_entry_point(result: Any, name: str) -> Any:
    """A library with the compiled function behind the plain calling convention of C.

    A kernel raises no errors of its own; if one divides by zero, the entry point sets Python's
    error, and the caller raises it.
    """
    from llvmlite import ir
    from numba.core import types
    from numba.core.compiler_lock import global_compiler_lock

    context, codegen = result.target_context, result.library.codegen
    library = codegen.create_library(f"{LIBRARY}{name}")
    module = library.create_ir_module(f"aloft.{name}")
    byte, word = ir.IntType(8).as_pointer(), ir.IntType(64)
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [word]), ENTRY)
    builder = ir.IRBuilder(entry.append_basic_block())
    convention = context.call_conv
    kind = convention.get_function_type(result.signature.return_type, result.signature.args)
    function = ir.Function(module, kind, result.fndesc.llvm_func_name)
    (address,) = entry.args
    status, _ = convention.call_function(
        builder, function, types.void, result.signature.args, [address]
    )
    with builder.if_then(status.is_error, likely=False):
        text = bytearray(f"compiled kernel {name} divided by zero".encode() + b"\0")
        constant = ir.Constant(ir.ArrayType(ir.IntType(8), len(text)), text)
        message = ir.GlobalVariable(module, constant.type, "aloft_message")
        message.linkage, message.global_constant = "internal", True
        message.initializer = constant
        words = builder.inttoptr(address, word.as_pointer())
        report = builder.load(words)
        error = builder.load(builder.gep(words, [ir.Constant(word, 1)]))
        set_error = ir.FunctionType(ir.VoidType(), [word, byte]).as_pointer()
        builder.call(builder.inttoptr(report, set_error), [error, builder.bitcast(message, byte)])
    builder.ret_void()
    library.add_ir_module(module)
    library.add_linking_library(result.library)
    with global_compiler_lock:
        library.finalize()
    return library
