"""Methods of an exported FMU that PythonFMU3 calls, on a running graph.

``RunningGraph`` is the graph inside the FMU as FMI sees it: values at communication points.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from .....runtime.graph import load
from .....runtime.language.errors import AloftError
from .....runtime.language.units import BASE_UNITS, parse_unit
from .....runtime.running.snapshot import Snapshot
from ..instance import release_at_exit

_HEAD = struct.Struct("<qqqq")
"""The tick, and how many bytes of bus, state and inputs follow."""
GRAPH, INTERFACE = "graph.yaml", "interface.json"
"""The files in the FMU's folder ``resources/graph``."""


class RunningGraph:
    """A graph whose outputs at the communication point t are those of the tick at t.

    The tick is computed when an output is asked for or the next step is made, with the inputs that
    are set by then; when inputs change after that, it is computed again from what was remembered
    before it. So an output may depend on an input of the same instant, and a step of n ticks holds
    the inputs.

    Args:
        folder: where ``graph.yaml`` and ``interface.json`` are.

    Raises:
        AloftError: the graph cannot run here.
    """

    def __init__(self, folder: Path) -> None:
        self.interface: Mapping[str, Any] = json.loads(
            (folder / INTERFACE).read_text(encoding="utf-8")
        )
        text = (folder / GRAPH).read_text(encoding="utf-8")
        self._run = load(text, self.interface["overrides"], path=folder / GRAPH).open()
        self._inputs: dict[str, NDArray[Any]] = {}
        for each in self.interface["inputs"]:
            port, _, field = each["source"].rpartition(".")
            block, _, name = port.rpartition(".")
            kept = getattr(self._run.block(block), f"kept_{name}").views()
            self._inputs[each["name"]] = kept[field].reshape(-1)
        self._values = {name: view.copy() for name, view in self._inputs.items()}
        self._sources = {each["name"]: each["source"] for each in self.interface["outputs"]}
        self._before = self._run.snapshot()
        self._computed = self._fresh = False

    @property
    def period(self) -> float:
        """The duration of a tick [s]."""
        return self._run.graph.base_period

    def set(self, name: str, value: Any) -> None:
        """Set an input; a list has its elements in row-major order."""
        target = self._values[name]
        new = np.ravel(np.asarray(value))
        if not np.array_equal(target, new):
            target[...] = new
            self._fresh = False

    def input(self, name: str) -> list[Any]:
        """Return the elements of an input."""
        return list(self._values[name].tolist())

    def output(self, name: str) -> list[Any]:
        """Return the elements of an output at the present communication point."""
        self._compute()
        return list(np.ravel(self._run[self._sources[name]]).tolist())

    def _compute(self) -> None:
        """Run the tick of the present communication point with the present inputs."""
        if self._fresh:
            return
        if self._computed:
            self._run.restore(self._before)
        for name, view in self._inputs.items():
            view[...] = self._values[name]
        if not self._run.reason:
            self._run.step()
        self._computed = self._fresh = True

    def step(self, time: float, period: float) -> str:
        """Go on to the communication point at ``time + period``. Returns why the graph has ended.

        Raises:
            AloftError: the period is no whole number of ticks, or a block fails.
        """
        ticks = round(period / self.period)
        if ticks < 1 or abs(ticks * self.period - period) > 1e-6 * self.period:
            raise AloftError(
                f"a step of {period:.9g} s is no whole number of the graph's ticks of "
                f"{self.period:.9g} s"
            )
        self._compute()
        if ticks > 1 and not self._run.reason:
            self._run.step(ticks - 1)
        if not self._run.reason:
            self._before = self._run.snapshot()
            self._computed = self._fresh = False
        return self._run.reason

    def state(self) -> bytes:
        """Return the graph's state at the present communication point, always as many bytes."""
        before = self._before
        inputs = b"".join(view.tobytes() for view in self._values.values())
        head = _HEAD.pack(before.tick, len(before.bus), len(before.state), len(inputs))
        return head + before.bus + before.state + inputs

    def restore(self, data: bytes) -> None:
        """Go back to a state. Raises ``ValueError`` if it is of another graph."""
        sizes = _HEAD.unpack_from(data) if len(data) >= _HEAD.size else (0, 0, 0, 0)
        tick, bus, state, inputs = sizes
        before, kept = self._before, sum(view.nbytes for view in self._values.values())
        own = (len(before.bus), len(before.state), kept)
        if (bus, state, inputs) != own or len(data) != _HEAD.size + sum(own):
            raise ValueError("this is no state of this FMU")
        first = _HEAD.size
        self._before = Snapshot(
            tick, data[first : first + bus], data[first + bus : first + bus + state]
        )
        self._run.restore(self._before)
        at = first + bus + state
        for view in self._values.values():
            view[...] = np.frombuffer(data[at : at + view.nbytes], view.dtype)
            at += view.nbytes
        self._computed = self._fresh = False

    def close(self) -> None:
        """End the run."""
        self._run.close()


def terminals(interface: Mapping[str, Any]) -> Sequence[tuple[str, Mapping[str, Any]]]:
    """Return all terminals in the order of the FMU's variables, each with its causality."""
    return [(kind, each) for kind in ("input", "output") for each in interface[f"{kind}s"]]


class GraphSlave:
    """The part of an FMU's class that aloft brings; the other is PythonFMU3's ``Fmi3Slave``.

    The FMU has PythonFMU3 in it, and its graph in ``resources/graph``. aloft itself has to be
    installed where it runs.
    """

    def __init__(self, **given: Any) -> None:
        import pythonfmu3 as fmi

        super().__init__(**given)
        me: Any = self
        resources = Path(given["resources"])
        release_at_exit(resources.parent / "binaries")
        self.running = RunningGraph(resources / "graph")
        interface = self.running.interface
        me.guid = interface["token"]
        me.description = interface["description"]
        me.default_experiment = fmi.DefaultExperiment(
            start_time=0.0, step_size=self.running.period, stop_time=interface["stop_time"]
        )
        units = {each["unit"] for _, each in terminals(interface) if each["unit"]}
        for text in sorted(units):
            unit = parse_unit(text)
            powers = dict(zip(BASE_UNITS, unit.exponents, strict=True))
            me.register_units([fmi.Unit(text, factor=unit.scale, **powers)])
        self.time = 0.0
        me.register_variable(
            fmi.Float64(
                "time",
                causality=fmi.Fmi3Causality.independent,
                variability=fmi.Fmi3Variability.continuous,
                description="the time",
            )
        )
        for causality, each in terminals(interface):
            me.register_variable(self._variable(fmi, causality, each))

    def _variable(self, fmi: Any, causality: str, each: Any) -> Any:
        name, size = each["name"], prod(each["shape"])
        kind = {"float64": fmi.Float64, "int64": fmi.Int64, "bool": fmi.Boolean}[each["dtype"]]
        read = self.running.input if causality == "input" else self.running.output
        write = self.running.set if causality == "input" else _refuse
        further: dict[str, Any] = {}
        if size > 1:
            further["dimensions"] = [fmi.Dimension(start=str(n)) for n in each["shape"]]
        if each["dtype"] == "float64" and each["unit"]:
            further["unit"] = each["unit"]
        return kind(
            name,
            causality=getattr(fmi.Fmi3Causality, causality),
            variability=fmi.Fmi3Variability.discrete,
            description=each["text"],
            getter=_getter(read, name, size),
            setter=lambda value: write(name, value),
            **further,
        )

    def to_xml(self, model_options: Any = None) -> Element:
        """Return the model description, with the step and with what depends on what."""
        root: Element = super().to_xml(model_options or {})  # type: ignore[misc]  # PythonFMU3 is not typed
        kind = root.find("CoSimulation")
        structure = root.find("ModelStructure")
        assert kind is not None and structure is not None
        kind.set("fixedInternalStepSize", f"{self.running.period:.17g}")
        variables: Any = self.vars  # type: ignore[attr-defined]  # PythonFMU3 is not typed
        references = {each.name: str(each.value_reference) for each in variables.values()}
        for each in self.running.interface["outputs"]:
            for unknown in structure:
                if unknown.get("valueReference") == references[each["name"]]:
                    depends = " ".join(references[name] for name in each["depends"])
                    unknown.set("dependencies", depends)
        return root

    def do_step(self, current_time: float, step_size: float) -> Any:
        """Go on by a whole number of ticks."""
        import pythonfmu3 as fmi

        me: Any = self
        try:
            reason = self.running.step(current_time, step_size)
        except AloftError as error:
            me.log(str(error), fmi.Fmi3Status.error)
            return fmi.Fmi3StepResult(status=fmi.Fmi3Status.error)
        self.time = current_time + step_size
        if reason:
            me.log(f"the graph has ended: {reason}", fmi.Fmi3Status.ok)
        return fmi.Fmi3StepResult(terminateSimulation=bool(reason))

    def terminate(self) -> None:
        """Close the graph's blocks."""
        self.running.close()

    def _get_fmu_state(self) -> bytes:
        return self.running.state()

    def _set_fmu_state(self, state: bytes) -> None:
        self.running.restore(state)

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        return state


def _getter(read: Callable[[str], list[Any]], name: str, size: int) -> Callable[[], Any]:
    return (lambda: read(name)) if size > 1 else (lambda: read(name)[0])


def _refuse(name: str, value: Any) -> None:
    raise ValueError(f"the output {name} cannot be set")
