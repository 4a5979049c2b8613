"""Runs a recording through a library and compares every byte with what the graph computed."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....logs.file.reader import RecordedRun, read
from ....runtime.language.errors import AloftError
from ....runtime.language.layout import Layout
from .library import SharedLibrary, views
from .module import Status
from .targets import TARGETS

_DRIVERS = Path(__file__).parent


@dataclass(frozen=True)
class Checked:
    """Numbers of ticks, bytes of signals and bytes of state that were compared, and the first difference; ``statuses``
    counts the non-zero return values of the steps. ``step_s`` is the median duration of a step [s], with the call from
    Python; none where an emulator ran it.
    """

    ticks: int
    signal_bytes: int
    state_bytes: int
    difference: str
    statuses: Mapping[str, int]
    step_s: float | None


def check(description: Path, recording: Path) -> Checked:
    """Feed every tick of a recording to a library, here or in an emulator of its processor.

    Args:
        description: the file ``NAME.json`` of the library.
        recording: of a run of the same graph, from its first tick on.

    Raises:
        AloftError: a tool is missing, or the recording has not what the library needs.
    """
    about = json.loads(description.read_text(encoding="utf-8"))
    run = read(recording)
    _expect_fitting(about, run)
    steps = input_rows(about, run.header.bus.layout(), run.rows)
    memories, step = _run(description, about, steps)
    codes = memories[:, 8:12].copy().view(np.int32)[:, 0]
    counts = {Status(int(c)).name: int(np.sum(codes == c)) for c in np.unique(codes) if c}
    rows, layout = run.rows, run.header.bus.layout()
    signals = {name: each for name, each in about["signals"].items() if name in layout.slots}
    found = [
        _first_difference(memories, layout, rows, name, place, run.ticks)
        for name, (place, *_) in signals.items()
    ]
    state_layout = run.header.state.layout()
    states = {name: each for name, each in about["states"].items() if name in state_layout.slots}
    frames = [tick for tick in run.keyframes if 0 < tick <= len(steps)]
    if frames:
        kept = np.stack([np.frombuffer(run.snapshot(tick).state, np.uint8) for tick in frames])
        after = memories[np.array(frames) - 1]
        found += [
            _first_difference(after, state_layout, kept, name, place, np.array(frames))
            for name, (place, *_) in states.items()
        ]
    first = min((each for each in found if each is not None), default=None)
    sizes = [
        sum(end - start for start, end in map(each.byte_range, names))
        for each, names in ((layout, signals), (state_layout, states))
    ]
    return Checked(
        len(steps),
        sizes[0] * len(steps),
        sizes[1] * len(frames),
        first[1] if first else "",
        counts,
        step,
    )


def _expect_fitting(about: Mapping[str, Any], run: RecordedRun) -> None:
    if not len(run.ticks) or run.ticks[0] != 0 or len(run.ticks) != run.ticks[-1] + 1:
        raise AloftError(f"{run.path} has not every tick from the first on")
    if run.parameter_changes:
        raise AloftError(f"{run.path} is of a run in which parameters were changed")
    slots = run.header.bus.layout().slots
    missing = [each["source"] for each in about["inputs"] if each["source"] not in slots]
    missing += [name for name in about["signals"] if name not in slots and "~" not in name]
    if missing:
        raise AloftError(f"{run.path} is of another graph; it has no {', '.join(missing[:5])}")


def input_rows(
    about: Mapping[str, Any], layout: Layout, rows: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Return the struct of the inputs in every tick, (ticks, bytes), from the bus of each, (ticks, bus bytes)."""
    data = np.zeros((len(rows), about["input_bytes"]), np.uint8)
    targets = views(data, about["inputs"])
    for each in about["inputs"]:
        targets[each["name"]][...] = layout.view(
            rows, _recorded_name(about, layout, each["source"])
        )
    return data


def _recorded_name(about: Mapping[str, Any], layout: Layout, source: str) -> str:
    """Return the recorded signal that is given as an input: behind the delay, where that is outside of the library.

    Raises:
        AloftError: the delayed wire joins several sources, so no recorded signal is the input.
    """
    port, _, field = source.rpartition(".")
    for delay in about.get("input_delays", ()):  # older ones have none
        if delay["side"] == "outside" and port in delay["sources"]:
            path, _, name = delay["reader"].rpartition(".")
            late = f"{path}/{name}~delay.y.{field}"
            if late not in layout.slots or f"{path}/{name}~parts.y.{field}" in layout.slots:
                raise AloftError(
                    f"the wire to {delay['reader']} joins parts and is delayed outside, so a recording cannot be "
                    "compared; write the library with --delays inside"
                )
            return late
    return source


def _run(
    description: Path, about: Mapping[str, Any], steps: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], float | None]:
    """Return the memory of an instance after each step, (ticks, bytes), and the median duration of one."""
    size = about["memory_bytes"]
    if about["target"] == "x86_64":
        library = SharedLibrary(description)
        memories = np.empty((len(steps), size), np.uint8)
        times = np.empty(len(steps))
        for k, row in enumerate(steps):
            library.take(row)
            began = time.perf_counter()
            library.step()
            times[k] = time.perf_counter() - began
            memories[k] = library.memory
        return memories, float(np.median(times))
    with tempfile.TemporaryDirectory(prefix="aloft-check-") as folder:
        given, found = Path(folder) / "inputs", Path(folder) / "memories"
        given.write_bytes(steps.tobytes())
        command = _program(description, about, Path(folder))
        done = subprocess.run(
            [*command, str(given), str(found)], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise AloftError(f"the library fails on {about['target']}: {done.stderr.strip()}")
        return np.frombuffer(found.read_bytes(), np.uint8).reshape(len(steps), size), None


def _program(description: Path, about: Mapping[str, Any], folder: Path) -> list[str]:
    """Return the command that runs all steps on another processor."""
    target, name = TARGETS[about["target"]], about["name"]
    linker = target.linker()
    if not linker or not shutil.which(target.runner[0]):
        raise AloftError(
            f"a check on {about['target']} needs programs that are not here: apt install {target.packages}"
        )
    if about["target"] == "wasm":
        sizes = [str(about[f"{each}_bytes"]) for each in ("memory", "input", "output")]
        driver = str(_DRIVERS / "driver.mjs")
        return [*target.runner, driver, str(description.with_suffix(".wasm")), name, *sizes]
    write_names(about, folder)
    source, made = description.parent.resolve(), folder / "driver"
    command = [
        linker, "-O1", "-static", f"-I{source}", f"-I{folder}", str(_DRIVERS / "driver.c"),
        str(source / f"{name}.o"), "-lm", "-o", str(made),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise AloftError(f"{linker} fails: {done.stderr.strip()}")
    return [*target.runner, str(made)]


def write_names(about: Mapping[str, Any], folder: Path) -> None:
    """Write ``library.h``, by which a program in C calls any library: ``lib_step`` and so on."""
    name = about["name"]
    (folder / "library.h").write_text(
        f'#include "{name}.h"\n'
        + "".join(
            f"#define lib_{each} {name}_{each}\n"
            for each in ("init", "reset", "step", "inputs", "outputs")
        )
        + f"#define LIB {name}\n#define LIB_MEMORY_SIZE {about['memory_bytes']}\n"
        + f"#define LIB_INPUT_SIZE {about['input_bytes']}\n",
        encoding="utf-8",
    )


def _first_difference(
    memories: NDArray[np.uint8],
    layout: Layout,
    rows: NDArray[np.uint8],
    name: str,
    place: int,
    ticks: NDArray[np.int64],
) -> tuple[int, str] | None:
    """Return the first tick in which a slot has other bytes than were recorded, and a text about it."""
    first, end = layout.byte_range(name)
    own, kept = memories[:, place : place + end - first], rows[:, first:end]
    wrong = np.flatnonzero((own != kept).any(axis=1))
    if not len(wrong):
        return None
    row = int(wrong[0])
    dtype = {"float64": np.float64, "int64": np.int64, "bool": np.bool_}[layout.slots[name].section]
    texts = [np.ascontiguousarray(each[row]).view(dtype).tolist() for each in (own, kept)]
    return int(ticks[row]), f"tick {int(ticks[row])}: {name} is {texts[0]}, recorded {texts[1]}"
