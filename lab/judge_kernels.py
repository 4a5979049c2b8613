"""Kernels drawn from the whole language, each judged by what nobody here wrote: NumPy, and Numba.

The judge is the function as it is written, which NumPy runs, and ``numba.njit`` of the same source where that takes
it. Plain Python with its loops, machine code, that of an exported library and a sequence of calls must have the same
bytes among each other; integers, flags and copies must be NumPy's, and numbers with a fraction as near as rounding allows: what is read
are multiples of 1/8, so sums and products are exact, and what is left are divisions, roots and elementary functions.

::

    python -m aloft.lab.judge_kernels 20000   # about 25 minutes of processor time; --numba 50 asks Numba for every 50th
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.util
import random
import re
import sys
import tempfile
import types
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..runtime.testing.numpy_oracle import arrays_in
from .kernel_grammar import HEAD, Drawn

PORTABLE_EVERY = 10
"""Every so many kernels are compiled as for an exported library, too."""


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
        file = folder / f"drawn_{seed}_{first}.py"
        file.write_text(text)
        spec = importlib.util.spec_from_file_location(file.stem, file)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[file.stem] = module
        spec.loader.exec_module(module)
        yield module, names


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


def untouched(function: Any) -> Any:
    """Return the function as it is written, which calls others as they are written."""
    from ..mathematics.compiling.kernel_registry import is_kernel, written_code

    names = dict(function.__globals__)
    for name, value in list(names.items()):
        if is_kernel(value) and value is not function:
            names[name] = types.FunctionType(written_code(value), names, name, value.__defaults__)
    names["cross"] = np.cross
    names["half"] = lambda x, gain=0.5: gain * x  # also of whole arrays, as in an equation
    names["min"], names["max"] = min, max
    return types.FunctionType(written_code(function), names, function.__name__)


def differs(found: Any, expected: Any) -> bool:
    """Return whether two arrays differ by more than rounding."""
    for one, other in zip(arrays_in(found), arrays_in(expected), strict=True):
        if one.dtype.kind != "f":
            if one.tobytes() != other.tobytes():
                return True
            continue
        near = np.abs(one - other) <= 1e-12 * np.maximum(1.0, np.abs(other))
        if not np.all(near | (np.isnan(one) & np.isnan(other)) | (one == other)):
            return True
    return False


def judge(count: int, seed: int = 0, numba_every: int = 0, runs: int = 2) -> Tally:
    """Draw kernels and judge them; see the top of this file."""
    from ..mathematics.compiling.call_sequence import CallSequence
    from ..mathematics.compiling.compile_calls import compile_calls
    from ..mathematics.compiling.expressions import EquationError
    from ..mathematics.compiling.kernel_call import KernelCall
    from ..mathematics.kernel import expand

    tally = Tally(Counter(), [], Counter())

    def wrong(module: Any, name: str, text: str) -> None:
        source = Path(module.__file__).read_text()
        body = source[source.index(f"def {name}(") :].split("\n\n")[0]
        tally.wrong.append(f"{text}\n{body}")

    with tempfile.TemporaryDirectory() as folder, np.errstate(all="ignore"):
        for module, names in modules_of(count, seed, Path(folder)):
            pending: list[tuple[str, Any, Any, list[Any], list[Any]]] = []
            for name in names:
                function = getattr(module, name)
                try:
                    expand(function)
                except EquationError as error:
                    tally.counts["refused"] += 1
                    text = str(error)
                    if not re.search(r"drawn_\d+_\d+\.py:\d+: kernel", text):
                        wrong(module, name, f"refused without a line: {text}")
                    tally.refusals[re.sub(r".*?: kernel \S+: ", "", text)[:60]] += 1
                    continue
                except Exception as error:  # noqa: BLE001  # whatever it is, it is a mistake of ours
                    wrong(module, name, f"{type(error).__name__}: {error}")
                    continue
                for run in range(runs):
                    arguments = arguments_for(module, 1000 * seed + run)
                    expected, plain, compiled = (
                        copied(arguments),
                        copied(arguments),
                        copied(arguments),
                    )
                    try:
                        untouched(function)(*expected)
                    except Exception as error:  # noqa: BLE001  # NumPy has its own limits
                        tally.counts["not NumPy's"] += 1
                        tally.refusals[f"NumPy: {error}"[:70]] += 1
                        break
                    try:
                        function(*plain)
                    except Exception as error:  # noqa: BLE001
                        if isinstance(error, ZeroDivisionError | OverflowError):
                            tally.counts["errors of numbers"] += 1
                            break
                        if isinstance(error, IndexError) and "a slice of" in str(error):
                            tally.counts["refused in the run"] += 1
                            break
                        wrong(module, name, f"plain Python: {type(error).__name__}: {error}")
                        break
                    if differs(plain, expected):
                        wrong(
                            module,
                            name,
                            f"plain Python is not NumPy: {arrays_in(plain)[-5:]} {arrays_in(expected)[-5:]}",
                        )
                        break
                    pending.append(
                        (name, KernelCall(function, *compiled), plain, compiled, arguments)
                    )
            fused = [KernelCall(each[1].kernel, *copied(each[4])) for each in pending]
            reason = compile_calls([*(each[1] for each in pending), *fused])
            for text in reason.split("; ") if reason else ():
                tally.refusals[re.sub(r".*?: ", "", text)[:60]] += 1
            for k, (name, call, plain, compiled, arguments) in enumerate(pending):
                if call.compiled is None:
                    tally.counts["plain only"] += 1
                    continue
                try:
                    call.run()
                except (ZeroDivisionError, OverflowError, ValueError) as error:
                    wrong(module, name, f"machine code: {error}")
                    continue
                tally.counts["taken"] += 1
                for one, other in zip(arrays_in(plain), arrays_in(compiled), strict=True):
                    if one.tobytes() != other.tobytes():
                        wrong(module, name, f"machine code is not plain Python: {one} {other}")
                        break
                row = CallSequence([fused[k]])
                row.prepare()
                row.run()
                for one, other in zip(
                    arrays_in(compiled), arrays_in(list(fused[k].arguments)), strict=True
                ):
                    if not row.native or one.tobytes() != other.tobytes():
                        wrong(
                            module,
                            name,
                            f"fused machine code is not that of one call: {one} {other}",
                        )
                        break
                if k % PORTABLE_EVERY == 0:
                    portable = copied(arguments)
                    run_as_exported(getattr(module, name), portable)
                    if any(
                        one.tobytes() != other.tobytes()
                        for one, other in zip(arrays_in(plain), arrays_in(portable), strict=True)
                    ):
                        wrong(module, name, "code for the oldest processor is not plain Python")
                if numba_every and k % numba_every == 0:
                    ask_numba(module, name, plain, arguments, tally, wrong)
    return tally


def run_as_exported(kernel: Any, arguments: list[Any]) -> None:
    """Run a kernel compiled as exported libraries are: for the oldest processor of this computer's kind."""
    from ..mathematics.compiling.arguments import pack, type_of
    from ..mathematics.compiling.machine_code import (
        OLDEST,
        MachineCode,
        cross_compiled,
        process_triple,
    )
    from ..mathematics.compiling.translate import Translator

    triple = process_triple()
    text = Translator().module(kernel, tuple(map(type_of, arguments)))
    words = pack(tuple(arguments))
    code = MachineCode(cross_compiled(text, triple, OLDEST[triple]))
    code.function(ctypes.c_size_t(words.ctypes.data))


def ask_numba(
    module: Any, name: str, plain: Any, arguments: list[Any], tally: Tally, wrong: Any
) -> None:
    """Judge a kernel by Numba as well, where that takes its source."""
    import numba

    from ..mathematics.compiling.kernel_registry import is_kernel, written_code

    names = dict(vars(module))
    for each, value in list(names.items()):
        if is_kernel(value):
            names[each] = numba.njit(
                types.FunctionType(written_code(value), names, each, value.__defaults__)
            )
    expected = copied(arguments)
    try:
        names[name](*expected)
    except Exception:  # noqa: BLE001  # Numba has its own language
        tally.counts["not Numba's"] += 1
        return
    tally.counts["judged by Numba"] += 1
    if differs(plain, expected):
        wrong(module, name, "plain Python is not Numba")


def main() -> int:
    """Draw and judge as many kernels as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--numba", type=int, default=0, metavar="N", help="ask Numba for every so many"
    )
    given = parser.parse_args()
    tally = judge(given.count, given.seed, given.numba)
    print(dict(tally.counts))
    print(tally.refusals.most_common(40))
    for text in tally.wrong[:10]:
        print(text, end="\n\n")
    print(f"{len(tally.wrong)} wrong of {given.count}")
    return bool(tally.wrong)


if __name__ == "__main__":
    sys.exit(main())
