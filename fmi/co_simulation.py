"""A Functional Mock-up Unit as a block."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from ..robots.description import RobotDescription
from ..runtime.language.block import Block, Input, Output
from ..runtime.language.parameters import Parameters
from .description import Description, Variable, describe, signals
from .unit_block import FmuParameters, UnitBlock


class CoSimulation(UnitBlock):
    """Runs a Functional Mock-up Unit (FMI 2.0 or 3.0, co-simulation), by FMPy.

    The ports follow from the model description, with units where it defines them: a variable
    ``x`` is a port ``x`` with the field ``value``, ``a.b.c`` is the field ``c`` of the port
    ``a_b``, and ``u[1]``, ``u[2]``, ... are one vector. A scalar has shape (1,), as those of the
    library's blocks. An input that is not wired keeps its start value. Where inputs and outputs
    would share a port, that of the inputs ends in ``_in``. Texts, binaries and clocks are no ports.

    In each run of the block at the time t the FMU gets the inputs, its outputs of the time t are
    read, and it is stepped by the block's period. If no output depends on an input at once
    (the model structure says so, or ``feedthrough: false``), outputs are read before the inputs
    are there, and the block breaks a loop of wires, as an integrator does.

    It is as deterministic as the FMU. A snapshot has the FMU's state if the FMU can serialise it;
    else the run warns, and only its start can be restored. Input derivatives, events,
    early return and intermediate updates are not used. The file travels in the recording, with its
    SHA-256. An FMU is a program: run only those that you trust. The extra ``fmi`` is needed.

    Source: Functional Mock-up Interface 2.0.4, section 4, and 3.0.1, section 4.

    Raises:
        BlockError: the FMU cannot be read, refuses a step, or fails; with the lines of its log.
    """

    @classmethod
    def fitted(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """The class with the ports of the FMU."""
        assert isinstance(params, FmuParameters)
        found = describe(params.file, folder, params.outputs)
        direct = found.feedthrough if params.feedthrough is None else params.feedthrough
        return _class_for(found, direct)

    def step(self) -> None:
        """Set the inputs, read the outputs, and let the FMU go on."""
        self._write()
        self._read()
        self._go_on()


class _WithoutFeedthrough(UnitBlock):
    """An FMU whose outputs do not depend on its inputs at once."""

    def emit(self) -> None:
        """Read the outputs."""
        self._read()

    def update(self) -> None:
        """Set the inputs, and let the FMU go on."""
        self._write()
        self._go_on()


@lru_cache(maxsize=64)
def _ports(
    inputs: tuple[Variable, ...], outputs: tuple[Variable, ...]
) -> dict[str, Input[Any] | Output[Any]]:
    defaults: dict[str, dict[str, Any]] = {}
    texts: dict[str, list[str]] = {}
    for each in (*inputs, *outputs):
        texts.setdefault(each.port, []).append(each.text)
    for each in inputs:
        values = [int(v) if each.kind == "Boolean" else v for v in each.start]
        defaults.setdefault(each.port, {})[each.field] = _nested(values, each.shape)
    ports: dict[str, Input[Any] | Output[Any]] = {}
    for port, signal in signals(inputs).items():
        ports[port] = Input(signal, text="; ".join(texts[port][:3]), default=defaults[port])
    for port, signal in signals(outputs).items():
        ports[port] = Output(signal, text="; ".join(texts[port][:3]))
    return ports


def _nested(values: list[Any], shape: tuple[int, ...]) -> list[Any]:
    """Values in row-major order as nested lists of a shape."""
    for size in reversed(shape[1:]):
        values = [values[k : k + size] for k in range(0, len(values), size)]
    return values


_CLASSES: list[tuple[tuple[Description, bool], type[Block]]] = []


def _class_for(found: Description, direct: bool) -> type[Block]:
    """The class of an FMU; the same one for the same description, so that graphs compare equal."""
    for key, known in _CLASSES:
        if key == (found, direct):
            return known
    body: dict[str, Any] = {"__doc__": CoSimulation.__doc__, "__module__": CoSimulation.__module__}
    body |= _ports(found.inputs, found.outputs)
    body["described"] = found
    body["fitted"] = vars(CoSimulation)["fitted"]  # as for every block whose ports are found
    made = type("CoSimulation", (CoSimulation if direct else _WithoutFeedthrough,), body)
    _CLASSES.append(((found, direct), made))
    return made
