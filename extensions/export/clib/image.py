"""The memory of a library's instance: which bytes of the graph's memory it has, and where.

All arrays that kernels work on lie in a few pieces of memory. Those that some kernel writes, and
those that make up the graph's signals and state, become parts of the instance, in the same order for
every processor. Those that are only read, such as plans and the model of the robot, become
constant data of the library.
"""

from __future__ import annotations

import ctypes
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....runtime.language.layout import ALIGNMENT

HEADER = 64
"""Bytes at the beginning of an instance: its mark, the code and the place of the last error."""


def bounds(array: NDArray[Any]) -> tuple[int, int]:
    """Return the addresses of the first byte of an array and of the byte after its last."""
    first, end = np.lib.array_utils.byte_bounds(array)
    return int(first), int(end)


@dataclass
class Piece:
    """Memory from the address ``first`` up to ``end``; ``offset`` is its place in the instance, or
    in the constants where ``constant``."""

    first: int
    end: int
    constant: bool = True
    offset: int = 0

    def content(self) -> bytes:
        """Return its present bytes."""
        return ctypes.string_at(self.first, self.end - self.first)


@dataclass
class Image:
    """Places of a graph's arrays in an instance and in the constants of a library."""

    pieces: list[Piece] = field(default_factory=list)
    size: int = HEADER
    constants: int = 0

    @classmethod
    def of(
        cls,
        regions: Iterable[NDArray[Any]],
        written: Iterable[NDArray[Any]],
        read: Iterable[NDArray[Any]],
    ) -> Image:
        """Lay out memory.

        Args:
            regions: come first in the instance, in this order.
            written: what kernels may write.
            read: what they only read.
        """
        image = cls()
        first = [bounds(each)[0] for each in regions if each.size]
        spans = [(*bounds(each), False) for each in (*regions, *written) if each.size]
        spans += [(*bounds(each), True) for each in read if each.size]
        for start, end, constant in sorted(spans):
            if image.pieces and start < image.pieces[-1].end:
                last = image.pieces[-1]
                last.end, last.constant = max(last.end, end), last.constant and constant
            else:
                image.pieces.append(Piece(start, end, constant))
        ordered = [image._piece(each) for each in first]
        ordered += [each for each in image._in_order((*written, *read)) if each not in ordered]
        for piece in ordered:
            if piece.constant:
                piece.offset = image.constants
                image.constants += _rounded(piece.end - piece.first)
            else:
                piece.offset = image.size
                image.size += _rounded(piece.end - piece.first)
        return image

    def _in_order(self, arrays: Iterable[NDArray[Any]]) -> list[Piece]:
        """Return the pieces in the order in which arrays name them, so that addresses do not matter."""
        found: list[Piece] = []
        for array in arrays:
            if array.size and (piece := self._piece(bounds(array)[0])) not in found:
                found.append(piece)
        return found

    def _piece(self, address: int) -> Piece:
        k = bisect_right(self.pieces, address, key=lambda piece: piece.first) - 1
        return self.pieces[k]

    def place(self, array: NDArray[Any]) -> tuple[bool, int]:
        """Return whether an array is constant, and the byte at which its element 0 lies."""
        if not array.size:
            return False, 0
        address = array.ctypes.data
        piece = self._piece(address)
        return piece.constant, piece.offset + address - piece.first

    def bytes_of(self, *, constant: bool) -> bytearray:
        """Return the present content of the constants, or of an instance."""
        data = bytearray(self.constants if constant else self.size)
        for piece in self.pieces:
            if piece.constant == constant:
                content = piece.content()
                data[piece.offset : piece.offset + len(content)] = content
        return data


def _rounded(size: int) -> int:
    return -(-size // ALIGNMENT) * ALIGNMENT
