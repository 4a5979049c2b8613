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
from dataclasses import replace
from pathlib import Path

from .format import RECORD
from .records import Content, NoRunError, RecordingError, Scan, records_in

TIMEOUT = 600.0
"""Seconds that Rerun may take to read a file."""
_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv.pop(1)); "
    f"from {__package__}.rewritten_process import main; main(*sys.argv[1:])"
)


def read_again(found: Scan) -> Scan:
    """Read a file's records with Rerun.

    Raises:
        RecordingError: Rerun cannot read it, or it is of another format.
        NoRunError: it has no run of aloft's.
    """
    path = found.path
    folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
    command = [sys.executable, "-c", _PROGRAM, folders, str(path), RECORD]
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
