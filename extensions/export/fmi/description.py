"""Model description of an FMU, as the ports of a block."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import prod
from pathlib import Path
from typing import Any

from ....files.names import is_file_name
from ....files.pip_line import pip_line
from ....runtime.language.block import Block
from ....runtime.language.errors import BlockError, UnitError
from ....runtime.language.signals import Field, Signal
from ....runtime.language.units import BASE_UNITS, Unit, parse_unit

_DTYPES = {
    "Real": "float64", "Float64": "float64", "Float32": "float64",
    "Integer": "int64", "Enumeration": "int64",
    **{f"{sign}Int{bits}": "int64" for sign in ("", "U") for bits in (8, 16, 32, 64)},
    "Boolean": "bool",
}  # fmt: skip
"""The element type of a field, by the type of a variable; texts, binaries and clocks have none."""
_ELEMENT = re.compile(r"(?P<base>.+)\[(?P<index>\d+)\]$")


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU, or a row of them called ``u[1]``, ``u[2]``, ...; a field of a port."""

    name: str
    references: tuple[int, ...]
    kind: str
    """The FMI type, such as ``Float64``."""
    shape: tuple[int, ...]
    unit: Unit | None
    start: tuple[float, ...]
    text: str
    port: str = ""
    field: str = ""

    @property
    def size(self) -> int:
        """Number of elements."""
        return prod(self.shape)

    @property
    def key(self) -> str:
        """The place in a block, ``port.field``."""
        return f"{self.port}.{self.field}"


@dataclass(frozen=True)
class Description:
    """An FMU for co-simulation.

    ``feedthrough`` says whether an output may depend on an input at the same instant.
    ``kept`` says whether the FMU can give and take back its state as bytes. ``settable`` has the
    FMI type of every variable that can be given a start value, by its name.
    """

    file: str
    path: Path
    version: int
    identifier: str
    token: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    settable: Mapping[str, tuple[int, str, tuple[int, ...]]]
    feedthrough: bool
    kept: bool
    problems: tuple[str, ...] = ()
    """Violations of the standard, found by FMPy's validator; often harmless."""


def describe(file: str, folder: Path, outputs: Iterable[str] = ()) -> Description:
    """Return the description of an FMU.

    Args:
        file: the FMU, as the graph names it.
        folder: what the name is relative to.
        outputs: the variables that are read; none: all outputs.

    Raises:
        BlockError: FMPy is missing, there is no such file, it is no FMU for co-simulation, or it
            has no such variable.
    """
    path = folder / file
    try:
        status = path.stat()
    except OSError as error:
        raise BlockError(f"cannot read {file}: {error.strerror or error}") from None
    return _describe(path, file, tuple(outputs), status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=16)
def _describe(path: Path, file: str, outputs: tuple[str, ...], *_stamp: int) -> Description:
    read = _read(path, file)
    interface = read.coSimulation
    by_name = {variable.name: variable for variable in read.modelVariables}
    units = {unit.name: _unit(unit.name, unit.baseUnit) for unit in read.unitDefinitions}
    numbers = [each for each in read.modelVariables if each.type in _DTYPES]
    for name in outputs:
        if name not in by_name or by_name[name].type not in _DTYPES:
            raise BlockError(f"{file} has no number {name!r}{nearest(name, by_name)}")
    chosen = [each for each in numbers if each.name in outputs] if outputs else None
    read_from = _placed(chosen or [e for e in numbers if e.causality == "output"], units)
    taken = {each.port for each in read_from}
    written = tuple(
        replace(each, port=f"{each.port}_in") if each.port in taken else each
        for each in _placed([e for e in numbers if e.causality == "input"], units)
    )
    for kind, variables in (("inputs", written), ("outputs", read_from)):
        keys = [each.key for each in variables]
        doubled = [each for each in variables if keys.count(each.key) > 1]
        if doubled:
            names = " and ".join(repr(each.name) for each in doubled[:2])
            raise BlockError(f"the {kind} {names} of {file} would both be {doubled[0].key}")
    return Description(
        file,
        path,
        int(read.fmiVersion.partition(".")[0]),
        interface.modelIdentifier,
        read.instantiationToken or read.guid,
        written,
        read_from,
        {
            name: (each.valueReference, each.type, each.shape or ())
            for name, each in by_name.items()
            if each.causality in ("parameter", "structuralParameter", "input")
            or each.initial in ("exact", "approx")
        },
        _feedthrough(read),
        bool(interface.canGetAndSetFMUstate and interface.canSerializeFMUstate),
        _problems(read),
    )


def _read(path: Path, file: str) -> Any:
    """Read FMPy's model description of a file. Raises ``BlockError``."""
    try:
        from fmpy.model_description import read_model_description
    except ImportError:
        raise BlockError(f"export.CoSimulation needs FMPy: {pip_line('fmi')}") from None
    try:
        read = read_model_description(str(path), validate=False)
    except Exception as error:  # noqa: BLE001  its own errors have no common base
        reason = " ".join(str(error).split())
        raise BlockError(f"cannot read {file} as an FMU: {reason}") from None
    if not read.fmiVersion.startswith(("2.", "3.")):
        raise BlockError(f"{file} is of FMI {read.fmiVersion}; FMI 2.0 and 3.0 are understood")
    for interface in (read.coSimulation, read.modelExchange, read.scheduledExecution):
        if interface is not None and not is_file_name(interface.modelIdentifier or ""):
            raise BlockError(
                f"cannot read {file} as an FMU: its model identifier {interface.modelIdentifier!r} is "
                "no name of a file"
            )
    if read.coSimulation is None:
        kinds = {
            "model exchange": read.modelExchange,
            "scheduled execution": read.scheduledExecution,
        }
        found = " and ".join(kind for kind, interface in kinds.items() if interface is not None)
        raise BlockError(f"{file} is for {found} only; an FMU for co-simulation is needed")
    return read


def _problems(read: Any) -> tuple[str, ...]:
    from fmpy.validation import validate_model_description

    return tuple(" ".join(each.split()) for each in validate_model_description(read))


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the end of a sentence that proposes what resembles ``name``, or lists what there is."""
    from difflib import get_close_matches

    known = list(names)
    found = get_close_matches(name, known, 1, 0.5)
    if found:
        return f"; the nearest is {found[0]!r}"
    return f"; there is {', '.join(known[:12])}{', ...' if len(known) > 12 else ''}"


def _feedthrough(read: Any) -> bool:
    """Check whether the description allows an output to depend on an input at once."""
    for unknown in read.outputs:
        if unknown.dependencies is None:
            return True
        if any(each.causality == "input" for each in unknown.dependencies):
            return True
    return False


def _placed(found: list[Any], units: Mapping[str, Unit | None]) -> tuple[Variable, ...]:
    """Return the variables with their ports and fields: ``a.b.c`` is the field ``c`` of the port ``a_b``, and a name
    without a dot is the field ``value`` of a port.
    """
    placed = []
    for each in _in_rows([_variable(each, units) for each in found]):
        head, _, last = each.name.rpartition(".")
        port, field = (_name(head), _name(last)) if head else (_name(last), "value")
        port = f"{port}_" if hasattr(Block, port) or port in ("params", "context") else port
        field = f"{field}_" if hasattr(Signal, field) else field
        placed.append(
            Variable(
                each.name, each.references, each.kind, each.shape, each.unit, each.start, each.text,
                port, field,
            )
        )  # fmt: skip
    return tuple(placed)


def _variable(each: Any, units: Mapping[str, Unit | None]) -> Variable:
    unit = each.unit or (each.declaredType.unit if each.declaredType is not None else None)
    text = " ".join((each.description or each.name).split())
    shape = tuple(each.shape or ())
    known = units.get(unit) if unit else None
    return Variable(
        each.name,
        (each.valueReference,),
        each.type,
        shape or (1,),
        known,
        _start(each.start, each.type, prod(shape)),
        f"{text} [{unit}]" if unit and known is None else text,
    )


def _in_rows(variables: list[Variable]) -> list[Variable]:
    """Return ``u[1]``, ``u[2]``, ... of one type and unit as one variable ``u``; others as they are."""
    rows: dict[str, list[Variable]] = {}
    for each in variables:
        match = _ELEMENT.match(each.name)
        if match and each.shape == (1,):
            rows.setdefault(match["base"], []).append(each)
    joined: dict[str, Variable] = {}
    members: dict[str, str] = {}
    for base, row in rows.items():
        names = [f"{base}[{k}]" for k in range(1, len(row) + 1)]
        alike = {(each.kind, each.unit) for each in row}
        if [each.name for each in row] == names and len(alike) == 1:
            first = row[0]
            joined[base] = Variable(
                base,
                tuple(each.references[0] for each in row),
                first.kind,
                (len(row),),
                first.unit,
                tuple(value for each in row for value in each.start),
                first.text,
            )
            members.update(dict.fromkeys(names, base))
    result: dict[str, Variable] = {}
    for each in variables:
        base = members.get(each.name, "")
        result.setdefault(base or each.name, joined[base] if base else each)
    return list(result.values())


def _start(text: Any, kind: str, size: int) -> tuple[float, ...]:
    """Return the start values as numbers; zeros where there are none."""
    values = str(text).split() if text is not None else []
    if kind == "Boolean":
        numbers = [float(value in ("true", "True", "1")) for value in values]
    else:
        numbers = [float(value) for value in values]
    if len(numbers) == 1:
        numbers *= size
    return tuple(numbers) if len(numbers) == size else (0.0,) * size


def _unit(name: str, base: Any) -> Unit | None:
    """Return a unit of FMI; ``None`` where it cannot be read. Degrees Celsius have an offset."""
    if base is None:
        try:
            return parse_unit(name.replace(".", " "))
        except UnitError:
            return None
    offset = float(base.offset or 0.0)
    exponents = tuple(int(getattr(base, symbol) or 0) for symbol in BASE_UNITS)
    return Unit(exponents, float(base.factor or 1.0), name if any(exponents) else "", offset)


def _name(text: str) -> str:
    """Return the text as a name in Python."""
    name = re.sub(r"\W+", "_", text).strip("_") or "v"
    return name if name.isidentifier() else f"v{name}"


def signals(variables: Iterable[Variable]) -> dict[str, type[Signal]]:
    """Return the signals of the ports that these variables make, by port."""
    ports: dict[str, dict[str, Any]] = {}
    for each in variables:
        field = Field(each.shape, dtype=_DTYPES[each.kind], text=each.text)
        field.unit = each.unit
        ports.setdefault(each.port, {})[each.field] = field
    return {
        port: type(_title(port), (Signal,), {"__doc__": f"Variables {port} of an FMU.", **fields})
        for port, fields in ports.items()
    }


def _title(port: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in port.split("_")) or "Variables"
