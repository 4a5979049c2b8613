"""Lets numba link a kernel with all that it calls once, and make machine code of nothing else.

By itself numba optimises every function when it is compiled, links it into every function that calls
it, optimises it there again, and turns it into machine code in memory each time. Of a kernel only
the object file is wanted, so here a function stays as it is until a kernel needs it; only the
kernel is linked and optimised. Where a version of numba does it in another way, that stays as it
is, which takes longer and gives the same object file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

LIBRARY = "aloft kernel "
"""How the names of numba's libraries with an entry point begin."""


@contextmanager
def linked_once() -> Iterator[None]:
    """Within the context numba links as the module's text says."""
    from numba.core import codegen, cpu

    generator: Any = getattr(codegen, "JITCPUCodegen", None)
    context: Any = getattr(cpu, "CPUContext", None)
    if not hasattr(generator, "_library_class") or not hasattr(context, "get_executable"):
        yield
        return
    kept = generator._library_class, context.get_executable
    generator._library_class, context.get_executable = _library_kind(), _not_executable
    try:
        yield
    finally:
        generator._library_class, context.get_executable = kept


def _not_executable(context: Any, library: Any, description: Any, environment: Any) -> Any:
    """What numba keeps instead of a function that Python could call: none is made here."""
    from numba import _dynfunc

    name = description.qualname.split(".")[-1]
    module = description.lookup_module()
    return _dynfunc.make_function(module, name, "", 0, environment, (library,))


@cache
def _library_kind() -> Any:
    """The kind of library in which numba keeps a compiled function here."""
    from numba.core.codegen import CPUCodeLibrary

    class Library(CPUCodeLibrary):  # type: ignore[misc]  # numba is not typed
        """One function in LLVM's language, and the libraries of the functions that it calls."""

        _whole = False

        def add_linking_library(self, library: Any) -> None:
            self._linking_libraries.append(library)

        def finalize(self) -> None:
            self._raise_if_finalized()
            if self.name.startswith(LIBRARY):
                self._link()
                self._optimize_final_module()
                self._final_module.verify()
            self._finalized = True

        def _link(self) -> None:
            """Add everything that this function calls, at whatever depth."""
            self._whole = True
            for library in _all_below(self):
                part = library.only_this() if isinstance(library, Library) else None
                part = part or library._get_module_for_linking()
                self._final_module.link_in(part, preserve=True)

        def only_this(self) -> Any:
            """The function without those it calls, in a form that can be linked several times."""
            return super()._get_module_for_linking()

        def _get_module_for_linking(self) -> Any:
            """What a library of numba's own asks for, which wants everything at once."""
            if not self._whole:
                self._link()
                self._shared_module = None
            return super()._get_module_for_linking()

        def _optimize_functions(self, module: Any) -> None:
            """Nothing: the kernel is optimised as a whole."""
            module.data_layout = self._codegen._data_layout

        def _optimize_final_module(self) -> None:
            manager, builder = self._codegen._module_pass_manager()
            manager.run(self._final_module, builder)

        def get_pointer_to_function(self, name: str) -> int:
            return 0

    return Library


def _all_below(library: Any) -> list[Any]:
    """The libraries that one needs, each once, in the order in which they are met."""
    found: dict[Any, None] = {}
    pending = list(library._linking_libraries)
    while pending:
        other = pending.pop(0)
        if other is not library and other not in found:
            found[other] = None
            pending += other._linking_libraries
    return list(found)
