"""Checks of what every block promises, which need nothing but the block's class.

For a block of your own, write one parametrised test::

    @pytest.mark.parametrize("case", conformance_cases())
    def test_conformance(case: str) -> None:
        check_block(MyBlock, {"gain": 2.0}, cases=[case])

A block that works with robots is checked with each robot that it fits::

    if not unmet_messages(MyBlock, robot="go2"):
        check_block(MyBlock, robot="go2")

Parameters and inputs come from ``Block.example_parameters`` and ``Block.example_inputs``; inputs
that these do not give are random, finite and of order one.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from traceback import extract_tb
from types import CodeType, FunctionType
from typing import Any, Literal, get_args, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, RootModel, ValidationError

from ...mathematics.compiling.compile_calls import compile_calls
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.compiling.kernel_registry import arguments_of
from ...mathematics.rotations import matrices_of_quaternions
from ...robots.description import find_robot
from ...robots.robot_description import RobotDescription
from ..language.block import Block, Clock, Context
from ..language.parameter_change import Adjustment
from ..language.parameters import Parameters, is_live
from ..language.requirements import unmet_requirements
from ..language.signals import Field
from ..running.finite import FiniteCheck
from ..running.live_parameters import LiveParameters
from . import numpy_oracle
from .allocations import count_array_allocations
from .bench import BlockBench

TICKS = 12
"""Ticks of each check: enough to fill most delays."""
WARM_UP = 3
"""Ticks before arrays are counted: libraries allocate their lasting memory in their first calls."""


class ConformanceError(AssertionError):
    """A block breaks a promise, which the message names."""


@dataclass(frozen=True)
class Subject:
    """A block under test, with what is needed to make an instance of it."""

    block_type: type[Block]
    params: Mapping[str, Any]
    robot: str | RobotDescription | None
    rate: float
    dimensions: Mapping[str, int]
    seed: int
    benches: ExitStack = field(default_factory=ExitStack)
    """Closes all benches: a block may hold a device or a thread."""

    def bench(self, *, plain: bool = False) -> BlockBench[Block]:
        """Make a new instance of the block, on a bench of its own."""
        bench = BlockBench(
            self.block_type,
            self.params,
            robot=self.robot,
            rate=self.rate,
            dimensions=self.dimensions,
            plain=plain,
        )
        return self.benches.enter_context(bench)

    def feed(self, bench: BlockBench[Block], ticks: int, seed: int = 0) -> Iterator[int]:
        """Set new inputs for each of at most ``TICKS`` ticks, equal ones for equal seeds; the caller steps the
        block."""
        sizes = tuple(bench.block.context.dimensions.items())
        drawn = _inputs_of(self.block_type, sizes, self.seed, seed)  # type: ignore[arg-type]  # mypy asks the class for __hash__
        for tick, inputs in enumerate(drawn[:ticks]):
            for port, fields in inputs.items():
                bench.set(port, **fields)
            yield tick

    def trace(self, bench: BlockBench[Block], ticks: int = TICKS, seed: int = 0) -> list[bytes]:
        """Step the block with new inputs in each tick; returns its whole memory after each."""
        result = []
        for _ in self.feed(bench, ticks, seed):
            bench.step()
            snapshot = bench.snapshot()
            result.append(snapshot.bus + snapshot.state)
        return result

    @cached_property
    def traced(self) -> list[bytes]:
        """The trace of an instance, which several checks compare with."""
        return self.trace(self.bench())

    @cached_property
    def traced_in_python(self) -> list[bytes]:
        """The same without machine code."""
        return self.trace(self.bench(plain=True))

    def expect(self, holds: bool, message: str) -> None:
        """Raise ``ConformanceError`` with the message unless ``holds`` is true."""
        if not holds:
            raise ConformanceError(f"{self.block_type.__name__}: {message}")


def _documented(subject: Subject) -> None:
    """Check that the block has a docstring of its own, and every port and parameter a text."""
    kind = subject.block_type
    subject.expect(bool((kind.__doc__ or "").strip()), "no docstring")
    subject.expect(kind.__doc__ != Block.__doc__, "no docstring of its own")
    for name, port in {**kind.inputs, **kind.outputs, **kind.states}.items():
        subject.expect(bool(port.text), f"port {name!r} has no text")
        for name_of_field, declared in port.signal.fields.items():
            subject.expect(bool(declared.text), f"{name}.{name_of_field} has no text")
    for name, info in kind.Params.model_fields.items():
        subject.expect(bool(info.description), f"parameter {name!r} has no text")


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _ports_used(subject: Subject) -> None:
    """Every declared port is named somewhere in the code of the class, or taken by a step."""
    kind = subject.block_type
    fits = kind.specialize.__func__ is not Block.specialize.__func__  # type: ignore[attr-defined]  # a class method
    if fits and getattr(sys.modules[kind.__module__], kind.__name__, None) is not kind:
        return  # `specialize` has made it: its ports follow from what it is given, so no code names them
    used: dict[str, None] = {}
    for owner in kind.__mro__:
        for value in vars(owner).values() if issubclass(owner, Block) else ():
            function = getattr(value, "__func__", value)
            if isinstance(function, FunctionType):
                used.update(dict.fromkeys(_names(function.__code__)))
    for function in kind.named_steps.values():
        used.update(dict.fromkeys(arguments_of(function)))
    for name in {**kind.inputs, **kind.outputs, **kind.states}:
        subject.expect(name in used, f"port {name!r} is declared, but no method uses it")


def _outputs_written(subject: Subject) -> None:
    """Every run writes every output and does not depend on its old value, which is no state.

    A field that ``setup`` fills and no run writes is a constant, which is fine.
    """
    kind = subject.block_type
    clean, spoiled = subject.bench(), subject.bench()
    constants: set[tuple[str, str, bytes]] = set()
    feed = zip(subject.feed(clean, TICKS), subject.feed(spoiled, TICKS), strict=True)
    for tick, _ in feed:
        for port in kind.outputs:
            for _, view in spoiled.get(port):
                view[...] = np.nan if view.dtype == np.float64 else view.dtype.type(tick % 2)
        clean.step()
        spoiled.step()
        for port in kind.outputs:
            for name, view in clean.get(port):
                found = port, name, view.tobytes()
                if spoiled.get(port).views()[name].tobytes() == found[2] or found in constants:
                    continue
                subject.expect(
                    _set_up_once(subject, *found),
                    f"output {port}.{name} is not written by every run, or depends on what was in "
                    "it; what is remembered belongs in a State",
                )
                constants.add(found)


def _set_up_once(subject: Subject, port: str, name: str, value: bytes) -> bool:
    """Return whether ``setup`` writes a field of an output, and no run changes it from this
    value."""
    bench = subject.bench(plain=True)
    view = bench.get(port).views()[name]
    if view.tobytes() != value:
        return False
    view[...] = 7  # what no setup is likely to write
    before = view.tobytes()
    bench.block.setup()
    if view.tobytes() == before:
        return False
    constant = True
    for _ in subject.feed(bench, TICKS):
        bench.step()
        constant &= view.tobytes() == value
    return constant


def _bounds(subject: Subject) -> None:
    """Every index lies within its array; compiled code checks none and reads what lies behind."""
    try:
        assert subject.traced_in_python
    except IndexError as error:
        last = extract_tb(error.__traceback__)[-1]
        subject.expect(
            False,
            f"{error}, in {last.name} ({last.filename}:{last.lineno}: {last.line}); compiled, it would "
            "read or write beyond the array",
        )


def _inputs_kept(subject: Subject) -> None:
    """Check that the block does not write its inputs."""
    bench = subject.bench()
    for _ in subject.feed(bench, TICKS):
        before = {port: [v.tobytes() for _, v in bench.get(port)] for port in bench.block.inputs}
        bench.step()
        for port, values in before.items():
            after = [view.tobytes() for _, view in bench.get(port)]
            subject.expect(after == values, f"input {port!r} was written")


def _machine(subject: Subject) -> None:
    """Check that the outputs of a Moore block follow from its state alone, and ``update`` writes
    none."""
    if not subject.block_type.is_moore():
        return
    one, other = subject.bench(), subject.bench()
    feeds = zip(subject.feed(one, TICKS), subject.feed(other, TICKS, seed=1), strict=True)
    for _, _ in feeds:
        one_block: Any = one.block
        other_block: Any = other.block
        one_block.emit()
        other_block.emit()
        for port in subject.block_type.outputs:
            for name, view in one.get(port):
                subject.expect(
                    other.get(port).views()[name].tobytes() == view.tobytes(),
                    f"emit() makes {port}.{name} depend on an input, which is of the tick before",
                )
        for port in subject.block_type.inputs:  # from here on both have the same inputs
            other.set(port, **one.get(port).views())
        written = one.memory.bus.buffer.tobytes()
        one_block.update()
        other_block.update()
        subject.expect(one.memory.bus.buffer.tobytes() == written, "update() writes an output")
        one.clock.tick += 1
        other.clock.tick += 1


def _deterministic(subject: Subject) -> None:
    """Two instances with the same inputs give the same outputs and states, to the last bit."""
    second = subject.trace(subject.bench())
    for tick, (one, other) in enumerate(zip(subject.traced, second, strict=True)):
        subject.expect(one == other, f"two instances with equal inputs differ in tick {tick}")


def _kernels(subject: Subject) -> None:
    """Check that machine code gives the bytes of plain Python, and that both are what NumPy makes of the kernels as
    they are written."""
    calls = _calls_of(subject.bench().block)
    if not calls:
        return
    pairs = zip(subject.traced, subject.traced_in_python, strict=True)
    for tick, (one, other) in enumerate(pairs):
        subject.expect(one == other, f"machine code and plain Python differ in tick {tick}")
    bench = subject.bench(plain=True)
    for call in _calls_of(bench.block):
        call.run = partial(_judged, subject, call, call.run)
    subject.trace(bench)


def _calls_of(block: Block) -> list[KernelCall]:
    calls = (*getattr(block, "kernel_calls", ()), *getattr(block, "update_calls", ()))
    return [each for each in calls if isinstance(each, KernelCall)]


def _judged(subject: Subject, call: KernelCall, run: Callable[[], Any]) -> None:
    before = numpy_oracle.copied(call.arguments)
    run()
    try:
        wrong = numpy_oracle.difference(call.kernel, before, call.arguments)
    except numpy_oracle.NotJudged:
        return
    subject.expect(not wrong, f"{call.name} makes {wrong}")


def _restored(subject: Subject) -> None:
    """Check that a block restored from a snapshot goes on as it did then, and so does a new
    instance."""
    bench = subject.bench()
    subject.trace(bench)
    snapshot = bench.snapshot()
    expected = subject.trace(bench, seed=1)
    for what, target in (("itself", bench), ("a new instance", subject.bench())):
        target.restore(snapshot)
        found = subject.trace(target, seed=1)
        for tick, (one, other) in enumerate(zip(expected, found, strict=True)):
            subject.expect(
                one == other,
                f"{what}, restored from a snapshot, goes on differently {tick + 1} ticks later; "
                "something is remembered outside the declared State",
            )


def _live_parameters(subject: Subject) -> None:
    """After a live change a block goes on as one that had the parameter from the start."""
    for name, params in live_changes(subject.bench().block.params):
        given = params.model_dump(round_trip=True)
        if unmet_messages(subject.block_type, given, robot=subject.robot, rate=subject.rate):
            continue  # the block cannot work with this robot after the change
        changed = subject.bench()
        subject.trace(changed, WARM_UP)
        before = changed.snapshot()
        path = changed.block.context.path
        parameters = LiveParameters({path: changed.block})
        parameters.compile = compile_calls
        parameters.apply(Adjustment({path: params}, ()), WARM_UP)
        after = changed.snapshot()
        subject.expect(before == after, f"prepare() writes state or outputs, for {name!r}")
        fresh = replace(subject, params=given).bench()
        fresh.restore(after)
        pairs = zip(subject.trace(changed, seed=1), subject.trace(fresh, seed=1), strict=True)
        for tick, (one, other) in enumerate(pairs):
            subject.expect(
                one == other,
                f"{name!r} is live, but {tick + 1} ticks after a change the block differs from "
                "one that had the new value from the start; derive anew in prepare()",
            )


def _array_allocations(subject: Subject) -> None:
    """No tick allocates more arrays than the block declares, and it gives a reason for any."""
    kind = subject.block_type
    subject.expect(
        kind.array_allocations == 0 or bool(kind.allocation_reason),
        "array_allocations without an allocation_reason",
    )
    bench = subject.bench(plain=True)  # what a kernel allocates as plain Python counts too
    for tick in subject.feed(bench, TICKS):
        with count_array_allocations() as counted:
            bench.step()
        if tick >= WARM_UP:
            subject.expect(
                counted.count <= kind.array_allocations,
                f"tick {tick} allocates {counted.count} arrays, declared are "
                f"{kind.array_allocations}; the first at {', '.join(counted.places)}",
            )


def _finite(subject: Subject) -> None:
    """Finite inputs give finite outputs."""
    bench = subject.bench()
    check = FiniteCheck(bench.memory.bus)
    for _ in subject.feed(bench, TICKS):
        bench.step()
        check.check()


def _life(subject: Subject) -> None:
    """Check that a block can be stopped before its first tick and after, and that metrics are
    plain."""
    for ticks in (0, TICKS):
        bench = subject.bench()
        subject.trace(bench, ticks)
        for _ in range(5):
            bench.block.stop_cycle()
        metrics = bench.block.metrics() if ticks else {}
        subject.benches.close()
        for name, value in metrics.items():
            subject.expect(
                isinstance(value, (bool, int, float, str)),
                f"metric {name!r} is of type {type(value).__name__}, not a plain value",
            )


CASES: Mapping[str, Callable[[Subject], None]] = {
    "documented": _documented,
    "ports used": _ports_used,
    "outputs written": _outputs_written,
    "bounds": _bounds,
    "inputs kept": _inputs_kept,
    "machine": _machine,
    "deterministic": _deterministic,
    "kernels": _kernels,
    "restored": _restored,
    "live parameters": _live_parameters,
    "array allocations": _array_allocations,
    "finite": _finite,
    "life": _life,
}
"""The checks by name."""


def conformance_cases() -> tuple[str, ...]:
    """Return the names of all checks, to parametrise a test with."""
    return tuple(CASES)


def unmet_messages(
    block_type: type[Block],
    params: Mapping[str, Any] | None = None,
    *,
    robot: str | RobotDescription | None = None,
    rate: float = 500.0,
) -> tuple[str, ...]:
    """Return the reasons why the block cannot work with the robot, as in a graph's load report.

    The result is empty if it can. The arguments are those of ``check_block``.
    """
    given = block_type.example_parameters() if params is None else params
    ready = block_type.Params.model_validate(dict(given))
    description = find_robot(robot) if isinstance(robot, str) else robot
    sizes = {
        **(description.dimensions if description else {}),
        **block_type.dimensions(ready, description),
    }
    context = Context(
        "block", Clock(1.0 / rate), 1, 0, sizes, description, tuple(block_type.inputs)
    )
    return tuple(
        requirement.message for requirement in unmet_requirements(block_type, ready, context)
    )


def missing_examples(block_type: type[Block]) -> str:
    """Return what to say where no instance can be made for want of parameters; empty if one can."""
    given = block_type.example_parameters()
    fields = block_type.Params.model_fields
    missing = [name for name, info in fields.items() if info.is_required() and name not in given]
    if not missing:
        return ""
    return (
        f"{', '.join(missing)} {'has' if len(missing) == 1 else 'have'} no default: return values to test with "
        "from the class method example_parameters"
    )


def check_block(
    block_type: type[Block],
    params: Mapping[str, Any] | None = None,
    *,
    robot: str | RobotDescription | None = None,
    rate: float = 500.0,
    dimensions: Mapping[str, int] | None = None,
    seed: int = 0,
    cases: Iterable[str] | None = None,
) -> None:
    """Check a block for all cases, or for those in ``cases``.

    Args:
        block_type: the block's class.
        params: its parameters; by default its ``example_parameters``.
        robot: a robot's name or description, for blocks that need one.
        rate: how often it runs [Hz].
        dimensions: named sizes.
        seed: the seed of the random inputs.
        cases: names from ``conformance_cases``; by default all of them.

    Raises:
        ConformanceError: the block breaks a promise, or has no examples of required parameters.
    """
    if params is None and (lacks := missing_examples(block_type)):
        raise ConformanceError(lacks)
    given = block_type.example_parameters() if params is None else params
    description = find_robot(robot) if isinstance(robot, str) else robot
    subject = Subject(
        block_type.specialize(block_type.Params.model_validate(dict(given)), Path(), description),
        given,
        robot,
        rate,
        dimensions or {},
        seed,
    )
    for name in CASES if cases is None else cases:
        with subject.benches:
            CASES[name](subject)


def random_value(
    name: str, field: Field, shape: tuple[int, ...], rng: np.random.Generator
) -> NDArray[Any]:
    """Draw a random legal value of a field, whose elements are finite and of order one."""
    if field.dtype_name == "bool":
        return rng.random(shape) < 0.5
    if field.dtype_name == "int64":
        choices = [int(v) for v in field.values] if field.values is not None else [0, 1, 2]
        return np.asarray(rng.choice(choices, shape), np.int64)
    if "orientation" in name and shape[-1:] == (4,):
        return random_quaternion(shape[:-1], rng)
    if "rotation" in name and shape[-2:] == (3, 3):
        return random_rotation(shape[:-2], rng)
    return np.asarray(rng.uniform(-1.0, 1.0, shape))


def random_quaternion(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw unit quaternions x, y, z, w of moderate angles, (*shape, 4)."""
    value = np.asarray(rng.uniform(-0.3, 0.3, (*shape, 4)))
    value[..., 3] = 1.0
    return np.asarray(value / np.linalg.norm(value, axis=-1, keepdims=True))


def random_rotation(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float64]:
    """Rotation matrices of moderate angles, (*shape, 3, 3)."""
    return matrices_of_quaternions(random_quaternion(shape, rng))


def random_inputs(
    block_type: type[Block], dimensions: Mapping[str, int], rng: np.random.Generator
) -> dict[str, dict[str, Any]]:
    """Values for all inputs of a block, by input and field; the block's own examples win."""
    values: dict[str, dict[str, Any]] = {}
    for port, declared in block_type.inputs.items():
        values[port] = {
            name: random_value(name, field, field.resolve(dimensions), rng)
            for name, field in declared.signal.fields.items()
        }
    for port, fields in block_type.example_inputs(rng, dimensions).items():
        values[port].update(fields)
    return values


@lru_cache(maxsize=4)
def _inputs_of(
    block_type: type[Block], sizes: tuple[tuple[str, int], ...], *seeds: int
) -> tuple[dict[str, dict[str, Any]], ...]:
    """Return the inputs of ``TICKS`` ticks; kept, because many instances of a block get equal
    ones."""
    rng, dimensions = np.random.default_rng(seeds), dict(sizes)
    return tuple(random_inputs(block_type, dimensions, rng) for _ in range(TICKS))


def live_changes(params: Parameters) -> Iterator[tuple[str, Parameters]]:
    """Yield, for every live parameter, and every value inside one, its path and a set of parameters
    in which it alone is changed to another legal value."""
    for name, info in type(params).model_fields.items():
        if is_live(info):
            for path, value in _others(getattr(params, name), info.annotation):
                changed = _with(params, name, value)
                if changed is not None:
                    yield f"{name}{path}", changed


def _with(params: Any, name: str, value: Any) -> Any:
    """Return the model with one value replaced, or ``None`` if that is not legal or changes
    nothing."""
    data = {**params.model_dump(round_trip=True), name: value}
    try:
        changed = type(params).model_validate(data)
    except ValidationError:
        return None
    return changed if changed != params else None


def _others(value: Any, annotation: Any) -> Iterator[tuple[str, Any]]:
    """Values that differ from ``value``, usually legal ones first, each with the path inside it."""
    if isinstance(value, RootModel):
        yield from _others(value.root, None)
    elif isinstance(value, dict):
        yield "", {name: 0.75 * item + 0.01 for name, item in value.items()}
    elif isinstance(value, BaseModel):
        for name, info in type(value).model_fields.items():
            for path, other in _others(getattr(value, name), info.annotation):
                changed = _with(value, name, other)
                if changed is not None:
                    yield f".{name}{path}", changed
    elif isinstance(value, bool):
        yield "", not value
    elif isinstance(value, int):
        yield "", value + 1
    elif isinstance(value, float):
        yield "", 0.75 * value if value else 0.02
    elif isinstance(value, (tuple, list)):
        yield "", [0.75 * item + 0.01 for item in value]
    elif get_origin(annotation) is Literal:
        yield from (("", other) for other in get_args(annotation) if other != value)
