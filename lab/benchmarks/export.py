"""A tick of the exported library of a jump's controller beside the fused tier, beside TSID, and alone in C.

In this process the cases take turns of ``CHUNK`` ticks of one recorded jump. A program in C then runs the library
on one processor for as many ticks as ``count`` says, and in real time at some rates.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...extensions.export.clib.check import input_rows, write_names
from ...extensions.export.clib.library import SharedLibrary
from ...extensions.export.clib.write import write_library
from ...runtime.language.errors import AloftError
from .rows import Row
from .tick.controller import GRAPH, RecordedController, RecordedJump, record_jump
from .tick.tick import CHUNK, _quiet, _tsid_controller
from .tick.tsid import import_tsid

LIBRARY, FUSED, BARE = "exported library", "controller, fused", "controller, fused, calls only"
TSID = "controller, kernels one by one, whole-body controller in TSID"
GOAL = 1.0
"""The library is to take no longer than the fused tier, which times, checks and records."""
RATES = (500, 1000, 5000)
_PROGRAM = Path(__file__).with_name("export_ticks.c")


class _TimedController:
    """The library on the recorded inputs, in the manner of ``RecordedController``."""

    def __init__(self, jump: RecordedJump, fused: RecordedController, description: Path) -> None:
        self.library = SharedLibrary(description)
        layout = fused.bound.memory.bus.layout
        self.rows = input_rows(self.library.about, layout, jump.rows)
        self._signals = [
            (name, place, *layout.byte_range(name))
            for name, (place, *_) in self.library.about["signals"].items()
            if name in layout.slots
        ]
        self._recorded = jump.rows
        self.tick = 0
        self.times: list[float] = []

    def again(self) -> None:
        """Go back to the beginning of the jump."""
        self.library.reset()
        self.tick = 0

    def run(self, ticks: int) -> None:
        """Run the next ticks; the inputs are given before, and the time of that is not counted."""
        step, take, now = self.library.step, self.library.take, time.perf_counter_ns
        for tick in range(self.tick, min(self.tick + ticks, len(self.rows))):
            take(self.rows[tick])
            start = now()
            step()
            self.times.append((now() - start) * 1e-3)
            self.tick = tick + 1

    def check(self) -> None:
        """Raise ``AssertionError`` unless all signals are the recorded ones, to the last bit."""
        row = self._recorded[self.tick - 1]
        for name, place, first, end in self._signals:
            if (self.library.memory[place : place + end - first] != row[first:end]).any():
                raise AssertionError(f"{name} of the library differs from the recorded jump")


def export(
    rounds: int = 3,
    ticks: int | None = None,
    count: int = 1_000_000,
    seconds: float = 10.0,
    tsid: str = "",
) -> list[Row]:
    """Measure and return the rows.

    Args:
        rounds: how often the jump is run again.
        ticks: how much of the jump is used; by default all.
        count: the ticks of the program in C, of which the longest is told.
        seconds: how long it runs at each rate in real time.
        tsid: a folder with the wheels of TSID, which is a peer then.

    Raises:
        AloftError: there is no C compiler, or TSID is not there.
        AssertionError: the library computes something else than was recorded.
    """
    if not shutil.which("cc"):
        raise AloftError("the library is linked by a C compiler, and there is no cc")
    module = import_tsid(Path(tsid)) if tsid else None  # before anything imports Pinocchio
    jump = record_jump(ticks)
    fused = RecordedController(jump)
    cases: dict[str, Any] = {
        FUSED: fused,
        BARE: RecordedController(jump, timing=False, checks=False, record=False),
    }
    if module is not None:
        cases[TSID] = _tsid_controller(jump, module)
    with tempfile.TemporaryDirectory(prefix="aloft-bench-") as folder:
        written = write_library(str(GRAPH), Path(folder) / "jumper")
        cases[LIBRARY] = own = _TimedController(jump, fused, written.description)
        names = list(cases)
        with _quiet():
            for _ in range(rounds + 1):
                for case in cases.values():
                    case.again()
                for turn in range(-(-jump.ticks // CHUNK)):
                    shift = turn % len(names)
                    for name in (*names[shift:], *names[:shift]):
                        cases[name].run(CHUNK)
        own.check()
        fused.check()
        alone = _in_c(written.description, own, count, seconds)
    times = {name: np.array(case.times[-rounds * jump.ticks :]) for name, case in cases.items()}
    return [*_rows(times), *_rows_in_c(alone, own.library.about, count, seconds)]


def _rows(times: Mapping[str, NDArray[np.float64]]) -> list[Row]:
    median = {name: float(np.median(found)) for name, found in times.items()}

    def row(peer: str, goal: float | None, note: str) -> Row:
        ratio = float(np.median(times[LIBRARY] / times[peer]))
        name = f"{LIBRARY}, beside {peer}"
        return Row(name, median[LIBRARY], "us/tick", peer, ratio, goal, note=note)

    found = [
        Row(FUSED, median[FUSED], "us/tick", note="with times, checks and record"),
        row(FUSED, GOAL, "called from Python; it checks inputs and all signals"),
        Row(BARE, median[BARE], "us/tick"),
        row(BARE, None, "the same, without checks in the other"),
    ]
    if TSID in times:
        found += [Row(TSID, median[TSID], "us/tick"), row(TSID, None, "")]
    return found


def _rows_in_c(
    alone: Mapping[str, Any], about: Mapping[str, Any], count: int, seconds: float
) -> list[Row]:
    granted = ", ".join(
        f"{words}{'' if alone[key] else ' refused'}"
        for key, words in (
            ("pinned", "one processor"), ("locked", "locked memory"), ("fifo", "SCHED_FIFO"),
        )
    )  # fmt: skip
    one = alone["tick"]
    rows = [
        Row("library in C, a tick", one["p50"] * 1e-3, "us/tick", note=granted),
        Row(
            "library in C, longest tick", one["worst"] * 1e-6, "ms",
            note=f"of {count}; 99 % below {one['p99'] * 1e-3:.1f} us, 99.99 % below {one['p99_99'] * 1e-3:.1f} us",
        ),
        Row("library, memory of an instance", about["memory_bytes"] * 1e-3, "kB"),
        Row("library, constants", about["constant_bytes"] * 1e-3, "kB"),
        Row("library, stack of a step", alone["stack"] * 1e-3, "kB", note="with 1 MB painted before"),
    ]  # fmt: skip
    for rate in RATES:
        wake = alone[f"wake_{rate}"]
        rows.append(
            Row(
                f"library in C at {rate} Hz, latest wake-up", wake["worst"] * 1e-6, "ms",
                note=f"{seconds:g} s; median {wake['p50'] * 1e-3:.1f} us, 99 % below "
                f"{wake['p99'] * 1e-3:.1f} us; {alone[f'late_{rate}']} periods missed",
            )
        )  # fmt: skip
    return rows


def _in_c(description: Path, own: _TimedController, count: int, seconds: float) -> dict[str, Any]:
    """Run the program in C and return the figures that it prints."""
    folder, name = description.parent, own.library.about["name"]
    write_names(own.library.about, folder)
    (folder / "inputs").write_bytes(own.rows.tobytes())
    made = folder / "ticks"
    command = [
        "cc", "-std=c11", "-O2", f"-I{folder}", str(_PROGRAM), str(folder / f"{name}.o"),
        "-lm", "-pthread", "-o", str(made),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise AloftError(f"cc fails: {done.stderr.strip()}")
    run = [str(made), str(folder / "inputs"), str(count), str(max(1, round(seconds)))]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    if done.returncode:
        raise AssertionError(f"the library fails in C with {done.returncode}")
    found: dict[str, Any] = json.loads(done.stdout)
    return found
