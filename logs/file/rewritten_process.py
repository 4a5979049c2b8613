"""The process in which Rerun reads a file that another program has written again; see ``rewritten`` for the other side.

It imports neither the rest of the package nor all of Rerun, whose start takes longer than most files.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from typing import Any


def main(path: str, component: str) -> None:
    """Print what is known of a file's writer as a line of JSON, and then all its records.

    Args:
        path: the file.
        component: the name under which it has them.
    """
    try:
        about, records = _read(path, component)
    except (RuntimeError, ValueError, OSError, ImportError) as error:
        sys.exit(" ".join(str(error).split()))
    sys.stdout.buffer.write(json.dumps(about).encode() + b"\n")
    for record in records:
        sys.stdout.buffer.write(record)
    sys.stdout.buffer.flush()


def _read(path: str, component: str) -> tuple[dict[str, Any], list[bytes]]:
    reader = _reader()
    warnings.simplefilter("ignore")  # one that there is no index
    about: dict[str, Any] = {"format": None, "aloft": "", "chunks": 0}
    records: list[bytes] = []
    room = os.path.getsize(path) + (1 << 20)
    for chunk in reader(path).stream():
        batch = chunk.to_record_batch()
        about["chunks"] += 1
        for name in batch.schema.names:
            if name == f"aloft:{component}":
                values = [each.values.to_numpy().tobytes() for each in batch[name] if each.is_valid]
                room -= sum(map(len, values))
                if room < 0:  # records do not compress
                    raise ValueError("its records are larger than the file")
                records += values
        if str(chunk.entity_path) == "/__properties/aloft":
            for texts in _texts(batch):
                about |= texts
    return about, records


def _reader() -> Any:
    """Return Rerun's reader of chunks. The package is entered without its own start, which imports
    all that can be logged and takes twice as long as the rest; an older Rerun needs that."""
    spec = find_spec("rerun")
    if spec is not None:
        sys.modules["rerun"] = module_from_spec(spec)
    try:
        return import_module("rerun.chunk").RrdReader
    except (ImportError, AttributeError):  # Rerun 0.40
        for name in [each for each in sys.modules if each.partition(".")[0] == "rerun"]:
            del sys.modules[name]
        return import_module("rerun.experimental").RrdReader


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
