"""The header of a recording, made from the graph that is to run."""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Container, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ...robots.terrain import Terrain, WorldParameters
from ...runtime.language.block import Block, Port
from ...runtime.language.layout import Layout
from ...runtime.language.quantities import Quantity
from ...runtime.language.signals import Field, Signal, Slot
from ...runtime.language.stages import BlockSpec, CheckedGraph
from ...runtime.running.memory import BoundGraph
from .code import needs_code
from .dependencies import contents, digests, files_read, parameter_files, project_state
from .format import Header, RecordedBlock, RecordedField, RecordedLayout

RECORDED_VERSIONS = (
    "numpy", "llvmlite", "mujoco-core", "pin", "qpsolvers", "daqp", "casadi", "rerun-sdk",
)  # fmt: skip
_KERNEL_NAMES = (
    "scipy_openblas_get_corename64_", "scipy_openblas_get_corename",
    "openblas_get_corename64_", "openblas_get_corename",
)  # fmt: skip
_NOTHING = RecordedLayout((), {}, {}, 0)


def header_of(bound: BoundGraph) -> Header:
    """Make the header of a run of ``bound``, as its memory is now."""
    memory, graph = bound.memory, bound.graph
    return make_header(
        graph,
        memory.bus.layout,
        memory.bus.buffer.tobytes(),
        state=memory.state.layout,
        first_tick=bound.clock.tick,
        clock=bound.clock.kind,
        files=files_read(bound),
    )


def make_header(
    graph: CheckedGraph,
    bus: Layout,
    bus_start: bytes,
    *,
    state: Layout | None = None,
    first_tick: int = 0,
    clock: str = "",
    files: Mapping[str, Path] | None = None,
) -> Header:
    """Make the header of a run of ``graph``; without ``state``, one that can hold no keyframes. By default only
    the ``files`` that parameters name are known."""
    files = parameter_files(graph) if files is None else files
    written = graph.resolved.blocks if graph.resolved is not None else ()
    foreign = {block.path for block in written if needs_code(block, graph.robot)}
    return Header(
        name=graph.name,
        graph=graph.text,
        base_rate=graph.base_rate,
        bus=_recorded(bus, {**dict(_outputs(graph)), **dict(_constants(graph))}, _carried(graph)),
        state=_recorded(state, dict(_states(graph))) if state is not None else _NOTHING,
        bus_start=bus_start,
        first_tick=first_tick,
        clock=clock or graph.clock.kind,
        ticks=graph.ticks,
        overrides=dict(graph.overrides),
        seeds={
            f"{spec.path}.seed": spec.params.seed
            for spec in graph.blocks
            if hasattr(spec.params, "seed")
        },
        parameters=dict(_parameters(graph)),
        versions=versions(),
        machine=machine(),
        blocks=tuple(_block(spec, foreign) for spec in graph.blocks),
        order=graph.order,
        robot=graph.robot,
        terrain=terrain_of(graph),
        files=digests(files),
        contents=contents(files),
        project=project_state(Path(graph.file).parent) if graph.file else "",
        source=graph.file or next((spec.where.file for spec in graph.blocks if spec.where), ""),
    )


def terrain_of(graph: CheckedGraph) -> Terrain | None:
    """Return the ground of the first block that has a world."""
    scenes = (spec.params for spec in graph.blocks if isinstance(spec.params, WorldParameters))
    return next((params.build_scene(graph.robot) for params in scenes), None)


def _block(spec: BlockSpec, foreign: Container[str]) -> RecordedBlock:
    """Return a block as it is recorded; ``foreign`` are the paths of those that need code of others."""
    kind = f"{spec.block_type.__module__}:{spec.block_type.__qualname__}"
    ports = _ports(spec) if spec.path in foreign else None
    times = spec.period_ticks, spec.offset_ticks
    return RecordedBlock(spec.path, kind, *times, str(spec.folder), ports)


def _ports(spec: BlockSpec) -> dict[str, Any]:
    """Return all that is drawn of a block, as plain data: its ports with their fields."""
    # a block that works in the background is recorded as what it is there
    kind: type[Block] = getattr(spec.block_type, "_block_type", spec.block_type)
    return {
        "text": kind.__doc__ or "",
        "moore": kind.is_moore(),
        "outside": kind.outside,
        "inputs": {
            name: _port(spec, name, port) | {"optional": port.optional, "truth": port.reads_truth}
            for name, port in kind.inputs.items()
        },
        "outputs": {
            name: _port(spec, name, port) | {"truth": port.truth, "absent": port.absent}
            for name, port in kind.outputs.items()
        },
        "states": {name: _port(spec, name, port) for name, port in kind.states.items()},
    }


def _port(spec: BlockSpec, name: str, port: Port[Any]) -> dict[str, Any]:
    signal, fields = port.signal, {}
    for key, field in signal.fields.items():
        quantity = spec.quantities.get(f"{name}.{key}") or Quantity(field.unit, field.frame)
        sizes = [spec.dimensions.get(str(s), s) for s in field.shape]
        fields[key] = {
            "shape": sizes,
            "dtype": field.dtype_name,
            "unit": None if quantity.unit is None else str(quantity.unit),
            "frame": quantity.frame,
            "text": field.text,
            "values": {int(v): v.name.lower() for v in field.values or ()},
        }
    return {"signals": _names(signal), "text": port.text, "fields": fields}


def _parameters(graph: CheckedGraph) -> Iterator[tuple[str, float | str]]:
    for spec in graph.blocks:
        for name, value in spec.params:
            if name != "seed" and isinstance(value, bool | int | float | str):
                yield f"{spec.path}.{name}", value


def recorded_signals(bound: BoundGraph) -> tuple[RecordedField, ...]:
    """Return all fields of the bus."""
    graph = bound.graph
    declared = {**dict(_outputs(graph)), **dict(_constants(graph))}
    return _recorded(bound.memory.bus.layout, declared, _carried(graph)).fields


def recorded_states(bound: BoundGraph) -> tuple[RecordedField, ...]:
    """Return all fields of the declared state."""
    return _recorded(bound.memory.state.layout, dict(_states(bound.graph))).fields


Declared = tuple[type[Signal], Field, bool]
"""The signal that a field belongs to, the field, and whether it is constant."""


def _outputs(graph: CheckedGraph) -> Iterator[tuple[str, Declared]]:
    for spec in graph.blocks:
        for port, output in spec.block_type.outputs.items():
            for name, field in output.signal.fields.items():
                yield f"{spec.path}.{port}.{name}", (output.signal, field, False)


def _constants(graph: CheckedGraph) -> Iterator[tuple[str, Declared]]:
    for spec in graph.blocks:
        for port, source in spec.block_type.inputs.items():
            if port not in spec.wires:
                for name, field in source.signal.fields.items():
                    yield f"{spec.path}.{port}.{name}", (source.signal, field, True)


def _states(graph: CheckedGraph) -> Iterator[tuple[str, Declared]]:
    for spec in graph.blocks:
        for port, state in spec.block_type.states.items():
            for name, field in state.signal.fields.items():
                yield f"{spec.path}.{port}.{name}", (state.signal, field, False)


def _carried(graph: CheckedGraph) -> dict[str, Quantity]:
    """Return unit and frame of the outputs that carry what is wired, by ``block.port.field``."""
    return {
        f"{spec.path}.{name}": quantity
        for spec in graph.blocks
        for name, quantity in spec.quantities.items()
        if name.partition(".")[0] in spec.block_type.outputs
    }


def _recorded(
    layout: Layout,
    declared: Mapping[str, Declared],
    quantities: Mapping[str, Quantity] | None = None,
) -> RecordedLayout:
    fields = []
    for name, slot in layout.slots.items():
        signal, field, constant = declared[name]
        quantity = (quantities or {}).get(name) or Quantity(field.unit, field.frame)
        made = recorded_field(name, slot, field, quantity)
        fields.append(replace(made, constant=constant, signals=_names(signal)))
    return RecordedLayout(tuple(fields), dict(layout.lengths), dict(layout.offsets), layout.size)


def recorded_field(name: str, slot: Slot, field: Field, quantity: Quantity) -> RecordedField:
    """Describe a field of the bus without the code that declared it.

    Args:
        name: ``block.port.field``.
        slot: where it lies.
        field: its declaration.
        quantity: the unit and frame of what it carries.
    """
    return RecordedField(
        name=name,
        dtype=slot.section,
        start=slot.start,
        shape=slot.shape,
        dimensions=field.shape,
        unit=None if quantity.unit is None else str(quantity.unit),
        frame=quantity.frame,
        text=field.text,
        values={int(v): v.name.lower() for v in field.values or ()},
    )


def _names(signal: type[Signal]) -> tuple[str, ...]:
    """Return the names of the signal's class and of the signals that it derives from, nearest
    first."""
    return tuple(
        kind.__name__ for kind in signal.__mro__ if issubclass(kind, Signal) and kind is not Signal
    )


def versions() -> dict[str, str]:
    """Return the versions of Python and of every package that computes something in a run."""
    from ... import __version__

    found = {"python": platform.python_version(), "aloft": __version__}
    for name in RECORDED_VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def machine() -> dict[str, str]:
    """Describe the machine, on which a run's bytes may depend beside versions: processor, system, C
    library, BLAS."""
    import numpy as np

    try:
        blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
        library = f"{blas.get('name', '')} {blas.get('version', '')}".strip()
    except (KeyError, TypeError):
        library = ""
    return {
        "architecture": platform.machine(),
        "processor": _processor(),
        "system": platform.system(),
        "C library": _c_library(),
        "blas": library,
        "blas kernel": _blas_kernel(),
    }


def _c_library() -> str:
    """Return the name of the C library, whose functions round otherwise in other versions: ``glibc
    2.31``; empty where that cannot be found out."""
    found = " ".join(platform.libc_ver()).strip()
    if found:
        return found
    try:
        return "musl" if "musl" in Path("/proc/self/maps").read_text(encoding="utf-8") else ""
    except OSError:
        return ""


def _blas_kernel() -> str:
    """Return the routines that OpenBLAS has chosen for this processor, such as ``SkylakeX``; it
    rounds otherwise with others. Empty where that cannot be found out."""
    try:
        lines = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    paths = dict.fromkeys(line.split()[-1] for line in lines if "openblas" in line)
    found = []
    for path in paths:
        try:
            library = ctypes.CDLL(path)
        except OSError:
            continue
        for name in _KERNEL_NAMES:
            if hasattr(library, name):
                function = getattr(library, name)
                function.restype = ctypes.c_char_p
                found.append((function() or b"").decode(errors="replace"))
                break
    return ", ".join(dict.fromkeys(found))


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor()
    names = (line.partition(":")[2].strip() for line in text.splitlines() if "model name" in line)
    return next(names, platform.processor())
