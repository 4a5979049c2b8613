"""Turns a stretch of a recorded run into a regression test of one of its blocks."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from os.path import relpath
from pathlib import Path
from typing import Any

import numpy as np

from ...robots.description import RobotDescription, find_robot
from ...runtime.background.background_block import BackgroundBlock
from ...runtime.language.layout import Layout
from ...runtime.language.registry import block_name
from ...runtime.language.schedule import runs_at
from ...runtime.language.stages import BlockSpec, CheckedGraph
from ...runtime.loading.checking.parameters import plain_parameters
from ...runtime.running.differences import Difference
from ...runtime.running.memory import BoundGraph
from ...runtime.testing.stretch import Setting, Stretch
from .replay import Replayable, ReplayError, replay

_OURS = __name__.rpartition(".logs.")[0]


@dataclass(frozen=True)
class RegressionTest:
    """The files that were written: the test and its data, and the number of the block's runs in it.

    ``difference`` says where the present block differs from the recording; it is empty if it does
    not.
    """

    test: Path
    data: Path
    runs: int
    difference: Difference | None = None


class _Watch:
    """Keeps the block's state before the first tick of the stretch."""

    def __init__(self, path: str, tick: int) -> None:
        self._path, self._tick = path, tick
        self.state: dict[str, Any] = {}
        self.before: dict[str, Any] = {}
        self.parameters: dict[str, Any] = {}

    def __call__(self, bound: BoundGraph, tick: int) -> None:
        if tick != self._tick:
            return
        block, spec = bound.blocks[self._path], bound.graph.block(self._path)
        block.save_state()
        memory = bound.memory
        for ports, region, kept in (
            (spec.block_type.states, memory.state, self.state),
            (spec.block_type.outputs, memory.bus, self.before),
        ):
            for port, declared in ports.items():
                for name in declared.signal.fields:
                    full = f"{self._path}.{port}.{name}"
                    kept[f"{port}.{name}"] = region.field(full).copy()
        self.parameters = plain_parameters(block.params)


def capture(
    recorded: Replayable, path: str, first: int, last: int
) -> tuple[Stretch, dict[str, Any], Difference | None]:
    """Capture the block at ``path`` in the ticks from ``first`` up to, without, ``last``.

    The block's state is found by running the block on recorded inputs from the keyframe before.

    Returns:
        The stretch, the parameters at its beginning, and where the present block differs from the
        recording in it.

    Raises:
        ReplayError: there is no such block or tick, the block never runs in the stretch, or it
            differs from the recording before the stretch begins.
    """
    graph = recorded.graph
    spec = _spec(graph, path)
    if not first < last:
        raise ReplayError(f"there is no tick from {first} up to {last}")
    ticks, rows = recorded.rows(first, last)
    if len(ticks) < last - first:
        raise ReplayError(
            f"only {len(ticks)} of the ticks {first} to {last - 1} are in the recording"
        )
    runs = np.array([runs_at(t, spec.period_ticks, spec.offset_ticks) for t in ticks.tolist()])
    if not runs.any():
        raise ReplayError(f"block '{path}' does not run in ticks {first} to {last - 1}")
    watch = _Watch(path, first)
    done = replay(recorded, run=[path], first_tick=first, last_tick=last, before_tick=watch)
    done.result.raise_if_failed()
    difference = done.first
    if difference is not None and difference.tick < first:
        raise ReplayError(
            f"the block is not the one that was recorded, so what it remembers at tick {first} is "
            f"not known: {difference}"
        )
    rows = rows[runs]
    stretch = Stretch(
        _setting(recorded, spec, first, last), ticks[runs], watch.state, watch.before,
        _columns(recorded.bus, rows, {
            port: wire.source for port, wire in spec.wires.items()
        }, {port: declared.signal.fields for port, declared in spec.block_type.inputs.items()}),
        _columns(recorded.bus, rows, {
            port: f"{path}.{port}" for port in spec.block_type.outputs
        }, {port: declared.signal.fields for port, declared in spec.block_type.outputs.items()}),
    )  # fmt: skip
    return stretch, watch.parameters, difference


def _spec(graph: CheckedGraph, path: str) -> BlockSpec:
    known = [spec.path for spec in graph.blocks if "~" not in spec.path]
    if path not in known:
        raise ReplayError(f"there is no block {path!r} to test; there is {', '.join(known)}")
    spec = graph.block(path)
    if issubclass(spec.block_type, BackgroundBlock):
        raise ReplayError(
            f"block {path!r} works in the background, so its outputs are not those of the inputs "
            "beside them; record a run without the key 'background' and test that"
        )
    return spec


def _setting(recorded: Replayable, spec: BlockSpec, first: int, last: int) -> Setting:
    graph = recorded.graph
    prefix = f"{spec.path}."
    return Setting(
        graph.base_rate, spec.period_ticks, dict(spec.dimensions), tuple(spec.wires),
        graph.robot.content() if graph.robot else None,
        tuple(
            (change.tick, change.path.removeprefix(prefix), change.new)
            for change in recorded.changes
            if change.path.startswith(prefix) and first < change.tick < last
        ),
    )  # fmt: skip


def _columns(
    layout: Layout, rows: Any, sources: Mapping[str, str], fields: Mapping[str, Any]
) -> dict[str, Any]:
    """Return every field of some ports over all rows, by ``port.field``."""
    return {
        f"{port}.{name}": np.ascontiguousarray(layout.view(rows, f"{source}.{name}"))
        for port, source in sources.items()
        for name in fields[port]
    }


def write_test(
    recorded: Replayable,
    path: str,
    first: int,
    last: int,
    output: Path,
    *,
    source: str,
    rtol: float = 0.0,
    atol: float = 0.0,
) -> RegressionTest:
    """Write a pytest file and the ``.npz`` file beside it.

    Args:
        recorded: the run.
        path: the block.
        first, last: the stretch, without tick ``last``.
        output: the test's file; its name should begin with ``test_``.
        source: what the recording is called, for the test's text.
        rtol, atol: the test's tolerances.

    Raises:
        ReplayError: as ``capture``.
        OSError: a file cannot be written.
    """
    stretch, parameters, difference = capture(recorded, path, first, last)
    spec = recorded.graph.block(path)
    output.parent.mkdir(parents=True, exist_ok=True)
    data = output.with_suffix(".npz")
    stretch.write(data)
    robot = recorded.graph.robot
    options = [f'robot="{robot.name}"'] if robot is not None and _is_ours(robot) else []
    imports, block = _import_of(spec, output.parent)
    if _names_files(parameters, spec.folder):
        options.append(f'folder=HERE / "{_relative(spec.folder, output.parent)}"')
    options += [f"rtol={rtol!r}", f"atol={atol!r}"]
    output.write_text(
        _TEMPLATE.format(
            path=path, kind=block_name(spec.block_type), first=first, last=last - 1, end=last,
            source=source, imports=imports, block=block, options="".join(f"        {option},\n" for option in options),
            name=re.sub(r"\W+", "_", path).strip("_"),
            here="HERE = Path(__file__).parent\n" if "HERE" in f"{block}{options}" else "",
            parameters=_as_code(parameters),
        ),
        encoding="utf-8",
    )  # fmt: skip
    return RegressionTest(output, data, len(stretch.ticks), difference)


def _is_ours(robot: RobotDescription) -> bool:
    """Tell whether the robot's name alone gives the same description."""
    try:
        return find_robot(robot.name) == robot
    except LookupError:
        return False


def _names_files(parameters: Mapping[str, Any], folder: Path) -> bool:
    """Tell whether any parameter is the name of a file relative to the graph's folder."""
    texts = [value for value in parameters.values() if isinstance(value, str) and value]
    return any((folder / text).exists() for text in texts)


def _as_code(value: Any, indent: str = "") -> str:
    """Write plain data as readable Python, with each entry of a mapping on its own line."""
    if not isinstance(value, dict) or not value:
        return json.dumps(value) if isinstance(value, str) else repr(value)
    inner = f"{indent}    "
    lines = [f'{inner}"{key}": {_as_code(item, inner)},' for key, item in value.items()]
    return "\n".join(["{", *lines, f"{indent}}}"])


def _relative(folder: Path, start: Path) -> str:
    return Path(relpath(folder.resolve(), start.resolve())).as_posix()


def _import_of(spec: BlockSpec, folder: Path) -> tuple[str, str]:
    """Return the import that the test needs, and its name for the class."""
    name = block_name(spec.block_type)
    if ":" not in name:
        module = f"aloft.{spec.block_type.__module__.removeprefix(f'{_OURS}.')}"
        return f"from {module} import {spec.block_type.__name__}\n", spec.block_type.__name__
    found = f'find_block("{name}", HERE / "{_relative(spec.folder, folder)}")'
    return "from aloft.runtime.language.registry import find_block\n", found


_TEMPLATE = '''"""Block '{path}' ({kind}) in ticks {first} to {last} of a recorded run.

Made by `aloft test --recording {source} --block {path} --ticks {first}:{end}`. The file beside this
one, of the same name, holds what the block remembered before, its inputs and its outputs.
"""

from pathlib import Path

{imports}from aloft.runtime.testing import Stretch

{here}PARAMETERS = {parameters}


def test_{name}_in_ticks_{first}_to_{last}() -> None:
    stretch = Stretch.read(Path(__file__).with_suffix(".npz"))
    stretch.check(
        {block},
        PARAMETERS,
{options}    )
'''
