"""The index that closes a recording for Rerun's tools: where each chunk of the file lies and what it
holds.

Rerun ends what it writes with such an index (``RrdFooter``), a manifest for each store: the run and
its layout. It does so whenever its messages are taken out of it, as they are here piece by piece.
So the index of a recording is put together from those of its pieces, with the places that the
chunks have in the file.

The file ends with a footer of 32 bytes that says where the index is, with its xxHash (32 bits).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from struct import Struct
from typing import Any

import numpy as np

from . import protobuf

FOOTER_SIZE = 32
FOOTER_END = b"RRF2FOOT\x01\0\0\0"
"""Last bytes of a file that has one index."""
_FOOTER = Struct("<QQI")
_SEED = 7850921
_MANIFEST = 1
_STORE, _SCHEMA, _SCHEMA_HASH, _CHUNKS = 1, 2, 3, 4
"""The fields of a manifest: the store's name, the columns of all its data, and a table of chunks."""
_IPC = 1
"""The field of a schema that holds it in Arrow's format."""
_ENCODING, _TABLE, _COMPRESSION, _SIZE = 1, 2, 3, 4
"""The fields of a table."""
_ARROW, _LZ4 = 1, 2


@dataclass
class _Store:
    """The manifests of one store: the tables of its chunks, and the columns by their names."""

    tables: list[Any] = field(default_factory=list)
    columns: dict[str, Any] = field(default_factory=dict)


class Index:
    """The index of a file that grows.

    Args:
        grown: the bytes by which each message in the file is longer than Rerun has made it.
    """

    def __init__(self, grown: int) -> None:
        self._grown = grown
        self._pieces: list[tuple[bytes, Mapping[int, int]]] = []

    def add(self, piece: bytes, places: Mapping[int, int]) -> None:
        """Add the index of a piece; ``places`` are those in the file of the bodies of messages, by
        their places in the piece. A chunk that has no place in the file is left out."""
        if piece:
            self._pieces.append((piece, places))

    def whole(self) -> bytes:
        """Join the index of all pieces."""
        stores: dict[bytes, _Store] = {}
        for piece, places in self._pieces:
            for number, manifest in protobuf.fields(piece):
                if number == _MANIFEST:
                    parts = dict(protobuf.fields(manifest))
                    self._append(stores.setdefault(parts[_STORE], _Store()), parts, places)
        return b"".join(
            protobuf.field(_MANIFEST, _manifest(name, store)) for name, store in stores.items()
        )

    def _append(self, store: _Store, parts: Mapping[int, bytes], places: Mapping[int, int]) -> None:
        """Append what the manifest of a piece says to that of the whole store."""
        import pyarrow as pa  # comes with Rerun

        schema = dict(protobuf.fields(parts[_SCHEMA]))[_IPC]
        for column in pa.ipc.read_schema(pa.py_buffer(schema)):
            store.columns.setdefault(column.name, column)
        table = _read_table(parts[_CHUNKS])
        offsets = table["chunk_byte_offset"].to_pylist()
        there = [row for row, place in enumerate(offsets) if place in places]
        if len(there) < len(offsets):
            table = pa.concat_tables([table.slice(0, 0), *(table.slice(row, 1) for row in there)])
        moved = {
            "chunk_byte_offset": [places[p] for p in table["chunk_byte_offset"].to_pylist()],
            "chunk_byte_size": [s + self._grown for s in table["chunk_byte_size"].to_pylist()],
        }
        for name, values in moved.items():
            at = table.schema.get_field_index(name)
            table = table.set_column(at, table.schema.field(at), pa.array(values, pa.uint64()))
        store.tables.append(table)


def _manifest(name: bytes, store: _Store) -> bytes:
    """Write the manifest of a whole store."""
    import pyarrow as pa

    schema = pa.schema(store.columns.values()).serialize().to_pybytes()
    chunks = _filled(pa.concat_tables(store.tables, promote_options="default"))
    return b"".join(
        (
            protobuf.field(_STORE, name),
            protobuf.field(_SCHEMA, protobuf.field(_IPC, schema)),
            protobuf.field(_SCHEMA_HASH, sha256(schema).digest()),
            protobuf.field(_CHUNKS, _written_table(chunks)),
        )
    )


def _filled(table: Any) -> Any:
    """Fill the columns that a piece lacks with false for flags and zero for counts."""
    import pyarrow as pa

    for at, column in enumerate(table.schema):
        if column.type in (pa.bool_(), pa.uint64()) and table[at].null_count:
            nothing = False if column.type == pa.bool_() else 0
            values = [nothing if value is None else value for value in table[at].to_pylist()]
            table = table.set_column(at, column, pa.array(values, column.type))
    return table


def _read_table(data: bytes) -> Any:
    import pyarrow as pa

    parts = dict(protobuf.fields(data))
    table = parts[_TABLE]
    if parts.get(_COMPRESSION) == _LZ4:
        table = pa.decompress(table, parts[_SIZE], codec="lz4_raw")
    with pa.ipc.open_stream(table) as reader:
        return reader.read_all()


def _written_table(table: Any) -> bytes:
    import pyarrow as pa

    out = pa.BufferOutputStream()
    with pa.ipc.new_stream(out, table.schema) as writer:
        writer.write_table(table.combine_chunks())
    data = out.getvalue()
    return b"".join(
        (
            protobuf.field(_ENCODING, _ARROW),
            protobuf.field(_TABLE, pa.compress(data, codec="lz4_raw", asbytes=True)),
            protobuf.field(_COMPRESSION, _LZ4),
            protobuf.field(_SIZE, len(data)),
        )
    )


def footer(place: int, index: bytes) -> bytes:
    """Return the end of a file whose index stands at ``place``."""
    return _FOOTER.pack(place, len(index), xxhash32(index, _SEED)) + FOOTER_END


_P1, _P2, _P3, _P4, _P5 = 2654435761, 2246822519, 3266489917, 668265263, 374761393
_MASK = 0xFFFFFFFF
_LANES = int.from_bytes(_MASK.to_bytes(8, "little") * 4, "little")
"""The lower halves of four numbers of 64 bits."""


def xxhash32(data: bytes, seed: int) -> int:
    """Compute the xxHash of 32 bits (Collet, https://github.com/Cyan4973/xxHash).

    Its four lanes are the parts of one long integer, 64 bits each: Python takes as long for an
    operation with that as with a short one.
    """
    striped = len(data) & ~15
    words = np.frombuffer(data, "<u4", striped // 4) * np.uint32(_P2)
    stripes = words.astype("<u8").tobytes()
    start = (seed + _P1 + _P2, seed + _P2, seed, seed - _P1)
    lanes = int.from_bytes(b"".join((v & _MASK).to_bytes(8, "little") for v in start), "little")
    for place in range(0, len(stripes), 32):
        lanes = lanes + int.from_bytes(stripes[place : place + 32], "little") & _LANES
        lanes = (lanes << 13 | lanes >> 19) & _LANES
        lanes = lanes * _P1 & _LANES
    if striped:
        found = sum(_turned(lanes >> 64 * k, (1, 7, 12, 18)[k]) for k in range(4))
    else:
        found = seed + _P5
    found += len(data)
    for place in range(striped, len(data) & ~3, 4):
        word = int.from_bytes(data[place : place + 4], "little")
        found = _turned(found + word * _P3, 17) * _P4
    for byte in data[len(data) & ~3 :]:
        found = _turned(found + byte * _P5, 11) * _P1
    found &= _MASK
    found = (found ^ found >> 15) * _P2 & _MASK
    found = (found ^ found >> 13) * _P3 & _MASK
    return found ^ found >> 16


def _turned(value: int, count: int) -> int:
    """Rotate the lower 32 bits of a number left."""
    value &= _MASK
    return (value << count | value >> 32 - count) & _MASK
