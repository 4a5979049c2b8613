"""Makes the checked graph from the flat one, with all checks in one pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ....files.problems import Code, Position, Problems, nearest
from ....robots.description import find_robot, robot_names
from ...language.block import Block
from ...language.errors import BlockError, UnknownBlockError
from ...language.flat_graph import FlatBlock, FlatGraph
from ...language.importing import BlockImportError, UnknownModuleError
from ...language.registry import find_block, nearest_names
from ...language.requirements import fix_without_robot
from ...language.schedule import ScheduleBlock, find_loops, order_blocks
from ...language.signals import Signal
from ...language.stages import BlockSpec, CheckedGraph, Wire
from ..flattening.machines import on_machines, read_machines
from ..flattening.rates import check_hyperperiod, read_offset, read_period
from .background import move_to_background
from .block_check import BlockDraft, check_defaults, check_emit, check_fit, check_sizes, lacks_robot
from .composite_wires import resolve_composite_wires
from .infer_units import infer_quantities, inferred_quantities, questions, unchecked_wires
from .infer_widths import Widths
from .inserted import insert_constant, insert_delay, read_values
from .link_settings import check_paths, check_watchdog, read_link_settings
from .parameter_references import resolve_references
from .parameters import check_parameters
from .quaternions import mark_quaternions, start_of_delay, start_parameters
from .settings import Settings, read_settings
from .signal_errors import insert_signal_errors
from .wire_check import WireCheck

LONGEST_RING = 8
"""Names at each end of a ring that are printed; what is between is counted."""


def check_graph(graph: FlatGraph, problems: Problems) -> CheckedGraph | None:
    """Check the whole graph. Returns ``None`` if there is any problem, also one noted before."""
    settings, flat = read_settings(graph, problems), graph
    graph = resolve_references(graph, settings, problems)
    if graph.empty:
        where = Position(graph.file, 1, 1)
        problems.add(Code.MISSING_KEY, "the graph has no blocks", where, fix="blocks: ...")
    drafts = _Drafts(graph, settings, problems).all()
    graph = replace(graph, blocks=tuple(draft.flat for draft in drafts.values()))
    if settings.base_rate is not None and graph.rate is not None:
        periods = (draft.period_ticks for draft in drafts.values())
        check_hyperperiod(periods, graph.rate.key_where, problems)
    drafts = insert_signal_errors(graph, drafts, settings, problems)
    drafts = resolve_composite_wires(graph, drafts, settings.robot, problems)
    wires = WireCheck(graph, drafts, problems)
    values: dict[str, Any] = {}
    infer_quantities(drafts, problems)
    mark_quaternions(drafts)
    check_sizes(graph, drafts, problems)
    for draft in drafts.values():
        wires.check(draft)
        _read_values(draft, drafts, values, problems)
    for path, outputs in graph.subgraphs.items():
        for name, wire in outputs.items():
            wires.check_output(f"{path}.{name}", wire)
    _report_loops(drafts, problems)
    machines = read_machines(graph, problems)
    links = read_link_settings(graph, settings.clock.kind, problems)
    if len(problems) or settings.base_rate is None:
        return None
    checked = _assemble(graph, settings, settings.base_rate, drafts, values)
    checked = replace(on_machines(checked, graph, machines), links=links, flat=flat, resolved=graph)
    check_paths(checked, graph, problems)
    check_watchdog(checked, graph, problems)
    return None if len(problems) else checked


class _Drafts:
    """Makes the drafts of all blocks: one whose widths follow from its wires after those it reads."""

    def __init__(self, graph: FlatGraph, settings: Settings, problems: Problems) -> None:
        self._graph, self._settings, self._problems = graph, settings, problems
        self._blocks = {flat.path: flat for flat in graph.blocks}
        self._classes: dict[tuple[str, Path], type[Block] | None] = {}
        self._made: dict[str, BlockDraft] = {}
        self._widths = Widths(self._blocks, self._type_of, self._draft_of, settings.robot)

    def all(self) -> dict[str, BlockDraft]:
        """Return the drafts by path, in the order of the graph."""
        self._widths.find()
        made = {path: self._draft_of(flat) for path, flat in self._blocks.items()}
        del (
            self._widths
        )  # each holds the other, so that nothing of a load would be freed at its end
        return made

    def _type_of(self, flat: FlatBlock) -> type[Block] | None:
        """Return the class of a block; what is wrong with it is reported once."""
        key = flat.use, flat.folder
        known = self._classes.get(key)
        if known is not None:
            return known
        mine = (flat.path, flat.folder)  # a class that is not found is a problem of every block
        if mine not in self._classes:
            found = _find(flat, self._graph, self._problems) if flat.use else None
            self._classes[mine if found is None else key] = found
        return self._classes.get(key)

    def _draft_of(self, flat: FlatBlock) -> BlockDraft:
        if flat.path not in self._made:
            whole, block_type = self._widths.filled(flat), self._type_of(flat)
            draft = _draft(whole, block_type, self._graph, self._settings, self._problems)
            self._made[flat.path] = draft
        return self._made[flat.path]


def _draft(
    flat: FlatBlock,
    block_type: type[Block] | None,
    graph: FlatGraph,
    settings: Settings,
    problems: Problems,
) -> BlockDraft:
    """Make the draft of a block with its class and parameters."""
    draft = BlockDraft(flat, block_type)
    if settings.base_rate is not None:
        draft.period_ticks = read_period(flat, settings.base_rate, problems)
        draft.offset_ticks = read_offset(flat, draft.period_ticks, problems)
    if draft.block_type is None:
        return draft
    check_emit(draft, problems)
    draft.params = check_parameters(flat, draft.block_type, problems, settings.robot)
    draft.dimensions = settings.dimensions
    if draft.params is None:
        return draft
    try:
        draft.block_type = draft.block_type.specialize(
            draft.params, flat.folder, settings.robot, graph.folder
        )
    except BlockError as error:
        problems.add(Code.UNMET_REQUIREMENT, f"{flat.path}: {error}", flat.where, at=flat.path)
        draft.block_type = None
        return draft
    try:
        local = draft.block_type.dimensions(draft.params, settings.robot)
    except Exception as error:  # noqa: BLE001  the block's own code must not hide others
        if settings.robot_known:
            problems.add(
                Code.DIMENSION,
                f"the dimensions of {flat.path} cannot be told: {type(error).__name__}: {error}",
                flat.where,
                at=flat.path,
                fix=fix_without_robot() if settings.robot is None else "",
            )
        return draft
    draft.dimensions = {**settings.dimensions, **local}
    if settings.robot_known and lacks_robot(draft, settings):
        check_fit(draft, settings, problems)  # this also explains missing dimensions
        return draft
    draft.complete = _check_dimensions(draft, settings, problems)
    if draft.complete:
        check_defaults(draft, problems)
    if settings.robot_known:
        check_fit(draft, settings, problems)
    if draft.complete and settings.base_rate is not None:
        move_to_background(draft, settings.base_rate, problems)
    return draft


def _find(flat: FlatBlock, graph: FlatGraph, problems: Problems) -> type[Block] | None:
    """Find the block's class, as seen from its own file, then from the graph's."""
    folders = dict.fromkeys([flat.folder, graph.folder])
    unknown: UnknownBlockError | None = None
    for folder in folders:
        try:
            return find_block(flat.use, folder)
        except UnknownBlockError as error:
            unknown = unknown or error
        except BlockImportError as error:
            problems.add(
                Code.BLOCK_IMPORT,
                f"{flat.use} cannot be used: {error}",
                flat.use_where,
                at=flat.path,
                other=error.where,
            )
            return None
    near = nearest_names(flat.use, flat.folder)
    problems.add(
        Code.UNKNOWN_BLOCK,
        str(unknown),
        flat.use_where,
        at=flat.path,
        expected=_folders_of_modules(flat, graph)
        if isinstance(unknown, UnknownModuleError)
        else "a block of `aloft blocks`, module:Class, or a file.yaml",
        found=flat.use,
        nearest=near,
        fix=f"use: {near[0]}" if near else "",
    )
    return None


def _folders_of_modules(flat: FlatBlock, graph: FlatGraph) -> str:
    """Return the places where the module of a ``module:Class`` may lie."""
    file = f"{flat.use.partition(':')[0].replace('.', '/')}.py"
    folders = dict.fromkeys(str(folder) for folder in (flat.folder, graph.folder, Path()))
    shown = " or ".join("the current folder" if f == "." else f for f in folders)
    return f"{file} in {shown}, or a module that Python finds"


def _check_dimensions(draft: BlockDraft, settings: Settings, problems: Problems) -> bool:
    """Return whether every named dimension of the block's ports is known and at least 1.

    A dimension of the robot may be zero: one without feet has empty arrays for its contacts.
    """
    assert draft.block_type is not None
    missing: dict[str, str] = {}
    of_robot = settings.robot.dimensions if settings.robot else {}

    def least(size: str) -> int:
        return 0 if size in of_robot and size in draft.dimensions else 1

    for ports in (draft.inputs, draft.outputs):
        for port_name, port in ports.items():
            for field_name, field in port.signal.fields.items():
                for size in field.shape:
                    if isinstance(size, str) and draft.dimensions.get(size, 0) < least(size):
                        missing.setdefault(size, f"{port_name}.{field_name}")
    flat = draft.flat
    for name, field_path in missing.items():
        if not settings.robot_known:
            continue  # it would come from the robot, whose problem is reported
        value = draft.dimensions.get(name)
        near = nearest(name, draft.dimensions)
        size = 3
        if near:
            size = draft.dimensions[near[0]]
        fix = f"for the whole graph, beside 'blocks': dimensions: {{{name}: {size}}}"
        if settings.robot is None and name in find_robot(robot_names()[0]).dimensions:
            fix = fix_without_robot()
        problems.add(
            Code.DIMENSION,
            f"{flat.path} ({flat.use}) needs the dimension {name!r}, which nothing gives"
            if value is None
            else f"{flat.path} ({flat.use}): dimension {name!r} is {value}",
            flat.where,
            at=f"{flat.path}.{field_path}",
            expected="a whole number from 1, from the robot, 'dimensions' or a parameter",
            found="nothing" if value is None else str(value),
            nearest=near if value is None else (),
            fix=fix if value is None else "",
        )
    return not missing


def _read_values(
    draft: BlockDraft, drafts: Mapping[str, BlockDraft], values: dict[str, Any], problems: Problems
) -> None:
    """Check and keep the initial values of delays, and constants, by ``block.input``."""
    for name, wire in draft.flat.wires.items():
        at = f"{draft.flat.path}.{name}"
        port = draft.inputs.get(name)
        signal: type[Signal] | None = None
        owner: BlockDraft | None = draft
        node = wire.constant
        if wire.constant is not None and port is not None:
            signal = port.signal
        elif wire.initial is not None and wire.delay:
            owner, node = drafts.get(wire.source_block), wire.initial
            output = owner.outputs.get(wire.source_port) if owner else None
            signal = output.signal if output else None
            if owner is not None and owner.stands_for and port is not None:
                owner, signal = draft, port.signal  # its fields have the reader's names and units
        if signal is not None and owner is not None and node is not None:
            values[at] = read_values(node, signal, owner, at, problems)


def _machines(drafts: Mapping[str, BlockDraft]) -> list[ScheduleBlock]:
    """Return the blocks as the schedule needs them; wires whose ends do not exist are left out."""
    outputs = {f"{path}.{name}" for path, draft in drafts.items() for name in draft.outputs}
    return [
        ScheduleBlock(
            path,
            draft.block_type.is_moore(),
            {
                name: wire.source
                for name, wire in draft.flat.wires.items()
                if not wire.delay and wire.source in outputs and name in draft.inputs
            },
        )
        for path, draft in drafts.items()
        if draft.block_type is not None
    ]


def _report_loops(drafts: Mapping[str, BlockDraft], problems: Problems) -> None:
    for loop in find_loops(_machines(drafts)):
        # The last wire leads back to the first block of the ring: usually that is the feedback.
        ports = [port for port in loop.ports if not drafts[port.rpartition(".")[0]].stands_for]
        blocks = [path for path in loop.blocks if not drafts[path].stands_for]
        if drafts[loop.ports[-1].rpartition(".")[0]].stands_for:
            ports = [*ports[1:], ports[0]]  # so that the last one is an input
        source, target = ports[-2:]
        block, _, name = target.rpartition(".")
        wire = drafts[block].flat.wires[name]
        start = blocks.index(block)
        in_order = [*blocks[start:], *blocks[:start], block]
        problems.add(
            Code.LOOP,
            f"{_ring(in_order)} is a loop without a delay: "
            "each needs the next one's answer of the same tick",
            wire.where,
            at=target,
            other=source,
            other_where=drafts[source.rpartition(".")[0]].flat.where,
            expected="a delay, or a block that emits from its state, somewhere in the ring",
            found=_ring([*ports, ports[0]]),
            fix=f"{name}: {{from: {wire.shown or source}, delay: 1}}",
        )


def _ring(names: Sequence[str]) -> str:
    """Return the names in order; of a long ring the first and the last, and the number between."""
    most = LONGEST_RING
    if len(names) > 2 * most:
        names = [*names[:most], f"({len(names) - 2 * most} more)", *names[-most:]]
    return " -> ".join(names)


def _assemble(
    graph: FlatGraph,
    settings: Settings,
    base_rate: float,
    drafts: Mapping[str, BlockDraft],
    values: Mapping[str, Any],
) -> CheckedGraph:
    specs: list[BlockSpec] = []
    for draft in drafts.values():
        flat = draft.flat
        assert draft.block_type is not None and draft.params is not None
        wires: dict[str, Wire] = {}
        for name in draft.block_type.inputs:
            flat_wire = flat.wires.get(name)
            if flat_wire is None:
                continue
            at = f"{flat.path}.{name}"
            wire = Wire(flat_wire.source, at, where=flat_wire.where)
            given = values.get(at, {})
            if flat_wire.constant is not None:
                specs.append(insert_constant(draft, name, flat_wire, given))
                wire = replace(wire, source=f"{specs[-1].path}.y")
            elif flat_wire.delay:
                source = drafts[flat_wire.source_block]
                given = start_of_delay(source, flat_wire.source_port, given)
                specs.append(insert_delay(draft, name, flat_wire, source, given))
                wire = replace(
                    wire, source=f"{specs[-1].path}.y", delay=flat_wire.delay, initial=given
                )
            wires[name] = wire
        specs.append(
            BlockSpec(
                flat.path,
                draft.block_type,
                start_parameters(draft),
                wires,
                draft.dimensions,
                draft.period_ticks,
                draft.offset_ticks,
                flat.where,
                flat.folder,
                quantities=inferred_quantities(draft, drafts),
            )
        )
    order = order_blocks(
        ScheduleBlock(
            spec.path,
            spec.block_type.is_moore(),
            {name: wire.source for name, wire in spec.wires.items()},
        )
        for spec in specs
    )
    return CheckedGraph(
        name=graph.name,
        base_rate=base_rate,
        blocks=tuple(specs),
        order=order,
        ticks=settings.ticks,
        robot=settings.robot,
        clock=settings.clock,
        recording=settings.recording,
        file=graph.file,
        overrides=graph.overrides,
        unchecked=(*unchecked_wires(drafts), *questions(drafts)),
    )
