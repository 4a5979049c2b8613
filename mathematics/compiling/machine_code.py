"""Machine code in memory: LLVM's language becomes an object file, and this a function of one address."""

from __future__ import annotations

import ctypes
import hashlib
import os
import re
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from itertools import count
from typing import Any

from ...files.cache import Cache
from . import store
from .object_file import place

ENTRY = "aloft_entry"
"""The name of the only function that the object file of a kernel exports."""
OPTIONS = "strict floating point, errors as in Python, loops kept, O2, 6"
"""Options of the compiler; the number at the end counts changes of the calling convention."""
OLDEST = {
    "x86_64-unknown-linux-gnu": "x86-64",
    "aarch64-unknown-linux-gnu": "generic",
    "wasm32-unknown-unknown": "generic",
}
"""LLVM's name of the oldest processor of a kind, whose code runs on all of the kind."""


@cache
def tools() -> str:
    """Return the versions, options and processor on which machine code depends.

    Raises:
        ImportError: there is no LLVM.
    """
    import platform

    names = (
        f"python {platform.python_version()}",
        f"llvmlite {llvm_version()}",
        f"{process_triple()} {' '.join(processor())}",
        OPTIONS,
    )
    return "; ".join(names)


def llvm_version() -> str:
    """Return llvmlite's version, which its package tells sooner than a search through all that are installed.

    Raises:
        ImportError: there is no LLVM.
    """
    import llvmlite

    return str(llvmlite.__version__)


_HOSTS = Cache("processors")


@cache
def _host() -> tuple[str, str, str]:
    """Return LLVM's name of the kind of system, of this processor and of its features, without LLVM where it has told
    them before."""
    name = hashlib.blake2b(
        f"host; llvmlite {llvm_version()}; {_processor_text()}".encode(), digest_size=16
    ).hexdigest()
    kept = _HOSTS.load(name) if _processor_text() else None
    if kept is None:
        binding = _binding()
        features = binding.get_host_cpu_features().flatten()
        names = binding.get_process_triple(), binding.get_host_cpu_name()
        kept = "\n".join([*names, features]).encode()
        if _processor_text():
            _HOSTS.save(name, kept)
    triple, cpu, features = kept.decode().split("\n")
    return triple, cpu, features


@cache
def _processor_text() -> str:
    """Return what Linux says of the first processor, without what changes; empty elsewhere."""
    try:
        with open("/proc/cpuinfo", "rb") as file:
            lines = file.read(8192).decode(errors="replace").split("\n\n")[0].splitlines()
    except OSError:
        return ""
    same = ("vendor_id", "cpu family", "model", "stepping", "flags")
    return "\n".join(line for line in lines if line.partition("\t")[0].strip() in same)


@cache
def _binding() -> Any:
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding


def process_triple() -> str:
    """LLVM's name of the kind of processor and system that this process runs on."""
    return _host()[0]


def processor() -> tuple[str, str]:
    """LLVM's name of the processor for which code is made, and its features.

    It is this computer's, or the one that ``ALOFT_CPU_NAME`` and ``ALOFT_CPU_FEATURES`` name.
    The results are the same bits for all of them.
    """
    if name := os.environ.get("ALOFT_CPU_NAME"):
        return name, os.environ.get("ALOFT_CPU_FEATURES", "")
    return _host()[1:]


def target_machine() -> Any:
    """Make LLVM's target machine, which emits the code."""
    binding, (name, features) = _binding(), processor()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=name,
        features=features,
        opt=3,
        reloc="pic",
        codemodel="jitdefault",
    )


def optimised(assembly: str) -> bytes:
    """Return the object file of a module in LLVM's language, which LLVM optimises as far as it can.

    Raises:
        RuntimeError: the module is not valid.
    """
    machine = target_machine()
    module = _optimised(assembly, process_triple(), machine)
    code: bytes = machine.emit_object(module)
    return code


def cross_compiled(assembly: str, triple: str, cpu: str, features: str = "") -> bytes:
    """Return the object file of a module for another kind of processor.

    Raises:
        RuntimeError: the module is not valid, or LLVM has no such processor.
    """
    module, machine = _for_processor(assembly, triple, cpu, features)
    code: bytes = machine.emit_object(module)
    return code


def assembler_text(assembly: str, triple: str, cpu: str, features: str = "") -> str:
    """Return the same code as ``cross_compiled`` gives, as a text for an assembler.

    Raises:
        RuntimeError: the module is not valid, or LLVM has no such processor.
    """
    module, machine = _for_processor(assembly, triple, cpu, features)
    text: str = machine.emit_assembly(module)
    return text


def _for_processor(assembly: str, triple: str, cpu: str, features: str) -> tuple[Any, Any]:
    """Return a module, optimised for a processor, and its target machine."""
    binding = _binding()
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    target = binding.Target.from_triple(triple)
    machine = target.create_target_machine(cpu=cpu, features=features, opt=3, reloc="pic")
    return _optimised(assembly, triple, machine), machine


def _optimised(assembly: str, triple: str, machine: Any) -> Any:
    """Parse a module's text and optimise it."""
    binding = _binding()
    module = binding.parse_assembly(assembly)
    module.triple = triple
    module.data_layout = str(machine.target_data)
    module.verify()
    options = binding.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization, options.slp_vectorization = True, False
    options.loop_unrolling = False  # a third of the time of compiling, and no gain in a tick
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return module


def read_only_arguments(assembly: str, names: set[str]) -> dict[str, tuple[bool, ...]]:
    """Return, for each operand of some functions of a module, whether nothing is written through
    it.

    It is what LLVM can prove; an operand that is no address counts as such.

    Raises:
        RuntimeError: the module is not valid.
    """
    binding, machine = _binding(), target_machine()
    # functions that others could replace are not looked into, hence: internal, and used by nobody
    module = binding.parse_assembly(assembly)
    options = binding.create_pipeline_tuning_options(speed_level=1)
    builder = binding.create_pass_builder(machine, options)
    functions = [each for each in module.functions if each.name in names]
    for each in functions:
        each.linkage = "external"
    manager = binding.create_new_module_pass_manager()
    manager.add_sroa_pass()
    manager.add_simplify_cfg_pass()
    manager.add_post_order_function_attributes_pass()
    manager.run(module, builder)
    return {
        each.name: tuple(
            str(a.type) != "ptr" or any(w in (b"readonly", b"readnone") for w in a.attributes)
            for a in each.arguments
        )
        for each in functions
    }


def assemble(assembly: str) -> bytes:
    """Return the object file of a module in LLVM's language, which has been optimised already."""
    module = _binding().parse_assembly(assembly)
    code: bytes = target_machine().emit_object(module)
    return code


def object_of(assembly: str, name: str, symbol: str) -> tuple[bytes, list[str]]:
    """Return the object file of a module that Numba has optimised, with one of its functions under
    another name, and the names of what it needs from outside."""
    module = _binding().parse_assembly(assembly)
    module.get_function(name).name = symbol
    needs = [
        each.name for each in (*module.functions, *module.global_variables)
        if each.is_declaration and not each.name.startswith("llvm.")
    ]  # fmt: skip
    code: bytes = target_machine().emit_object(module)
    return code, needs


def linked(code: bytes, symbol: str, needs: Mapping[str, int]) -> Any:
    """Link an object file with functions at some addresses; the library gives the address of its
    ``symbol``.

    Raises:
        RuntimeError: the object file is damaged, or of another kind.
    """
    library = _binding().JITLibraryBuilder().add_object_img(code).add_current_process()
    for name, address in needs.items():
        library = library.import_symbol(name, address)
    return library.export_symbol(symbol).link(_linker(), f"kernel{next(_numbers)}")


_NUMBA = re.compile(rb"numba_[0-9a-f]{32}")


def _called_of_numba(code: bytes) -> dict[str, int]:
    """Find the functions of Numba that an object file calls. Raises ``ValueError`` where one is not
    kept any more."""
    names = {each.decode() for each in _NUMBA.findall(code)}
    if not names:
        return {}
    found = import_module(
        f"{__package__}.numba_calls"
    )  # which needs this file, and is rarely needed
    return {name: found.address_of(name) for name in names}


class MachineCode:
    """The function in an object file, ready to be called with the address of packed arguments.

    Raises:
        RuntimeError, ValueError: the object file is damaged, or of another kind.
    """

    def __init__(self, code: bytes) -> None:
        # kept, because the code goes with it; one linker for all takes a third of the time of one each
        needs = _called_of_numba(code)
        if placed := None if needs else place(code, ENTRY):
            self._loaded: Any = placed
            self.address: int = placed.address
        else:
            self._loaded = linked(code, ENTRY, needs)
            self.address = self._loaded[ENTRY]
        if not self.address:
            raise ValueError(f"the machine code has no function {ENTRY}")
        # This kind of prototype keeps the interpreter's lock and reports a Python error that the
        # function has set.
        function: Any = ctypes.PYFUNCTYPE(None, ctypes.c_size_t)(self.address)
        self.function: Callable[[ctypes.c_size_t], None] = function


@cache
def _linker() -> Any:
    return _binding().create_lljit_compiler(target_machine(), suppress_errors=True)


_numbers = count()


def machine_code_of(
    make: Callable[..., Any], *arguments: int, optimise: bool = False
) -> MachineCode:
    """Return the function ``ENTRY`` of the module in LLVM's language that ``make`` returns, from the cache or made
    now; it stays in memory. What the module has must stand in the file of ``make``.

    Such modules do what kernels cannot: call functions by their addresses, jump to one of many places.
    """
    source = f"{store.file_digest(make.__code__.co_filename)} {make.__qualname__} {arguments}"
    name = hashlib.blake2b(f"{tools()}|{optimise}|{source}".encode(), digest_size=16).hexdigest()
    kept = store.load(name)
    if kept is None:
        text = str(make(*arguments))
        kept = optimised(text) if optimise else assemble(text)
        store.save(name, kept)
    code = MachineCode(kept)
    _alive.append(code)
    return code


_alive: list[MachineCode] = []
