"""Places an object file of this package in memory without LLVM, which takes 100 MB only to link it.

LLVM's code model ``large`` reaches everything by 64 bits and by a table of addresses, so five kinds of
relocations are all there are. What is not known here, such as another processor, a section that is
written or another symbol, is refused, and LLVM links that file.
"""

from __future__ import annotations

import ctypes
import mmap
import sys
from collections.abc import Callable
from functools import cache
from struct import Struct, error
from typing import NamedTuple

X86_64 = 62
_HEADER = Struct("<16s2H I 3Q I 6H")
_SECTION = Struct("<2I 4Q 2I 2Q")
_SYMBOL = Struct("<I 2B H 2Q")
_RELOCATION = Struct("<Q 2I q")
_WORD = Struct("<Q")
_FROM_FILE, _FOR_RELOCATIONS = 1, 4
"""Types of sections: with bytes of the program; relocations with addends."""
_WRITTEN, _IN_MEMORY = 1, 2
"""Flags of sections."""
_UNWINDING = b".eh_frame"
"""A section for exceptions of C++, which none of this code has."""
_TABLE = b"_GLOBAL_OFFSET_TABLE_"

_VALUES: dict[int, Callable[[int, int, int, int], int]] = {
    1: lambda symbol, place, table, entry: symbol,
    24: lambda symbol, place, table, entry: symbol - place,
    25: lambda symbol, place, table, entry: symbol - table,
    27: lambda symbol, place, table, entry: entry - table,
    29: lambda symbol, place, table, entry: table - place,
}
"""By the type of a relocation the 64 bits to which its addend is added (System V ABI, AMD64): R_X86_64_64, PC64, GOTOFF64,
GOT64 and GOTPC64."""


class CodeInMemory(NamedTuple):
    """Code in memory, which goes with this object."""

    memory: mmap.mmap
    address: int
    """The address of the symbol that was asked for."""


class _Section(NamedTuple):
    name: int
    kind: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int
    alignment: int
    entry: int


def place(code: bytes, wanted: str) -> CodeInMemory | None:
    """Place an object file in memory, and return it with the address of one of its symbols; ``None`` where it has
    something that is not known here, or is damaged, or the system is another."""
    if sys.platform != "linux":
        return None
    try:
        return _placed(code, wanted.encode())
    except (error, AttributeError, IndexError, OSError, ValueError):
        return None


def _placed(code: bytes, wanted: bytes) -> CodeInMemory:
    mark, kind, machine, *_ = header = _HEADER.unpack_from(code)
    if mark[:6] != b"\x7fELF\x02\x01" or kind != 1 or machine != X86_64:
        raise ValueError("no relocatable object file for x86-64")
    sections = [
        _Section(*_SECTION.unpack_from(code, header[6] + k * _SECTION.size))
        for k in range(header[12])
    ]
    names = sections[header[13]].offset
    starts: dict[int, int] = {}
    end = 0
    for k, section in enumerate(sections):
        if section.flags & _IN_MEMORY and _text(code, names + section.name) != _UNWINDING:
            if section.flags & _WRITTEN or section.kind != _FROM_FILE:
                raise ValueError("a section is written")
            steps = max(1, section.alignment)
            starts[k] = end = -(-end // steps) * steps
            end += section.size
    table = -(-end // 8) * 8
    (symbols,) = (each for each in sections if each.kind == 2)
    count = symbols.size // _SYMBOL.size
    memory = mmap.mmap(-1, table + 8 * count, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    base = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    texts = sections[symbols.link].offset
    address = 0
    for k in range(1, count):
        name, _, _, section_index, value, _ = _SYMBOL.unpack_from(
            code, symbols.offset + k * _SYMBOL.size
        )
        text = _text(code, texts + name)
        if section_index in starts:
            found = base + starts[section_index] + value
        elif section_index == 0 and text == _TABLE:
            found = base + table
        elif section_index == 0:
            found = _of_process(text.decode())
        else:
            continue  # the file's name, or unwinding
        _WORD.pack_into(memory, table + 8 * k, found)
        if text == wanted:
            address = found
    for k, start in starts.items():
        memory[start : start + sections[k].size] = code[sections[k].offset :][: sections[k].size]
    for section in sections:
        if section.kind == _FOR_RELOCATIONS and section.info in starts:
            for offset in range(section.offset, section.offset + section.size, _RELOCATION.size):
                place, kind, symbol, addend = _RELOCATION.unpack_from(code, offset)
                if kind not in _VALUES:
                    raise ValueError(f"relocations of type {kind}")
                place += starts[section.info]
                entry = table + 8 * symbol
                (value,) = _WORD.unpack_from(memory, entry)
                value = _VALUES[kind](value, base + place, base + table, base + entry) + addend
                _WORD.pack_into(memory, place, value % (1 << 64))
    if not address:
        raise ValueError(f"no symbol {wanted.decode()}")
    if _protect()(base, len(memory), mmap.PROT_READ | mmap.PROT_EXEC):
        raise ValueError("this system lets no memory become code")
    return CodeInMemory(memory, address)


def _text(code: bytes, start: int) -> bytes:
    return code[start : code.index(b"\0", start)]


@cache
def _of_process(name: str) -> int:
    """Return the address of a function of the C library. Raises ``AttributeError``."""
    return ctypes.cast(getattr(ctypes.CDLL(None), name), ctypes.c_void_p).value or 0


@cache
def _protect() -> Callable[[int, int, int], int]:
    protect = ctypes.CDLL(None).mprotect
    protect.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    return protect
