"""Kinds of processors for which a library can be made: object files, and what links them."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ....mathematics.compiling.machine_code import OLDEST, assembler_text, cross_compiled
from ....runtime.language.errors import AloftError


@dataclass(frozen=True)
class Target:
    """A kind of processor.

    Attributes:
        triple, features: LLVM's names; code is for the oldest processor of the kind.
        linkers: commands that link a shared library, of which the first that is there is taken.
        archivers: the same for a static library.
        runner: what runs programs of this kind here; empty where they run by themselves.
        packages: what to install on Debian where the tools are missing.
    """

    triple: str
    features: str
    linkers: Sequence[str]
    archivers: Sequence[str]
    runner: Sequence[str]
    packages: str

    def linker(self) -> str:
        """Return the command that links; empty where there is none."""
        return next((each for each in self.linkers if shutil.which(each)), "")


TARGETS: dict[str, Target] = {
    "x86_64": Target(
        "x86_64-unknown-linux-gnu", "", ("cc", "gcc", "clang"), ("ar",), (), "gcc",
    ),
    "aarch64": Target(
        "aarch64-unknown-linux-gnu", "", ("aarch64-linux-gnu-gcc",),
        ("aarch64-linux-gnu-ar",), ("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"),
        "gcc-aarch64-linux-gnu qemu-user",
    ),
    "wasm": Target(
        "wasm32-unknown-unknown", "+bulk-memory", ("wasm-ld", "wasm-ld-14"), (),
        ("node",), "lld nodejs",
    ),
}  # fmt: skip


WIDE_PRODUCT = """
define void @__multi3(ptr %out, i64 %al, i64 %ah, i64 %bl, i64 %bh) noinline optnone {
  %a0 = and i64 %al, 4294967295
  %a1 = lshr i64 %al, 32
  %b0 = and i64 %bl, 4294967295
  %b1 = lshr i64 %bl, 32
  %w0 = mul i64 %a0, %b0
  %c0 = lshr i64 %w0, 32
  %p1 = mul i64 %a1, %b0
  %t1 = add i64 %p1, %c0
  %t1l = and i64 %t1, 4294967295
  %t1h = lshr i64 %t1, 32
  %p2 = mul i64 %a0, %b1
  %t2 = add i64 %p2, %t1l
  %t2h = lshr i64 %t2, 32
  %s2 = shl i64 %t2, 32
  %w0l = and i64 %w0, 4294967295
  %low = or i64 %s2, %w0l
  %p3 = mul i64 %a1, %b1
  %h1 = add i64 %p3, %t1h
  %h2 = add i64 %h1, %t2h
  %x1 = mul i64 %ah, %bl
  %x2 = mul i64 %al, %bh
  %h3 = add i64 %h2, %x1
  %high = add i64 %h3, %x2
  store i64 %low, ptr %out
  %above = getelementptr i64, ptr %out, i32 1
  store i64 %high, ptr %above
  ret void
}
"""
"""The product of whole numbers of 128 bits, which LLVM asks for where it checks one of 64 bits and WebAssembly has no
instruction for it. Other systems have it in their compiler's library."""


def compile_module(text: str, target: Target) -> bytes:
    """Return the object file of a module for a kind of processor."""
    if target.triple.startswith("wasm"):
        text += WIDE_PRODUCT
    return cross_compiled(text, target.triple, OLDEST[target.triple], target.features)


def assembler(text: str, target: Target) -> str:
    """Return the same code as a text for an assembler."""
    return assembler_text(text, target.triple, OLDEST[target.triple], target.features)


def link(name: str, folder: Path, target: Target) -> list[Path]:
    """Make what can be made of ``NAME.o``: a static and a shared library, or a WebAssembly module.

    Returns:
        The files; none where the tools are not there.

    Raises:
        AloftError: a tool fails.
    """
    made: list[Path] = []
    program = target.linker()
    if program.startswith("wasm-ld"):
        file = folder / f"{name}.wasm"
        _run([program, "--no-entry", "--export-dynamic", "--allow-undefined", "--export=__heap_base", f"{name}.o", "-o", file.name], folder)  # fmt: skip
        return [file]
    archiver = next((each for each in target.archivers if shutil.which(each)), "")
    if archiver:
        made.append(folder / f"lib{name}.a")
        _run([archiver, "rcs", made[-1].name, f"{name}.o"], folder)
    if program:
        made.append(folder / f"lib{name}.so")
        _run([program, "-shared", "-o", made[-1].name, f"{name}.o", "-lm"], folder)
    return made


def _run(command: Sequence[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise AloftError(f"{' '.join(command)} fails: {done.stderr.strip()}")
