"""The files of XML in an FMU without Python: what its variables are, and how its sources are compiled."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from .....runtime.language.errors import UnitError
from .....runtime.language.units import BASE_UNITS, Unit, parse_unit
from ...clib.write import Prepared

_TYPES = {
    "3.0": {"f": "Float64", "i": "Int64", "b": "Boolean"},
    "2.0": {"f": "Real", "i": "Integer", "b": "Boolean"},
}
_CAUSALITIES = {"t": "independent", "i": "input", "o": "output", "p": "parameter"}


@dataclass(frozen=True)
class Scalar:
    """A variable of an FMU: a number or, in FMI 3.0, an array.

    Attributes:
        of: what it is of: ``t`` for the time, ``i`` input, ``o`` output, ``p`` parameter.
        kind: ``f`` float, ``i`` integer, ``b`` boolean.
        place: its first byte in the struct of C, or the number of the parameter.
        shape: empty for one number.
        start: the values at first, flat.
        terminal: the terminal it belongs to.
        depends: for an output the terminals on which it depends within a tick.
        least, most: bounds of a parameter.
    """

    name: str
    of: str
    kind: str
    place: int
    shape: tuple[int, ...]
    unit: str | None
    text: str
    start: tuple[float, ...] = ()
    terminal: str = ""
    depends: tuple[str, ...] = ()
    least: float | None = None
    most: float | None = None

    def elements(self, size: int) -> Iterator[Scalar]:
        """Yield each number as a variable, counted from 1, of ``size`` bytes."""
        for k, index in enumerate(product(*(range(1, n + 1) for n in self.shape))):
            yield replace(
                self, name=f"{self.name}[{','.join(map(str, index))}]", place=self.place + k * size,
                shape=(), start=self.start[k : k + 1],
            )  # fmt: skip

    def counted_from_one(self) -> Scalar:
        """Return the same with an index that begins with 1, as in FMI."""
        return replace(self, name=re.sub(r"\[(\d+)\]$", lambda m: f"[{int(m[1]) + 1}]", self.name))


def model_description(
    made: Prepared,
    scalars: Sequence[Scalar],
    version: str,
    token: str,
    title: str,
    sources: Sequence[str],
) -> bytes:
    """Return the file ``modelDescription.xml``. A variable's value reference is its place in ``scalars``."""
    first = version == "3.0"
    period, about = made.part.graph.base_period, made.about
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": made.name,
            "instantiationToken" if first else "guid": token,
            "description": title,
            "generationTool": about["version"],
            "variableNamingConvention": "structured",
        },
    )
    state = "canGetAndSetFMUState" if first else "canGetAndSetFMUstate"
    kind = SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": made.name,
            "canHandleVariableCommunicationStepSize": "true",
            state: "true",
            "canSerializeFMUState" if first else "canSerializeFMUstate": "true",
        },
    )
    if first:
        kind.set("fixedInternalStepSize", repr(period))
    else:
        files = SubElement(kind, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)
    units = _units(scalars)
    if units:
        definitions = SubElement(root, "UnitDefinitions")
        for text, unit in units.items():
            powers = {s: str(e) for s, e in zip(BASE_UNITS, unit.exponents, strict=True) if e}
            if unit.scale != 1.0:
                powers["factor"] = repr(unit.scale)
            SubElement(SubElement(definitions, "Unit", name=text), "BaseUnit", powers)
    categories = SubElement(root, "LogCategories")
    for name in ("logEvents", "logStatusError"):
        SubElement(categories, "Category", name=name)
    experiment = SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(period))
    if made.part.cut.graph.ticks is not None:
        experiment.set("stopTime", repr(made.part.cut.graph.ticks * period))
    variables = SubElement(root, "ModelVariables")
    for reference, each in enumerate(scalars):
        (_variable_3 if first else _variable_2)(variables, each, reference, units)
    _structure(SubElement(root, "ModelStructure"), scalars, first)
    return _text(root)


def build_description(name: str, sources: Sequence[str]) -> bytes:
    """Return the file ``buildDescription.xml`` of FMI 3.0: which sources are compiled."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=name)
    configuration.set("description", "GNU C for x86-64 and aarch64")
    files = SubElement(configuration, "SourceFileSet", language="C11")
    for each in sources:
        SubElement(files, "SourceFile", name=each)
    SubElement(configuration, "Library", name="m")
    return _text(root)


def _units(scalars: Sequence[Scalar]) -> dict[str, Unit]:
    found: dict[str, Unit] = {}
    for text in sorted({each.unit for each in scalars if each.unit}):
        try:
            found[text] = parse_unit(text)
        except UnitError:  # a parameter whose unit follows from another
            continue
    return found


def _common(each: Scalar, reference: int) -> dict[str, str]:
    """Return the attributes of a variable, in both versions."""
    variability = {"t": "continuous", "p": "tunable"}.get(each.of, "discrete")
    return {
        "name": each.name,
        "valueReference": str(reference),
        "causality": _CAUSALITIES[each.of],
        "variability": variability,
        "description": each.text,
    }


def _typed(each: Scalar, units: dict[str, Unit]) -> dict[str, str]:
    """Return the attributes of a variable's type: unit, bounds and start."""
    found = {"unit": each.unit} if each.unit in units and each.kind == "f" and each.unit else {}
    found |= {key: repr(v) for key, v in (("min", each.least), ("max", each.most)) if v is not None}
    if each.start:
        found["start"] = " ".join(_number(v, each.kind) for v in each.start)
    return found


def _number(value: float, kind: str) -> str:
    """Return a start value as XML has it."""
    if kind == "f":
        return repr(value)
    return str(int(value)) if kind == "i" else str(bool(value)).lower()


def _variable_3(to: Element, each: Scalar, reference: int, units: dict[str, Unit]) -> None:
    made = SubElement(to, _TYPES["3.0"][each.kind], _common(each, reference))
    for key, value in _typed(each, units).items():
        made.set(key, value)
    for size in each.shape:
        SubElement(made, "Dimension", start=str(size))


def _variable_2(to: Element, each: Scalar, reference: int, units: dict[str, Unit]) -> None:
    made = SubElement(to, "ScalarVariable", _common(each, reference))
    if each.of == "o":
        made.set("initial", "calculated")
    SubElement(made, _TYPES["2.0"][each.kind], _typed(each, units))


def _structure(to: Element, scalars: Sequence[Scalar], first: bool) -> None:
    """Add the dependencies of outputs on inputs; FMI 2.0 counts variables from 1 instead of naming them."""
    shift = 0 if first else 1
    outputs = [(k, each) for k, each in enumerate(scalars) if each.of == "o"]

    def depends(each: Scalar) -> str:
        return " ".join(
            str(k + shift)
            for k, other in enumerate(scalars)
            if other.of == "i" and other.terminal in each.depends
        )

    key = "valueReference" if first else "index"
    if first:
        for element in ("Output", "InitialUnknown"):
            for k, each in outputs:
                SubElement(to, element, {key: str(k), "dependencies": depends(each)})
        return
    for element in ("Outputs", "InitialUnknowns"):
        if outputs:
            group = SubElement(to, element)
            for k, each in outputs:
                SubElement(group, "Unknown", {key: str(k + shift), "dependencies": depends(each)})


def _text(root: Element) -> bytes:
    indent(root)
    found: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return found
