"""The recorder's process takes as much memory for a long run as for a short one."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

MOST_GROWTH = 4 << 20
"""Bytes, of 9,000 flushes: allocators take and give back 1 MB. Rerun's index, which a run without an end does without, would
take 9 MB for them."""
PROGRAM = """
import json, os, sys
from dataclasses import replace
from pathlib import Path
from aloft.blocks.general.sources import Constant
from aloft.logs.file.header import header_of
from aloft.logs.recording.output_file import reserve_output
from aloft.logs.recording.recorder_process import RecorderProcess
from aloft.logs.recording.recorder_protocol import HEADER, KEYFRAME, ROW, RecorderTask
from aloft.logs.recording.ring import RingWriter, make_memory
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.graphs import BlockUse, checked_graph

def memory():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")

path = Path(sys.argv[1])
bound = BoundGraph(checked_graph({"c": BlockUse(Constant, {"value": [1.0, 2.0]})}))
header = replace(header_of(bound), ticks=None)
ring, output = make_memory(1 << 20), reserve_output(path)
writer = RingWriter(ring, 1 << 20)
writer.write(HEADER, 0, header.to_json().encode())
task = RecorderTask(1 << 20, str(path), 0, flush_period=0.0, sync_period=1e9)
recorder = RecorderProcess(task, ring, os.dup(output.descriptor))
bus, state = bytes(header.bus.size), bytes(header.state.size)
seen = []
for tick in range(15000):  # each tick is flushed by itself, as half a second's are in a run
    if tick % 10 == 0:
        writer.write(KEYFRAME, tick, bus + state)
    writer.write(ROW, tick, bus)
    recorder.take()
    if tick in (5999, 14999):
        seen.append(memory())
report = recorder.finish({"success": True, "ticks": 15000})
print(json.dumps({"growth": seen[1] - seen[0], "rows": report.rows, "problem": report.problem}))
"""


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/statm").is_file(), reason="Linux tells a process's memory")
def test_memory_does_not_grow_with_a_run(tmp_path: Path) -> None:
    command = [sys.executable, "-c", PROGRAM, str(tmp_path / "a.rrd")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, check=True)
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["problem"] == "" and told["rows"] == 15000
    assert told["growth"] < MOST_GROWTH
