"""Texts in MATLAB's files of version 7.3, which are HDF5: char arrays, cell arrays of them, and strings.

MATLAB writes a char array as numbers, a cell array as references, and a string as the number of an object whose parts lie in a
group of the file's own, ``#subsystem#``. Joints' names come as any of them.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

MOST_NUMBERS = 1_000_000
"""Numbers of a text, references of a cell or bytes of the objects' table; larger ones are no names."""
_OBJECT = 0xDD000000
_MISSING = 2**64 - 1


def matlab_texts(file: Any, item: Any) -> list[str] | None:
    """Return the texts in a data set of an open HDF5 file, column by column as MATLAB counts; none if it holds others."""
    kind = item.attrs.get("MATLAB_class", b"")
    if item.size > MOST_NUMBERS or item.external:
        return None
    try:
        if kind == b"char":
            return _of_characters(item)
        if kind == b"cell":
            return _of_cell(file, item)
        if kind == b"string":
            return _of_string(file, item)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, struct.error):
        return None  # an object of a kind that is not known here
    return None


def _of_characters(item: Any) -> list[str] | None:
    """Return the rows of a char array, which HDF5 has as columns, without the blanks that fill them."""
    if item.attrs.get("MATLAB_empty", 0):
        return [""]
    if item.dtype.kind != "u" or item.ndim != 2:
        return None
    rows = np.asarray(item[()]).T.astype("<u2")
    return [row.tobytes().decode("utf-16-le").rstrip() for row in rows]


def _of_cell(file: Any, item: Any) -> list[str] | None:
    found: list[str] = []
    for reference in np.ravel(item[()]):
        part = file[reference]
        if (
            part.attrs.get("MATLAB_class", b"") != b"char"
            or part.size > MOST_NUMBERS
            or part.external
        ):
            return None
        texts = _of_characters(part)
        if texts is None or len(texts) != 1:
            return None
        found += texts
    return found


def _of_string(file: Any, item: Any) -> list[str] | None:
    """Return the texts of a string array: its object's one part has their lengths, and their characters in one row."""
    header = np.ravel(item[()]).tolist()
    if header[0] != _OBJECT:
        return None
    sizes = header[2 : 2 + header[1]]
    part = file[_part_of_object(file, header[2 + len(sizes)])]
    if part.size > MOST_NUMBERS or part.external:
        return None
    words = np.ravel(part[()]).astype("<u8")
    begin = 2 + int(words[1])
    lengths = words[begin : begin + int(np.prod(words[2:begin]))].tolist()
    characters = words[begin + len(lengths) :].tobytes().decode("utf-16-le")
    found, at = [], 0
    for length in lengths:
        length = 0 if length == _MISSING else length
        if at + length > len(characters):
            return None
        found.append(characters[at : at + length])
        at += length
    return found


def _part_of_object(file: Any, number: int) -> Any:
    """Return the reference to the only part of an object: the first of ``MCOS`` is a table of numbers, parts begin with the third.

    In the table, the third to the eighth number are where its sections begin. That of objects has six numbers for each, of which the
    fourth says which block of the section before is the object's: a count, three numbers for each part, and a blank if that
    makes an odd number.
    """
    references = np.ravel(file["#subsystem#/MCOS"][()])
    table = file[references[0]]
    if table.size > MOST_NUMBERS or table.external:
        raise ValueError
    raw = np.ravel(table[()]).astype(np.uint8).tobytes()
    blocks, objects = struct.unpack_from("<3I", raw, 8)[1:]
    block = struct.unpack_from("<6I", raw, objects + 24 * number)[3]
    at = blocks
    for _ in range(block + 1):
        (count,) = struct.unpack_from("<I", raw, at)
        begin, at = at + 4, at + 4 + 12 * count
        at += -(at - blocks) % 8
    if count != 1:
        raise ValueError
    place = struct.unpack_from("<3I", raw, begin)[2]
    return references[2 + place]
