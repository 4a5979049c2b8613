"""What an exported FMU is made of: the methods that PythonFMU3 calls, on a running graph."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from ...runtime.language.errors import AloftError
from ...runtime.language.units import BASE_UNITS, parse_unit
from ..library import release_at_exit
from .running_graph import RunningGraph, terminals


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
        """The model description, with the step and with what depends on what."""
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
