"""A block's contract as data: its docstring, and its ports and parameters from their declarations.

Whatever documents blocks (``aloft blocks``, the reference in docs) is made from this, so it cannot
disagree with the code.
"""

from __future__ import annotations

import inspect
import re
import types
from dataclasses import asdict, dataclass
from pathlib import PurePath
from typing import Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from ...files.nodes import text_of
from ...files.validation import unit_of
from .block import Block, Input, Output, Port
from .parameters import declared_fields, is_live


@dataclass(frozen=True)
class FieldReference:
    """One field of a signal: its name, its type in one line, and its text."""

    name: str
    type: str
    text: str


@dataclass(frozen=True)
class PortReference:
    """One port; ``note`` marks optional inputs and simulation truth."""

    name: str
    signal: str
    text: str
    note: str
    fields: tuple[FieldReference, ...]


@dataclass(frozen=True)
class ParameterReference:
    """One parameter; ``default`` is empty where a graph must give a value."""

    name: str
    type: str
    default: str
    unit: str
    bounds: str
    text: str
    live: bool = False
    """True if it may be changed while a graph runs."""

    @property
    def full_text(self) -> str:
        """The text, with a note where it may be changed live."""
        return f"{self.text} (live)" if self.live else self.text


@dataclass(frozen=True)
class BlockReference:
    """Reference of a block for its users."""

    name: str
    summary: str
    """The docstring's first sentence or paragraph, on one line."""
    text: str
    """The whole docstring."""
    module: str
    """The module of its class, below the package."""
    example: str
    """Lines of a graph file that have it, with its required inputs and parameters."""
    machine: str
    """``Mealy`` (outputs follow inputs in the same tick) or ``Moore`` (they follow from state)."""
    inputs: tuple[PortReference, ...]
    outputs: tuple[PortReference, ...]
    states: tuple[PortReference, ...]
    parameters: tuple[ParameterReference, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the reference as plain data."""
        return asdict(self)


def block_reference(name: str, block_type: type[Block]) -> BlockReference:
    """Return the contract of the block class that graph files call ``name``."""
    text = inspect.getdoc(block_type) or ""
    return BlockReference(
        name=name,
        summary=" ".join(text.partition("\n\n")[0].split()).rstrip(":"),
        text=text,
        module=block_type.__module__.removeprefix("aloft."),
        example=example_lines(name, block_type),
        machine="Moore" if block_type.is_moore() else "Mealy",
        inputs=tuple(_port(port) for port in block_type.inputs.values()),
        outputs=tuple(_port(port) for port in block_type.outputs.values()),
        states=tuple(_port(port) for port in block_type.states.values()),
        parameters=tuple(
            _parameter(name, info) for name, info in declared_fields(block_type.Params)
        ),
    )


def example_lines(name: str, block_type: type[Block]) -> str:
    """Write the lines of a graph file that have a block.

    Args:
        name: of the block, as graph files have it.
        block_type: its class.

    Returns:
        YAML: the block with every input that it needs, which reads ``BLOCK.PORT``, and with the
        parameters that have no default, as in ``example_parameters``; files have their name only.
    """
    word = re.sub(
        r"(?<=[a-z0-9])(?=[A-Z])", "_", name.rpartition(".")[2].rpartition(":")[2]
    ).lower()
    examples = block_type.example_parameters()
    required = [n for n, info in block_type.Params.model_fields.items() if info.is_required()]
    given = {n: _short_name(examples[n]) for n in required if n in examples}
    wires = [n for n, port in block_type.inputs.items() if not port.optional]
    parts = [f"use: {name}"]
    if given:
        parts.append(f"with: {text_of(given)}")
    if wires:
        parts.append(f"in: {{{', '.join(f'{n}: BLOCK.PORT' for n in wires)}}}")
    line = f"{word}: {{{', '.join(parts)}}}"
    return line if len(line) <= 100 else "\n".join([f"{word}:", *(f"  {part}" for part in parts)])


def _short_name(value: Any) -> Any:
    """Return the name of a file in place of its path."""
    return PurePath(value).name if isinstance(value, str) and value.startswith("/") else value


def _port(port: Port[Any]) -> PortReference:
    notes = []
    if isinstance(port, Input):
        notes += ["optional"] * port.optional + ["reads simulation truth"] * port.reads_truth
    if isinstance(port, Output):
        notes += ["simulation truth"] * port.truth
    fields = tuple(
        FieldReference(name, field.describe(), field.text)
        for name, field in port.signal.fields.items()
    )
    return PortReference(port.name, port.signal.__name__, port.text, ", ".join(notes), fields)


def _parameter(name: str, info: FieldInfo) -> ParameterReference:
    default = info.get_default(call_default_factory=True)
    return ParameterReference(
        name=name,
        type=type_text(info.annotation),
        default="" if default is PydanticUndefined else _value_text(default),
        unit=unit_of(info),
        bounds=_bounds(info),
        text=info.description or "",
        live=is_live(info),
    )


def type_text(annotation: Any) -> str:
    """Format a type as it is written in code: ``float``, ``list[float]``, ``'daqp' |
    'quadprog'``."""
    origin = get_origin(annotation)
    arguments = get_args(annotation)
    if origin is Literal:
        return " | ".join(map(repr, arguments))
    if origin in (Union, types.UnionType):
        return " | ".join(type_text(argument) for argument in arguments)
    if origin is not None:
        inner = ", ".join("..." if a is Ellipsis else type_text(a) for a in arguments)
        return f"{origin.__name__}[{inner}]"
    if annotation is type(None):
        return "none"
    return getattr(annotation, "__name__", str(annotation))


def _value_text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if value is None:
        return "none"
    return str(value) if value != "" else "''"


def _bounds(info: FieldInfo) -> str:
    signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
    lengths = {"min_length": "at least", "max_length": "at most"}
    parts = []
    for constraint in info.metadata:
        for attribute, sign in signs.items():
            if getattr(constraint, attribute, None) is not None:
                parts.append(f"{sign} {getattr(constraint, attribute):g}")
        for attribute, words in lengths.items():
            if getattr(constraint, attribute, None) is not None:
                parts.append(f"{words} {getattr(constraint, attribute)} long")
    return ", ".join(parts)
