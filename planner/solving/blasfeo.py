"""A product of BLASFEO with the vectors of this processor, to the bit.

fatrop's algebra is BLASFEO's. CasADi's wheels bring a build of it for any processor, whose product of 4 x 4 blocks takes a
third of a solve with all coordinates. LLVM makes the same product for this processor: each sum has the same terms in the
same order, none is fused, so no bit differs, and such a solve takes 0.7 of the time. BLASFEO calls its product by an entry
of its table of functions, as every library on Linux does, and that entry is changed.

That is done only where both give the same bytes on samples. Elsewhere, such as on another system, where CasADi was built
with another BLASFEO or its table cannot be written, all stays as it is.
"""

from __future__ import annotations

import ctypes
import itertools
import platform
import sys
from functools import cache
from pathlib import Path
from struct import Struct, error
from typing import Any, NamedTuple

import numpy as np

from ...mathematics.compiling.machine_code import ENTRY, machine_code_of

LIBRARY, PRODUCT = "libblasfeo.so", b"kernel_dgemm_nt_4x4_lib4"
BLOCK = 4
_HEADER, _SECTION = Struct("<16s2H I 3Q I 6H"), Struct("<2I 4Q 2I 2Q")
_SYMBOL, _RELOCATION = Struct("<I 2B H 2Q"), Struct("<Q 2I q")
_JUMP_SLOT = 7
"""The type of a relocation that is an entry of the table (System V ABI, AMD64)."""
_PRODUCT_TYPE = ctypes.CFUNCTYPE(None, ctypes.c_int, *[ctypes.c_void_p] * 6)


@cache
def use_fast_product() -> bool:
    """Let BLASFEO, once it is loaded, call the fast product from now on. Returns whether it does."""
    try:
        library = _loaded_library()
        place = None if library is None else library.base + _entry(library.path.read_bytes())
    except (OSError, ValueError, IndexError, error):
        return False
    if library is None or place is None or not any(place in each for each in library.writable):
        return False
    own = fast_product()
    theirs = getattr(ctypes.CDLL(str(library.path)), PRODUCT.decode())
    if not _same(
        _PRODUCT_TYPE(own), _PRODUCT_TYPE(ctypes.cast(theirs, ctypes.c_void_p).value or 0)
    ):
        return False
    ctypes.c_uint64.from_address(place).value = own
    return True


@cache
def fast_product() -> int:
    """Return the address of the product, which has BLASFEO's arguments."""
    return machine_code_of(_module, optimise=True).address


class _Library(NamedTuple):
    """A loaded library: its file, the address of its beginning and the addresses that can be written."""

    path: Path
    base: int
    writable: list[range]


def _loaded_library() -> _Library | None:
    if not sys.platform.startswith("linux") or platform.machine() != "x86_64":
        return None
    rows = [line.split() for line in Path("/proc/self/maps").read_text().splitlines()]
    found = [
        (range(*(int(each, 16) for each in row[0].split("-"))), row[1], row[5])
        for row in rows
        if len(row) == 6 and Path(row[5]).name.startswith(LIBRARY)
    ]
    if (
        len({path for _, _, path in found}) != 1
    ):  # none, or one of several is BLASFEO as fatrop sees it
        return None
    writable = [addresses for addresses, rights, _ in found if "w" in rights]
    return _Library(Path(found[0][2]), min(each.start for each, _, _ in found), writable)


def _entry(file: bytes) -> int:
    """Return the place of the product's entry in the table, from the library's beginning.

    Raises:
        ValueError, struct.error, IndexError: there is none, or the file is of another kind.
    """
    start, size, count, names = (_HEADER.unpack_from(file)[k] for k in (6, 11, 12, 13))
    sections = [_SECTION.unpack_from(file, start + k * size) for k in range(count)]

    def content(name: bytes) -> bytes:
        titles = sections[names][4]
        for section in sections:
            title = file[titles + section[0] :].partition(b"\0")[0]
            if title == name:
                return file[section[4] : section[4] + section[5]]
        raise ValueError(f"no section {name.decode()}")

    symbols, texts = content(b".dynsym"), content(b".dynstr")
    for place, kind, symbol, _ in _RELOCATION.iter_unpack(content(b".rela.plt")):
        name = _SYMBOL.unpack_from(symbols, symbol * _SYMBOL.size)[0]
        if kind == _JUMP_SLOT and texts[name:].partition(b"\0")[0] == PRODUCT:
            return int(place)
    raise ValueError(f"no entry of {PRODUCT.decode()}")


def _same(own: Any, theirs: Any) -> bool:
    """Return whether two products give the same bytes."""
    draw = np.random.default_rng(1)
    for length, alpha, beta in itertools.product(
        (0, 1, 5, 16, 37), (1.0, -1.0, 0.3), (0.0, 1.0, 0.7)
    ):
        left, right = draw.normal(size=(2, max(length, 1), BLOCK))
        added = draw.normal(size=(BLOCK, BLOCK))
        results = []
        for product in (own, theirs):
            factors, found = np.array([alpha, beta]), np.zeros((BLOCK, BLOCK))
            product(
                length, factors[:1].ctypes.data, left.ctypes.data, right.ctypes.data,
                factors[1:].ctypes.data, added.ctypes.data, found.ctypes.data,
            )  # fmt: skip
            results.append(found.tobytes())
        if results[0] != results[1]:
            return False
    return True


def _module() -> Any:
    """Return D = beta C + alpha A B' of 4 x 4 blocks, with ``length`` columns of A and B, as a module of LLVM.

    All of them lie column by column in memory.
    """
    from llvmlite import ir

    length, real = ir.IntType(32), ir.DoubleType()
    vector, place = ir.VectorType(real, BLOCK), real.as_pointer()
    module = ir.Module("aloft.blasfeo")
    kind = ir.FunctionType(ir.VoidType(), [length, *[place] * 6])
    function = ir.Function(module, kind, ENTRY)
    count, alpha, left, right, beta, added, found = function.args
    begin, inside, end = (function.append_basic_block(each) for each in ("begin", "inside", "end"))
    zero = ir.Constant(vector, [0.0] * BLOCK)

    def at(to: Any, array: Any, column: Any) -> Any:
        first = to.gep(array, [to.mul(column, length(BLOCK))])
        return to.bitcast(first, vector.as_pointer())

    def spread(to: Any, address: Any) -> Any:
        one = to.insert_element(ir.Constant(vector, ir.Undefined), to.load(address), length(0))
        lanes = ir.Constant(ir.VectorType(length, BLOCK), [0] * BLOCK)
        return to.shuffle_vector(one, one, lanes)

    to = ir.IRBuilder(begin)
    to.cbranch(to.icmp_signed(">", count, length(0)), inside, end)
    to = ir.IRBuilder(inside)
    column = to.phi(length)
    sums = [to.phi(vector) for _ in range(BLOCK)]
    values = to.load(at(to, left, column), align=8)
    others = [
        to.gep(right, [to.add(to.mul(column, length(BLOCK)), length(k))]) for k in range(BLOCK)
    ]
    more = [
        to.fadd(each, to.fmul(values, spread(to, other)))
        for each, other in zip(sums, others, strict=True)
    ]
    following = to.add(column, length(1))
    to.cbranch(to.icmp_signed("<", following, count), inside, end)
    column.add_incoming(length(0), begin)
    column.add_incoming(following, inside)
    to = ir.IRBuilder(end)
    totals = [to.phi(vector) for _ in range(BLOCK)]
    for each, grown, total in zip(sums, more, totals, strict=True):
        each.add_incoming(zero, begin)
        each.add_incoming(grown, inside)
        total.add_incoming(zero, begin)
        total.add_incoming(grown, inside)
    of_product, of_added = spread(to, alpha), spread(to, beta)
    for k, total in enumerate(totals):
        known = to.load(at(to, added, length(k)), align=8)
        result = to.fadd(to.fmul(of_added, known), to.fmul(of_product, total))
        to.store(result, at(to, found, length(k)), align=8)
    to.ret_void()
    return module
