"""What is shown of a block when it is chosen: its contract, its parameters, its place in the file."""

from __future__ import annotations

from typing import Any

from ..language.reference import PortReference, block_reference
from ..language.stages import BlockSpec, CheckedGraph
from ..loading.picture import BlockRow, table
from ..loading.reading.nodes import text_of


def details(graph: CheckedGraph) -> dict[str, dict[str, Any]]:
    """The details of every block that a user wrote, by path, as plain data."""
    specs = {spec.path: spec for spec in graph.blocks}
    return {row.path: _of(row, specs[row.path]) for row in table(graph) if "~" not in row.path}


def _of(row: BlockRow, spec: BlockSpec) -> dict[str, Any]:
    reference = block_reference(row.use, spec.block_type)
    values = spec.params.model_dump(mode="json")
    offset = f", from tick {row.offset_ticks}" if row.offset_ticks else ""
    return {
        "use": row.use,
        "place": str(spec.where) if spec.where is not None else "",
        "rate": f"{row.rate_hz:g} Hz{offset}",
        "order": row.order,
        "machine": spec.machine,
        "summary": reference.summary,
        "text": reference.text,
        "inputs": [[item.name, item.text().partition(" <- ")[2]] for item in row.inputs],
        "sources": {name: wire.source for name, wire in spec.wires.items()},
        "outputs": [[port.name, _fields(port, spec)] for port in reference.outputs],
        "parameters": [
            [item.name, _short(values.get(item.name)), item.unit, item.text]
            for item in reference.parameters
        ],
    }


def _fields(port: PortReference, spec: BlockSpec) -> str:
    """The fields of an output with what they carry in this graph."""
    found = []
    for field in port.fields:
        carried = spec.quantities.get(f"{port.name}.{field.name}")
        found.append(f"{field.name}: {field.type}" + (f" {carried}" if carried else ""))
    return f"{port.signal}: {', '.join(found)}"


def _short(value: Any) -> str:
    text = "none" if value is None else text_of(value)
    return text if len(text) <= 120 else f"{text[:117]}..."
