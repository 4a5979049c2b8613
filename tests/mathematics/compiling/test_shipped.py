"""Machine code that a wheel brings along is used where it was made of the same, and nowhere else."""

import importlib.util
import itertools
import sys
import zipfile

import numpy as np
import pytest

from aloft.mathematics.compiling import compile_calls, shipped, store
from aloft.mathematics.compiling.arguments import type_of
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.compiling.machine_code import process_triple
from aloft.mathematics.compiling.translate import Translator

SOURCE = """
from aloft.mathematics.kernel import kernel

RATE = 0.1

@kernel
def inner(x: float) -> float:
    return x / 3.0 + RATE

@kernel
def outer(values, result):
    for k in range(3):
        result[k] = inner(values[k])
"""
numbers = itertools.count()
TRIPLE = process_triple()
pytestmark = [
    pytest.mark.usefixtures("own_cache"),
    pytest.mark.skipif(TRIPLE not in shipped.OLDEST, reason=f"no code is shipped for {TRIPLE}"),
]


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A folder in the place of the package's, and what imports a module of kernels from a text."""
    monkeypatch.setattr(shipped, "FOLDER", tmp_path)
    forget()

    def load(text=SOURCE, name=None):
        name = name or f"shipped_kernels_{next(numbers)}"
        file = tmp_path / "kernels" / f"{name}.py"
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        spec = importlib.util.spec_from_file_location(name, file)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        forget()
        return module

    yield load
    forget()


def forget():
    """What a new process does not know."""
    for each in (shipped._archive, shipped._tools, store.file_digest):
        each.cache_clear()


def call_of(module):
    return KernelCall(module.outer, np.array([1.0, 1e-3, -7.0]), np.zeros(3))


def write(module, folder, triple=TRIPLE):
    call = call_of(module)
    return shipped.write([(call.kernel, tuple(map(type_of, call.arguments)))], triple, folder)


def compiled(call, monkeypatch):
    """How many kernels a call makes the compiler compile."""
    seen, translate = [], Translator.module

    def watched(translator, kernel, signature):
        seen.append(kernel)
        return translate(translator, kernel, signature)

    monkeypatch.setattr(compile_calls, "_loaded", {})
    monkeypatch.setattr(compile_calls, "_names", {})
    with monkeypatch.context() as patch:
        patch.setattr(Translator, "module", watched)
        assert compile_calls.compile_calls([call]) == ""
    call.run()
    expected = np.zeros(3)
    call.kernel(call.arguments[0], expected)
    assert call.arguments[1].tobytes() == expected.tobytes()
    return len(seen)


def test_nothing_is_compiled_that_the_package_brings(package, tmp_path, monkeypatch):
    module = package()
    write(module, tmp_path)
    assert compiled(call_of(module), monkeypatch) == 0
    (tmp_path / f"{TRIPLE}.zip").unlink()
    forget()
    assert compiled(call_of(module), monkeypatch) == 1


def test_a_changed_source_is_compiled(package, tmp_path, monkeypatch):
    name = f"shipped_kernels_{next(numbers)}"
    write(package(name=name), tmp_path)
    for k, (old, new) in enumerate([("x / 3.0", "x / 3.5"), ("RATE = 0.1", "RATE = 0.2")], start=1):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / f"cache{k}"))
        changed = package(SOURCE.replace(old, new), name)
        assert compiled(call_of(changed), monkeypatch) == 1
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert compiled(call_of(package(SOURCE, name)), monkeypatch) == 0


def test_a_constant_of_another_module_counts(package, tmp_path, monkeypatch):
    module = package()
    write(module, tmp_path)
    module.RATE = 0.25  # as if it were imported from a file that has changed
    assert compiled(call_of(module), monkeypatch) == 1


def test_another_llvm_another_compiler_and_a_named_processor_compile(
    package, tmp_path, monkeypatch
):
    module = package()
    write(module, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(shipped, "llvm_version", lambda: "0.1")
        forget()
        assert compiled(call_of(module), patch) == 1
    (tmp_path / "another_compiler.py").write_text("# another file of the compiler\n")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "second"))
    forget()
    assert compiled(call_of(module), monkeypatch) == 1
    (tmp_path / "another_compiler.py").unlink()
    forget()
    monkeypatch.setenv("ALOFT_CPU_NAME", "x86-64" if TRIPLE.startswith("x86") else "generic")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "third"))
    types = tuple(map(type_of, call_of(module).arguments))
    assert shipped.load(module.outer, types) is None
    monkeypatch.delenv("ALOFT_CPU_NAME")
    assert shipped.load(module.outer, types) is not None


@pytest.mark.parametrize("damage", ["a byte of the code", "no archive"])
def test_what_is_damaged_is_compiled(package, tmp_path, monkeypatch, damage):
    module = package()
    file = write(module, tmp_path)
    if damage == "no archive":
        file.write_bytes(b"PK nothing")
    else:
        with zipfile.ZipFile(file) as archive:
            (name,) = archive.namelist()
            content = bytearray(archive.read(name))
        content[-1] ^= 1
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr(name, bytes(content))
    forget()
    assert compiled(call_of(module), monkeypatch) == 1


def test_equal_kernels_give_equal_archives_for_each_kind_of_processor(package, tmp_path):
    module = package()
    for triple, machine in (("x86_64-unknown-linux-gnu", 62), ("aarch64-unknown-linux-gnu", 183)):
        first, second = tmp_path / "first", tmp_path / "second"
        for folder in (first, second):
            folder.mkdir(exist_ok=True)
            file = write(module, folder, triple)
        assert (first / file.name).read_bytes() == (second / file.name).read_bytes()
        with zipfile.ZipFile(file) as archive:
            (entry,) = archive.infolist()
            code = shipped.store.unsealed(entry.filename, archive.read(entry))
        assert code[:4] == b"\x7fELF" and code[18] + 256 * code[19] == machine
