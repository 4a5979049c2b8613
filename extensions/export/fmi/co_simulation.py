"""A Functional Mock-up Unit as a block."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ....robots.description import RobotDescription
from ....runtime.language.block import (
    Block,
    Context,
    Input,
    Output,
    State,
    UnmetRequirement,
)
from ....runtime.language.errors import BlockError
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal
from .description import Description, Variable, describe, nearest, signals
from .instance import FmuInstance

_ROOM = 4096
"""Bytes by which an FMU's state may grow, beside a half of what it is at first."""


class Remembered(Signal):
    """The state of an FMU."""

    length = Field(dtype="int64", text="bytes of the state; zero where the FMU cannot give it")
    steps = Field(dtype="int64", text="steps since the FMU was initialised")
    data = Field(
        "fmu_state", dtype="int64", text="the state as the FMU writes it, eight bytes each"
    )


class FmuParameters(Parameters):
    """FMU to run, and its settings."""

    file: str = parameter(text="the FMU, relative to the graph's folder")
    start: dict[str, float | int | bool | str | list[float]] = parameter(
        {}, text="values of parameters, and of inputs that are not wired, by the FMU's names"
    )
    outputs: list[str] = parameter(
        [], text="the variables to read, by the FMU's names; none: all of its outputs"
    )
    feedthrough: bool | None = parameter(
        None,
        text="whether outputs may depend on inputs at the same instant; by default as the FMU says",
    )


class UnitBlock(Block):
    """A block whose ports are those of an FMU."""

    Params = FmuParameters
    params: FmuParameters
    program_files = ("file",)
    memory = State(Remembered, text="what the FMU remembers")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report start values that the FMU does not have."""
        assert isinstance(params, FmuParameters)
        try:
            found = describe(params.file, context.folder, params.outputs)
        except BlockError as error:
            yield UnmetRequirement(str(error), "file")
            return
        for name in params.start:
            if name not in found.settable:
                yield UnmetRequirement(
                    f"{params.file} has no variable {name!r} that can be given a start value"
                    + nearest(name, found.settable),
                    f"start.{name}",
                )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return a mass on a spring, made for this process."""
        from .example import example_fmu

        return {"file": str(example_fmu())}

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Return the numbers that hold the FMU's state; an instance has to say how large that is."""
        assert isinstance(params, FmuParameters)
        if not cls.described.kept:
            return {"fmu_state": 1}
        instance = FmuInstance(cls.described, params.start, 0.0)
        try:
            size = len(instance.state())
        finally:
            instance.close()
        return {"fmu_state": (size + size // 2 + _ROOM) // 8}

    described: ClassVar[Description]

    def setup(self) -> None:
        """Load the FMU, and bind its variables to the ports."""
        self._instance: FmuInstance | None = None
        self._begin()

    def _begin(self) -> None:
        """Load the FMU anew, as it is before its first step."""
        if self._instance is not None:
            self._instance.close()
        made = FmuInstance(
            self.described,
            self.params.start,
            self.context.offset_ticks * self.context.clock.base_period,
        )
        self._instance = made
        ports = {name: getattr(self, name) for name in (*self.inputs, *self.outputs)}
        wired = [each for each in self.described.inputs if each.port in self.context.wired]
        self._write = made.writer(wired, ports)
        self._read = made.reader(self.described.outputs, ports)

    def _go_on(self) -> None:
        """Let the FMU step over one period, from now on."""
        assert self._instance is not None
        if self._instance.step(self.time, self.period):
            self.request_stop(f"the FMU {self.params.file} asks for the end of the simulation")
        self.memory.steps[()] += 1

    def save_state(self) -> None:
        """Write the FMU's state into the block's own, where the FMU can give it."""
        if not self.described.kept or self._instance is None:
            return
        state = self._instance.state()
        room = self.memory.data.nbytes
        if len(state) > room:
            raise BlockError(
                f"the state of {self.params.file} has grown to {len(state)} bytes, and the block "
                f"keeps at most {room}: this run has no snapshot"
            )
        self.memory.length[()] = len(state)
        self.memory.data[...] = 0
        self.memory.data.view(np.uint8)[: len(state)] = np.frombuffer(state, np.uint8)

    def load_state(self) -> None:
        """Give the FMU its state back.

        Raises:
            BlockError: the FMU cannot take it; only its beginning can be gone back to.
        """
        assert self._instance is not None
        if self.described.kept and self.memory.length[()]:
            length = int(self.memory.length[()])
            self._instance.restore(self.memory.data.view(np.uint8)[:length].tobytes())
            return
        if int(self.memory.steps[()]) == 0:
            self._begin()
            return
        raise BlockError(
            f"{self.params.file} cannot be restored to what it was after "
            f"{int(self.memory.steps[()])} steps: its model description says that it cannot save "
            "its state (canSerializeFMUState); only the start of a run can be gone back to"
        )

    def warnings(self) -> Sequence[str]:
        """Return warnings: snapshots that lack the FMU, and the FMU's own."""
        said = []
        if not self.described.kept:
            said.append(
                f"the FMU {self.params.file} cannot save its state: a snapshot does not have it, "
                "and a replay has to begin at the start"
            )
        said += [
            f"the model description of the FMU {self.params.file} is not as FMI demands: {problem}"
            for problem in self.described.problems[:3]
        ]
        if self._instance is not None:
            said += [f"the FMU {self.params.file} warns: {w}" for w in self._instance.warnings]
        return said

    def close(self) -> None:
        """Terminate the FMU."""
        if self._instance is not None:
            self._instance.close()
            self._instance = None


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
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """Return the class with the ports of the FMU."""
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
    """Return values in row-major order as nested lists of a shape."""
    for size in reversed(shape[1:]):
        values = [values[k : k + size] for k in range(0, len(values), size)]
    return values


_CLASSES: list[tuple[tuple[Description, bool], type[Block]]] = []


def _class_for(found: Description, direct: bool) -> type[Block]:
    """Return the class of an FMU; the same one for the same description, so that graphs compare equal."""
    for key, known in _CLASSES:
        if key == (found, direct):
            return known
    body: dict[str, Any] = {"__doc__": CoSimulation.__doc__, "__module__": CoSimulation.__module__}
    body |= _ports(found.inputs, found.outputs)
    body["described"] = found
    body["specialize"] = vars(CoSimulation)[
        "specialize"
    ]  # as for every block whose ports are found
    made = type("CoSimulation", (CoSimulation if direct else _WithoutFeedthrough,), body)
    _CLASSES.append(((found, direct), made))
    return made
