"""Files that another program has written again: their records are read by Rerun's own reader, chunk by chunk.

Rerun's tools (``rerun rrd optimize``, ``filter``, ``merge``, ``split``, ``migrate``) write a recording again, with other
chunks. The records in these are the same, each with its number and its checksum. Rerun reads them in a process of its
own, as damage may end that without a word.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from .format import RECORD
from .records import Content, NoRunError, RecordingError, Scan, records_in

TIMEOUT = 600.0
"""Seconds that Rerun may take to read a file."""
_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv.pop(1)); "
    f"from {__name__} import main; main(sys.argv[1])"
)


def read_again(found: Scan) -> Scan:
    """Read a file's records with Rerun.

    Raises:
        RecordingError: Rerun cannot read it, or it is of another format.
        NoRunError: it has no run of aloft's.
    """
    path = found.path
    folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
    command = [sys.executable, "-c", _PROGRAM, folders, str(path)]
    environment = {**os.environ, "RUST_LOG": "off"}
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=TIMEOUT, check=False, env=environment
        )
    except subprocess.TimeoutExpired:
        raise RecordingError(f"{path} cannot be read: Rerun took more than {TIMEOUT:g} s") from None
    about, _, data = done.stdout.partition(b"\n")
    if done.returncode or not about:
        why = (done.stderr.decode(errors="replace").strip().splitlines() or ["it crashed"])[-1]
        raise RecordingError(
            f"{path} is not a recording: Rerun cannot read it, perhaps because it was cut off early ({why})"
        )
    told = json.loads(about)
    records = {record.number: record for record in reversed(records_in(data))}
    if not records and told["format"] is not None:
        return replace(found, maker=(told["format"], told["aloft"]))
    if not records and told["chunks"]:
        raise NoRunError(f"{path} is a Rerun file, but not a recording of a run by aloft")
    ordered = tuple(records[number] for number in sorted(records))
    closed = any(record.content is Content.END for record in ordered)
    return Scan(path, found.size, ordered, (), closed, data)


def main(path: str) -> None:
    """Print what is known of a file's writer as a line of JSON, and then all its records."""
    try:
        about, records = _read(path)
    except (RuntimeError, ValueError, OSError, ImportError) as error:
        sys.exit(" ".join(str(error).split()))
    sys.stdout.buffer.write(json.dumps(about).encode() + b"\n")
    for record in records:
        sys.stdout.buffer.write(record)
    sys.stdout.buffer.flush()


def _read(path: str) -> tuple[dict[str, Any], list[bytes]]:
    import warnings

    try:
        from rerun.chunk import RrdReader
    except ImportError:  # Rerun 0.40
        from rerun.experimental import RrdReader
    warnings.simplefilter("ignore")  # one that there is no index
    about: dict[str, Any] = {"format": None, "aloft": "", "chunks": 0}
    records: list[bytes] = []
    room = os.path.getsize(path) + (1 << 20)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        about["chunks"] += 1
        for name in batch.schema.names:
            if name == f"aloft:{RECORD}":
                values = [each.values.to_numpy().tobytes() for each in batch[name] if each.is_valid]
                room -= sum(map(len, values))
                if room < 0:  # records do not compress
                    raise ValueError("its records are larger than the file")
                records += values
        if str(chunk.entity_path) == "/__properties/aloft":
            for texts in _texts(batch):
                about |= texts
    return about, records


def _texts(batch: Any) -> Iterator[dict[str, Any]]:
    """Yield format and version that the properties of a recording name; those of format 6 have its header."""
    for name in batch.schema.names:
        if name.rpartition(":")[2] in ("header", "about"):
            for value in batch[name].to_pylist():
                data = json.loads(value[0])
                yield {
                    "format": data.get("format", 0),
                    "aloft": str(data.get("versions", {}).get("aloft", "")),
                }
