"""Graphs that users compose of general blocks: chains of 1,000, fused, beside calls in C.

The C program has a structure for each block and calls the block's function through a pointer. It must
give the same bits.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...runtime.loading import checked_text
from ...runtime.running.executor import Executor
from ...runtime.running.timing import FIRST_TIMED
from .loading import chain
from .rows import Row, compare, take_turns

COUNT = 1_000
SAMPLES = 5
TICKS = 200
WARM_TICKS = FIRST_TIMED + TICKS
"""After its first ticks a run reads the clock in some ticks only."""
GOALS = {"Gain": 2.0, "MovingAverage": 2.5}
COMPILE_GOAL = 5.0
BLOCKS = {
    "Gain": "use: blocks.Gain, with: {gain: 1.001}",
    "MovingAverage": f"use: blocks.MovingAverage, with: {{samples: {SAMPLES}}}",
}
SOURCE = "use: blocks.Constant, with: {value: [1.5]}"
C_SOURCE = f"""
struct block {{ const double *u; double *y; double gain; long samples, count; double window[{SAMPLES}]; }};
typedef void step(struct block *);
static struct block blocks[{COUNT}];
double signals[{COUNT + 1}] = {{1.5}};

void Gain(struct block *b) {{ *b->y = b->gain * *b->u; }}

void MovingAverage(struct block *b) {{
    b->window[b->count % b->samples] = *b->u;
    b->count++;
    double sum = 0.0;
    for (long k = 0; k < b->samples; k++) sum += b->window[k];
    *b->y = sum / (b->count < b->samples ? b->count : b->samples);
}}

void build(void) {{
    for (long k = 0; k < {COUNT}; k++)
        blocks[k] = (struct block){{signals + k, signals + k + 1, 1.001, {SAMPLES}}};
}}

void run(step *function, long ticks) {{
    for (long t = 0; t < ticks; t++)
        for (long k = 0; k < {COUNT}; k++) function(blocks + k);
}}
"""
COMPILE = """
import sys, time
from aloft.lab.benchmarks.general_blocks import executor
running = executor(sys.argv[1])
start = time.process_time()
running.start()
print(time.process_time() - start)
"""
Case = Callable[[int], object]


def executor(name: str) -> Executor:
    """Return the chain, ready to start: with times and the check for finite values, as every run
    has."""
    graph = checked_text(chain(COUNT, BLOCKS[name], SOURCE), Path("chain.yaml"))
    return Executor(graph, log=False, run_hash=False)


def calls_in_c(name: str, library: Path) -> tuple[Case, NDArray[np.float64]]:
    """Return the chain in a library of ``C_SOURCE``, and its signals."""
    functions = ctypes.CDLL(str(library))
    functions.build()
    run, step = functions.run, getattr(functions, name)
    run.argtypes = [ctypes.c_void_p, ctypes.c_long]
    signals = np.ctypeslib.as_array((ctypes.c_double * (COUNT + 1)).in_dll(functions, "signals"))
    return lambda ticks: run(step, ticks), signals


def general_blocks(rounds: int = 40) -> list[Row]:
    """Measure and return the rows.

    Raises:
        AssertionError: a chain computes other bits than the calls in C.
    """
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        library = _library(Path(folder))
        for name in BLOCKS:
            fused, in_c = f"{COUNT:,} {name}, fused", f"{COUNT:,} {name}, calls in C"
            running = executor(name)
            running.start()
            running.ticker.advance(WARM_TICKS)
            cases: dict[str, Case] = {fused: running.ticker.advance}
            if library is not None:
                cases[in_c], signals = calls_in_c(name, library)
                cases[in_c](WARM_TICKS)
                blocks: list[Any] = [running.bound.blocks[f"g{k}"] for k in range(COUNT + 1)]
                found = np.concatenate([block.y.value for block in blocks])
                assert found.tobytes() == signals.tobytes(), f"{name}: other bits than in C"
            times = take_turns(cases, rounds, TICKS)
            if library is not None:
                rows.append(Row(in_c, float(np.median(times[in_c])), "us/tick"))
                rows.append(compare(fused, times, in_c, goal=GOALS[name]))
            else:
                value = float(np.median(times[fused]))
                rows.append(Row(fused, value, "us/tick", in_c, note="no C compiler"))
            rows.append(_first_compile(name))
    return rows


def _library(folder: Path) -> Path | None:
    """Compile ``C_SOURCE`` to a library; none where there is no C compiler."""
    compiler = next(
        (c for c in (os.environ.get("CC", "cc"), "gcc", "clang") if shutil.which(c)), None
    )
    if compiler is None:
        return None
    source, library = folder / "chains.c", folder / "chains.so"
    source.write_text(C_SOURCE, encoding="utf-8")
    options = ["-O2", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run([compiler, *options, str(source), "-o", str(library)], check=True)
    return library


def _first_compile(name: str) -> Row:
    """Measure the processor time in which a new process starts the chain, with an empty cache."""
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [sys.executable, "-c", COMPILE, name], check=True, capture_output=True, text=True,
            env={**os.environ, "XDG_CACHE_HOME": cache},
        )  # fmt: skip
    return Row(f"{COUNT:,} {name}, first start", float(done.stdout), "s", goal=COMPILE_GOAL,
               note="each kernel is compiled once")  # fmt: skip
