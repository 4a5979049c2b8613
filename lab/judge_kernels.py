"""Kernels drawn from the whole language, each judged by what nobody here wrote: NumPy, and Numba.

The judge is the function as it is written, which NumPy runs, and ``numba.njit`` of the same source where that takes
it. Plain Python with its loops, machine code, a sequence of calls and a library of C that is exported and linked must
have the same bytes among each other; integers, flags, copies and single operations on exact numbers must be NumPy's,
and other numbers as near as ``rounding_bounds`` allows.

::

    python -m aloft.lab.judge_kernels 20000   # an hour of processor time; --numba 50 asks Numba for every 50th
"""

from __future__ import annotations

import argparse
import importlib.util
import random
import re
import sys
import tempfile
import types
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..runtime.testing.numpy_oracle import arrays_in
from .kernel_grammar import ARGUMENTS, HEAD, Drawn
from .rounding_bounds import FUNCTIONS, AtThreshold, bounds_in, values_in, with_bounds

UNDECIDED = 1e-12
"""By how much numbers may differ, relative to each, where rounding decides which way a kernel goes."""


class Tally(NamedTuple):
    """A count of what came of some kernels: how many were taken, refused, not NumPy's either, judged by Numba; and what was wrong."""

    counts: Counter[str]
    wrong: list[str]
    refusals: Counter[str]


def modules_of(count: int, seed: int, folder: Path, each: int = 40) -> Any:
    """Yield modules of drawn kernels, with the names of these."""
    for first in range(0, count, each):
        names = [f"drawn_{k}" for k in range(first, min(first + each, count))]
        text = HEAD + "\n".join(
            Drawn(name, random.Random(f"{seed} {name}")).source() for name in names
        )
        yield module_of(folder / f"drawn_{seed}_{first}.py", text), names


def module_of(file: Path, text: str) -> Any:
    """Write a module and import it."""
    file.write_text(text)
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = module
    spec.loader.exec_module(module)
    return module


def arguments_for(module: Any, seed: int) -> list[Any]:
    """Draw arguments: multiples of 1/8, and small whole numbers."""
    chance = np.random.default_rng(seed)

    def drawn(*shape: int) -> Any:
        return chance.integers(-32, 33, shape) / 8.0

    body = module.Body(drawn(3, 3), drawn(5), module.Inner(drawn(3), chance.integers(-9, 10, 3)))
    return [
        drawn(3), drawn(3), drawn(6), drawn(3, 3), drawn(3, 4), chance.integers(-9, 10, 4), chance.random(3) < 0.5, body,
        float(drawn(1)[0]), int(chance.integers(0, 3)), drawn(3), drawn(6), drawn(3, 3), drawn(8), chance.integers(-9, 10, 4),
    ]  # fmt: skip


def copied(values: Any) -> Any:
    """Copy arguments, also in records."""
    if isinstance(values, np.ndarray):
        return values.copy()
    if isinstance(values, tuple):
        return type(values)(*map(copied, values))
    return [copied(each) for each in values] if isinstance(values, list) else values


def untouched(function: Any, others: Mapping[str, Any] = {}) -> Any:
    """Return the function as it is written, which calls kernels as they are written, and ``others`` by their names."""
    from ..mathematics.compiling.kernel_registry import is_kernel, written_code

    names = dict(function.__globals__)
    for name, value in list(names.items()):
        if is_kernel(value) and value is not function:
            names[name] = types.FunctionType(written_code(value), names, name, value.__defaults__)
    names |= {"cross": np.cross, **others}
    return types.FunctionType(written_code(function), names, function.__name__)


def bounds_of(function: Any, arguments: list[Any], expected: list[Any]) -> list[Any] | None:
    """Return by how much numbers may differ from those that NumPy has made of some arguments; none where rounding
    decides which way the kernel goes."""
    carried = with_bounds(copied(arguments))
    table = with_bounds(function.__globals__["TABLE"].copy())
    try:
        untouched(function, {**FUNCTIONS, "TABLE": table})(*carried)
    except AtThreshold:
        return None
    bounds = bounds_in(carried)
    if differs(values_in(carried), expected, bounds):
        raise AssertionError(f"the bounds are of another run: {values_in(carried)} {expected}")
    return bounds


def differs(found: Any, expected: Any, bounds: Sequence[Any] | None) -> bool:
    """Return whether two arrays differ by more than rounding may make of them."""
    pairs = list(zip(arrays_in(found), arrays_in(expected), strict=True))
    for k, (one, other) in enumerate(pairs):
        if one.dtype.kind != "f":
            if one.tobytes() != other.tobytes():
                return True
            continue
        allowed = UNDECIDED * np.maximum(1.0, np.abs(other)) if bounds is None else bounds[k]
        near = np.abs(one - other) <= allowed
        if not np.all(near | (np.isnan(one) & np.isnan(other)) | (one == other)):
            return True
    return False


class Judged(NamedTuple):
    """A run of a kernel that plain Python and NumPy agree on: its arguments before and after, and the bounds of these."""

    name: str
    kernel: Any
    before: list[Any]
    after: list[Any]
    bounds: list[Any] | None


class Judge:
    """Judges modules of drawn kernels, and counts; see the top of this file."""

    def __init__(self, seed: int, numba_every: int, exported_every: int, runs: int) -> None:
        self._seed, self._numba_every, self._exported_every = seed, numba_every, exported_every
        self._runs = runs
        self.tally = Tally(Counter(), [], Counter())

    def judge(self, module: Any, names: Sequence[str]) -> None:
        """Judge the kernels of a module."""
        judged = [each for name in names for each in self._by_numpy(module, name)]
        taken = self._by_machine_code(module, judged)
        for k, each in enumerate(taken):
            if self._numba_every and k % self._numba_every == 0:
                self._by_numba(module, each)
        first = [each for k, each in enumerate(taken) if k == 0 or taken[k - 1].name != each.name]
        if exported := first[:: self._exported_every] if self._exported_every else []:
            self._by_exported_library(module, exported)

    def _text_of(self, module: Any, name: str) -> str:
        source = Path(module.__file__).read_text()
        return source[source.index(f"def {name}(") :].split("\n\n")[0]

    def _wrong(self, module: Any, name: str, text: str) -> None:
        self.tally.wrong.append(f"{text}\n{self._text_of(module, name)}")

    def _refused(self, module: Any, name: str, text: str) -> None:
        self.tally.counts["refused"] += 1
        if not re.search(r"drawn_\d+_\d+\.py:\d+: kernel", text):
            self._wrong(module, name, f"refused without a line: {text}")
        self.tally.refusals[re.sub(r".*?: kernel \S+: ", "", text)[:60]] += 1

    def _by_numpy(self, module: Any, name: str) -> Iterator[Judged]:
        """Run a kernel as it is written, and in plain Python with its loops; yield the runs that are right."""
        from ..mathematics.compiling.expressions import EquationError
        from ..mathematics.kernel import expand

        counts, refusals = self.tally.counts, self.tally.refusals
        function = getattr(module, name)
        try:
            expand(function)
        except EquationError as error:
            self._refused(module, name, str(error))
            return
        except Exception as error:  # noqa: BLE001  # whatever it is, it is a mistake of ours
            self._wrong(module, name, f"{type(error).__name__}: {error}")
            return
        for run in range(self._runs):
            arguments = arguments_for(module, 1000 * self._seed + run)
            expected, plain = copied(arguments), copied(arguments)
            try:
                untouched(function)(*expected)
            except Exception as error:  # noqa: BLE001  # NumPy has its own limits
                counts["not NumPy's"] += 1
                refusals[f"NumPy: {error}"[:70]] += 1
                return
            try:
                function(*plain)
            except (ZeroDivisionError, OverflowError):
                counts["errors of numbers"] += 1
                return
            except Exception as error:  # noqa: BLE001
                if isinstance(error, IndexError) and "a slice of" in str(error):
                    counts["refused in the run"] += 1
                    return
                self._wrong(module, name, f"plain Python: {type(error).__name__}: {error}")
                return
            bounds = bounds_of(function, arguments, expected)
            counts["rounding decides"] += bounds is None
            if differs(plain, expected, bounds):
                rows = zip(arrays_in(plain)[-5:], arrays_in(expected)[-5:], strict=True)
                text = "; ".join(f"{a} {b}" for a, b in rows if a.tobytes() != b.tobytes())
                self._wrong(module, name, f"plain Python is not NumPy: {text}")
                return
            yield Judged(name, function, arguments, plain, bounds)

    def _by_machine_code(self, module: Any, judged: Sequence[Judged]) -> list[Judged]:
        """Compare machine code, by itself and fused, with plain Python; returns the runs that were compiled."""
        from ..mathematics.compiling.call_sequence import CallSequence
        from ..mathematics.compiling.compile_calls import compile_calls
        from ..mathematics.compiling.kernel_call import KernelCall

        alone, fused = (
            [KernelCall(each.kernel, *copied(each.before)) for each in judged] for _ in range(2)
        )
        reason = compile_calls([*alone, *fused])
        for text in reason.split("; ") if reason else ():
            self.tally.refusals[re.sub(r".*?: ", "", text)[:60]] += 1
        taken = []
        for each, call, second in zip(judged, alone, fused, strict=True):
            if call.compiled is None:
                self.tally.counts["plain only"] += 1
                continue
            try:
                call.run()
            except (ZeroDivisionError, OverflowError, ValueError) as error:
                self._wrong(module, each.name, f"machine code: {error}")
                continue
            self.tally.counts["taken"] += 1
            row = CallSequence([second])
            row.prepare()
            row.run()
            if not row.native:
                self._wrong(module, each.name, "it is not fused")
            self._expect_bytes(module, each, list(call.arguments), "machine code")
            self._expect_bytes(module, each, list(second.arguments), "fused machine code")
            taken.append(each)
        return taken

    def _expect_bytes(self, module: Any, each: Judged, found: Any, tier: str) -> None:
        for one, other in zip(arrays_in(each.after), arrays_in(found), strict=True):
            if one.tobytes() != other.tobytes():
                self._wrong(module, each.name, f"{tier} is not plain Python: {one} {other}")
                return

    def _by_exported_library(self, module: Any, judged: Sequence[Judged]) -> None:
        """Compare what an exported library, linked by the compiler of C, makes of some kernels, unless the sizes of
        their arguments make a graph refuse them."""
        from ..mathematics.compiling.rehearsal import mistake_in

        refused = {each.name: mistake_in(each.kernel, each.before, run=False) for each in judged}
        judged = [each for each in judged if not refused[each.name]]
        for name, text in refused.items():
            if text:
                self._refused(module, name, text)
        if not judged:
            return
        with tempfile.TemporaryDirectory() as folder:
            found = run_exported(module, judged, Path(folder))
        self.tally.counts["in exported libraries"] += len(judged)
        for each, results in zip(judged, found, strict=True):
            self._expect_bytes(module, each._replace(after=each.after[-len(RESULTS) :]), results, "an exported library")  # fmt: skip

    def _by_numba(self, module: Any, judged: Judged) -> None:
        """Judge a kernel by Numba as well, where that takes its source."""
        import numba

        from ..mathematics.compiling.kernel_registry import is_kernel, written_code

        if re.search(r"norm\(.*:-", self._text_of(module, judged.name)):
            self.tally.counts["not Numba's"] += 1  # its norm of a reversed vector is wrong
            return
        names = dict(vars(module))
        for each, value in list(names.items()):
            if is_kernel(value):
                names[each] = numba.njit(
                    types.FunctionType(written_code(value), names, each, value.__defaults__)
                )
        expected = copied(judged.before)
        try:
            names[judged.name](*expected)
        except Exception:  # noqa: BLE001  # Numba has its own language
            self.tally.counts["not Numba's"] += 1
            return
        self.tally.counts["judged by Numba"] += 1
        if differs(judged.after, expected, judged.bounds):
            self._wrong(module, judged.name, "plain Python is not Numba")


RESULTS: Mapping[str, str] = {"p": "3", "q": "6", "M": "(3, 3)", "r": "8", "m": "4, dtype='int64'"}
"""The arguments into which drawn kernels write, the last of them, and what fields they are copied to."""


def exported_source(module: Any, judged: Sequence[Judged]) -> str:
    """Return the text of blocks that each call a kernel, and copy what it has written to their output."""
    names = [each.partition(":")[0] for each in ARGUMENTS.split(", ")]
    copies = "; ".join(f"results.{each}[:] = {each}" for each in RESULTS)
    lines = [
        f"from {module.__name__} import *",
        "from aloft import Block, Field, Output, Signal",
        "GIVEN = []",
        "class Results(Signal):",
        *(f"    {name} = Field({what}, unit='1', text='{name}')" for name, what in RESULTS.items()),
    ]
    for k, each in enumerate(judged):
        lines += [
            f"class Block{k}(Block):",
            "    results = Output(Results, text='what it writes')",
            "    def setup(self):",
            f"        {', '.join(f'self.{name}' for name in names)} = GIVEN[{k}]",
            "    @kernel",
            "    @staticmethod",
            f"    def step({ARGUMENTS}, results: Results) -> None:",
            f"        {each.name}({', '.join(names)}); {copies}",
        ]
    return "\n".join(lines) + "\n"


def run_exported(module: Any, judged: Sequence[Judged], folder: Path) -> list[list[Any]]:
    """Export a graph of blocks that each call a kernel, let the compiler of C link it, step it once, and return what
    they have written."""
    from ..extensions.export.clib.library import SharedLibrary
    from ..extensions.export.clib.write import write_library

    name = f"exported_{module.__name__}"
    exported = module_of(folder / f"{name}.py", exported_source(module, judged))
    exported.GIVEN += [copied(each.before) for each in judged]
    blocks = "".join(f"  b{k}: {{use: '{name}:Block{k}'}}\n" for k in range(len(judged)))
    graph = folder / "graph.yaml"
    graph.write_text(f"rate: 100 Hz\nblocks:\n{blocks}")
    outputs = [f"b{k}.results" for k in range(len(judged))]
    library = SharedLibrary(
        write_library(str(graph), folder / "drawn", outputs=outputs).description
    )
    if status := library.step():
        raise AssertionError(f"the exported library ends with {status}")
    return [
        [library.outputs[f"b{k}.results.{each}"] for each in RESULTS] for k in range(len(judged))
    ]


def judge(
    count: int, seed: int = 0, numba_every: int = 0, exported_every: int = 10, runs: int = 2
) -> Tally:
    """Draw kernels and judge them; see the top of this file."""
    judging = Judge(seed, numba_every, exported_every, runs)
    with tempfile.TemporaryDirectory() as folder, np.errstate(all="ignore"):
        for module, names in modules_of(count, seed, Path(folder)):
            judging.judge(module, names)
    return judging.tally


def main() -> int:
    """Draw and judge as many kernels as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--exported", type=int, default=1, metavar="N", help="link every so many in a library of C"
    )
    parser.add_argument(
        "--numba", type=int, default=0, metavar="N", help="ask Numba for every so many"
    )
    given = parser.parse_args()
    tally = judge(given.count, given.seed, given.numba, given.exported)
    print(dict(tally.counts))
    print(tally.refusals.most_common(40))
    for text in tally.wrong[:10]:
        print(text, end="\n\n")
    print(f"{len(tally.wrong)} wrong of {given.count}")
    return bool(tally.wrong)


if __name__ == "__main__":
    sys.exit(main())
