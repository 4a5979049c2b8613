"""Shipped kernels, judged on the arguments of real runs by what nobody here wrote: NumPy, and Numba.

Graphs run in plain Python, and some calls of each kernel keep what they got and made. On the same arguments the
function as it is written runs on NumPy's arrays, and machine code runs by itself and in a sequence of calls: NumPy's
numbers may differ by no more than rounding explains (``runtime/testing/numpy_oracle.py``), machine code by no bit.
Steps that no graph makes run on a bench, on inputs drawn at random.

::

    python -m aloft.lab.judge_shipped_kernels          # two minutes
    python -m aloft.lab.judge_shipped_kernels --numba  # and Numba, a second and more a kernel
"""

from __future__ import annotations

import argparse
import sys
import types
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..mathematics.compiling.call_sequence import CallSequence
from ..mathematics.compiling.compile_calls import compile_calls
from ..mathematics.compiling.expressions import cross
from ..mathematics.compiling.kernel_call import KernelCall
from ..mathematics.compiling.kernel_registry import (
    arguments_of,
    is_kernel,
    reports_event,
    written_code,
)
from ..mathematics.compiling.kinds import ArrayKind, RecordKind, argument_kinds
from ..robots.description import find_robot
from ..runtime.graph import load
from ..runtime.language.registry import find_block, known_names
from ..runtime.running.executor import Executor
from ..runtime.testing import numpy_oracle
from ..runtime.testing.bench import BlockBench
from ..runtime.testing.conformance import random_inputs, unmet_messages

GRAPHS: Mapping[str, float] = {
    "jump": 3.0, "jump_twin": 0.3, "from_gantry": 0.5, "hops": 0.3, "push": 0.3, "paper_jump": 0.6, "sway": 0.3,
    "estimator_watching": 0.3, "somersault": 0.2, "commissioning/calibrate": 0.1, "hopping/hop_on": 0.2,
    "hopping/steer_stones": 0.2, "hopping/robots/go2_stairs": 0.1, "robots/g1_jump": 0.1, "robots/g1_hand": 0.1,
    "robots/solo12_jump": 0.1, "robots/sway": 0.1,
}  # fmt: skip
"""How long [s] of these graphs is run."""
CALLS = frozenset((0, 1, 5, 23, 71, 149, 300, 600, 900, 1200))
"""Which calls of a kernel in one run are kept."""
DRAWN_TICKS = 4


class Sample(NamedTuple):
    """A call of a kernel: what it got, and what plain Python made of it."""

    kernel: Callable[..., Any]
    before: list[Any]
    after: list[Any]


Samples = dict[str, list[Sample]]
"""By the name of the kernel."""


class Verdict(NamedTuple):
    """What is wrong, with the kernel's name; how many samples NumPy and Numba judged of each; and why NumPy did not."""

    wrong: list[str]
    numpy: Counter[str]
    numba: Counter[str]
    refusals: dict[str, str]


def record(calls: Iterable[Any], samples: Samples) -> None:
    """Let calls of kernels keep samples from now on."""
    for each in calls:
        if isinstance(each, KernelCall):
            each.run = _recorder(each, samples)


def _recorder(call: KernelCall, samples: Samples) -> Callable[[], None]:
    run, count = call.run, -1

    def recorded() -> None:
        nonlocal count
        count += 1
        if count not in CALLS:
            run()
            return
        before = numpy_oracle.copied(call.arguments)
        run()
        sample = Sample(call.kernel, before, numpy_oracle.copied(call.arguments))
        samples.setdefault(call.name, []).append(sample)

    return recorded


def record_graph(graph: str, duration: float, samples: Samples) -> None:
    """Run the first part of a graph in plain Python, and keep samples."""
    executor = Executor(load(f"aloft:{graph}").checked, plain=True, log=False)
    record(executor.bound.kernel_calls, samples)
    result = executor.run(round(duration * executor.bound.graph.base_rate))
    if result.error is not None:
        raise result.error


def record_drawn(name: str, samples: Samples) -> None:
    """Run a block by itself, with its example parameters and inputs drawn at random, and keep samples."""
    block, robot = find_block(name), find_robot("bruce")
    if unmet_messages(block, robot=robot):
        return
    bench = BlockBench(block, block.example_parameters(), robot=robot, plain=True)
    for calls in (
        getattr(bench.block, "kernel_calls", ()),
        getattr(bench.block, "update_calls", ()),
    ):
        record(calls, samples)
    chance = np.random.default_rng(0)
    for _ in range(DRAWN_TICKS):
        drawn = random_inputs(type(bench.block), bench.block.context.dimensions, chance)
        for port, fields in drawn.items():
            bench.set(port, **fields)
        bench.step()
    bench.close()


def steps_of_blocks() -> dict[str, list[str]]:
    """Return, for each shipped block, the names of the kernels that are its steps."""
    found = {}
    for name in known_names():
        steps = [each for each in find_block(name).named_steps.values() if is_kernel(each)]
        found[name] = [f"{each.__module__}.{each.__qualname__}" for each in steps]
    return found


def judge(samples: Samples, numba: bool = False) -> Verdict:
    """Judge samples by NumPy, by machine code, and by Numba if asked for."""
    verdict = Verdict([], Counter(), Counter(), {})
    rows = [(name, sample) for name, each in samples.items() for sample in each]
    alone = [KernelCall(each.kernel, *numpy_oracle.copied(each.before)) for _, each in rows]
    fused = [KernelCall(each.kernel, *numpy_oracle.copied(each.before)) for _, each in rows]
    if reason := compile_calls([*alone, *fused]):
        verdict.wrong.append(reason)
    row = CallSequence(fused)
    row.prepare()
    row.run()
    if not row.native:
        verdict.wrong.append("the calls are no native sequence")
    for (name, sample), one, other in zip(rows, alone, fused, strict=True):
        try:
            if text := numpy_oracle.difference(sample.kernel, sample.before, sample.after):
                verdict.wrong.append(f"{name} makes {text}")
            verdict.numpy[name] += 1
        except numpy_oracle.NotJudged as error:
            verdict.refusals[name] = repr(error.__cause__ or "rounding decides")
        one.run()
        for call, tier in ((one, "machine code"), (other, "fused machine code")):
            if _bytes(call.arguments) != _bytes(sample.after):
                verdict.wrong.append(f"{tier} of {name} is not plain Python")
        if numba and not verdict.numba[name]:
            _ask_numba(name, sample, verdict)
    return verdict


def _bytes(arguments: Any) -> list[bytes]:
    return [each.tobytes() for each in numpy_oracle.arrays_in(list(arguments))]


def _ask_numba(name: str, sample: Sample, verdict: Verdict) -> None:
    """Judge a sample by Numba, where that takes the kernel as it is written."""
    found = numpy_oracle.copied(sample.before)
    kinds = argument_kinds(sample.kernel).values()
    arguments = [_for_numba(*each) for each in zip(found, kinds, strict=False)]
    try:
        _by_numba(sample.kernel, {})(*arguments)
    except Exception:  # noqa: BLE001  # Numba has its own language
        return
    if reports_event(sample.kernel):
        return
    verdict.numba[name] += 1
    if text := numpy_oracle.difference(sample.kernel, sample.before, found):
        verdict.wrong.append(f"Numba's {name} makes {text}")


def _by_numba(kernel: Any, made: dict[int, Any]) -> Any:
    """Return a kernel as it is written, compiled by Numba with all that it calls."""
    import numba

    if id(kernel) not in made:
        names, code = dict(kernel.__globals__), written_code(kernel)
        function = types.FunctionType(code, names, kernel.__name__, kernel.__defaults__)
        notes = [kernel.__annotations__.get(each) for each in arguments_of(kernel)]
        of_numbers = notes and all(each in ("float", "int", "bool") for each in notes)
        returns_one = kernel.__annotations__.get("return") in ("float", "int", "bool")
        made[id(kernel)] = (numba.vectorize if of_numbers and returns_one else numba.njit)(function)
        names |= {n: _by_numba(names[n], made) for n in code.co_names if is_kernel(names.get(n))}
        names |= {n: np.cross for n in code.co_names if names.get(n) is cross}
    return made[id(kernel)]


def _for_numba(value: Any, kind: Any) -> Any:
    """Return an argument as Numba's users give it: scalar fields are numbers, which cannot be assigned."""
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        parts = kind.parts if isinstance(kind, RecordKind) else {}
        rows = zip(value._fields, value, strict=True)
        return type(value)(*(_for_numba(each, parts.get(name)) for name, each in rows))
    if isinstance(value, np.ndarray) and value.ndim == 0:
        words = kind.words if isinstance(kind, ArrayKind) else ()
        return words[int(value)] if words else value.item()
    return value


def main() -> int:
    """Record, judge, and say which steps of shipped blocks are judged and which are not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--numba", action="store_true", help="ask Numba, too")
    given = parser.parse_args()
    samples: Samples = {}
    for graph, duration in GRAPHS.items():
        record_graph(graph, duration, samples)
        print(f"{graph}: {len(samples)} kernels so far", flush=True)
    steps = steps_of_blocks()
    print(f"in graphs: {sum(each in samples for row in steps.values() for each in row)} steps")
    for name, own in steps.items():
        if not all(each in samples for each in own):
            record_drawn(name, samples)
    verdict = judge(samples, given.numba)
    every = [each for row in steps.values() for each in row]
    print(f"{len(samples)} kernels recorded, {sum(map(len, samples.values()))} calls")
    print(f"{len(verdict.numpy)} judged by NumPy, {sum(verdict.numpy.values())} calls")
    print(f"{len(+verdict.numba)} judged by Numba: {sorted(+verdict.numba)}")
    print(f"steps of blocks not judged: {sorted({*every} - {*verdict.numpy})} of {len({*every})}")
    print(f"sometimes not judged: {verdict.refusals}")
    for text in verdict.wrong[:20]:
        print(text)
    print(f"{len(verdict.wrong)} wrong")
    return bool(verdict.wrong)


if __name__ == "__main__":
    sys.exit(main())
