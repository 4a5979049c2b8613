"""Runs paced by a clock do not notice when the wall clock is set, however often and far."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ...waiting import free_port

SHIM = """
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

/* every tenth of a second the wall clock is set: a day ahead, a day back, half a minute ahead ... */
int clock_gettime(clockid_t which, struct timespec *t)
{
    static const long shift[] = {0, 86400, -86400, 30, -30};
    int code = (int)syscall(SYS_clock_gettime, which, t);
    if (!code && which == CLOCK_REALTIME) {
        struct timespec m;
        syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &m);
        t->tv_sec += shift[(m.tv_sec * 10 + m.tv_nsec / 100000000) % 5];
    }
    return code;
}

int gettimeofday(struct timeval *restrict t, void *restrict zone)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    t->tv_sec = now.tv_sec;
    t->tv_usec = now.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *t)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (t)
        *t = now.tv_sec;
    return now.tv_sec;
}
"""
GRAPH = """
rate: 100 Hz
duration: 1 s
clock: {kind: paced}
blocks:
  ramp: {use: blocks.SineWave}
  gain: {use: blocks.Gain, with: {gain: 2.0}, in: {u: ramp.y}}
"""
PARTS = """
machines: {a: tcp/127.0.0.1:PORT_A, b: tcp/127.0.0.1:PORT_B}
place: {gain: b}
"""
LIMIT = 120.0
"""The longest time [s] of a run."""
needs_compiler = pytest.mark.skipif(
    shutil.which("cc") is None or not sys.platform.startswith("linux"), reason="no C compiler"
)


@pytest.fixture
def jumping(tmp_path: Path) -> dict[str, str]:
    """The environment of processes whose wall clock is set ten times a second."""
    (tmp_path / "shim.c").write_text(SHIM)
    shim = tmp_path / "shim.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", shim, tmp_path / "shim.c"], check=True)
    environment = {**os.environ, "LD_PRELOAD": str(shim)}
    script = "import time\nseen = set()\nend = time.monotonic() + 30\n"
    script += "while len(seen) < 3 and time.monotonic() < end: seen.add(time.time() // 40000)\n"
    script += "assert len(seen) >= 3"
    subprocess.run([sys.executable, "-c", script], env=environment, check=True)
    return environment


def run(folder: Path, text: str, environment: dict[str, str] | None, *more: str) -> dict[str, Any]:
    (folder / "graph.yaml").write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "aloft", "run", "graph.yaml", "--json", *more], cwd=folder,
        env=environment, capture_output=True, text=True, timeout=LIMIT, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return dict(json.loads(done.stdout.splitlines()[-1]))


@needs_compiler
@pytest.mark.long
def test_a_paced_run_keeps_its_pace_and_its_recording(
    jumping: dict[str, str], tmp_path: Path
) -> None:
    found = run(tmp_path, GRAPH, jumping, "--record", "run.rrd")
    assert found["ticks"] == 100
    assert found["wall_time_s"] > 0.98, "no tick begins before its time"
    assert found["lateness"]["max_us"] < LIMIT * 1e6, "no tick is late by more than all took"
    assert found["run_hash"] == run(tmp_path, GRAPH, None, "--no-record")["run_hash"]


@needs_compiler
@pytest.mark.long
@pytest.mark.parametrize("links", ["", "links: {mode: free, max_age: 60 s, late: hold}\n"])
def test_parts_whose_clocks_are_set_stay_together(
    links: str, jumping: dict[str, str], tmp_path: Path
) -> None:
    parts = PARTS.replace("PORT_A", str(free_port())).replace("PORT_B", str(free_port()))
    found = run(tmp_path, GRAPH + parts + links, jumping, "--local", "--no-record")
    ticks = [part["ticks"] for part in found["machines"].values()]
    # free parts: if the one that is read from is first at its end, it ends the other
    assert ticks == [100, 100] if not links else max(ticks) == 100
