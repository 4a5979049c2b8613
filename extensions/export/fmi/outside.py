"""Surroundings of an exported sub-graph, as a block."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import field_validator

from ....robots.description import RobotDescription
from ....runtime.language.block import Block, Output, State
from ....runtime.language.errors import UnitError
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import DTYPES, signal_of
from ....runtime.language.units import parse_unit

_FIELD_KEYS = ("shape", "dtype", "unit", "frame", "start", "quaternion")


class OutsideParameters(Parameters):
    """The outputs that blocks of the sub-graph read."""

    ports: dict[str, dict[str, dict[str, Any]]] = parameter(
        text="for each output its fields: shape, dtype, unit, frame, start, quaternion"
    )

    @field_validator("ports")
    @classmethod
    def _ports(cls, value: dict[str, dict[str, dict[str, Any]]]) -> Any:
        for port, fields in value.items():
            for name, field in fields.items():
                for key in field:
                    if key not in _FIELD_KEYS:
                        raise ValueError(f"{port}.{name} has no {key!r}, only {_FIELD_KEYS}")
                if field.get("dtype", "float64") not in DTYPES:
                    raise ValueError(f"the dtype of {port}.{name} is not one of {list(DTYPES)}")
                try:
                    parse_unit(field.get("unit") or "")
                except UnitError as error:
                    raise ValueError(f"{port}.{name}: {error}") from None
        return value


class Outside(Block):
    """Stands for blocks outside of an exported sub-graph: outputs that somebody else sets.

    ``aloft export fmu`` puts it into the graph of an FMU, in the place of each block that the
    sub-graph reads, and sets its outputs between two ticks from the FMU's inputs. Its outputs hold
    what was set last, and ``start`` before, or zero. It is of no use elsewhere: a graph that Python
    steps has ``blocks.External``.
    """

    Params = OutsideParameters
    params: OutsideParameters

    @classmethod
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """Return the class with these outputs."""
        assert isinstance(params, OutsideParameters)
        body: dict[str, Any] = {"__doc__": cls.__doc__, "__module__": cls.__module__}
        for port, fields in params.ports.items():
            signal = signal_of("FromOutside", fields)
            body[port] = Output(signal, text="what is outside")
            body[f"kept_{port}"] = State(signal, text="values that were set last")
        return type("Outside", (Outside,), body)

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return a force."""
        return {"ports": {"y": {"value": {"shape": [2], "unit": "N", "start": [1.0, 2.0]}}}}

    def setup(self) -> None:
        """Begin with the start values."""
        self._pairs = []
        for port, fields in self.params.ports.items():
            kept = getattr(self, f"kept_{port}").views()
            for name, field in fields.items():
                start = np.asarray(field.get("start", 0))
                kept[name][...] = start if start.shape == () else start.reshape(kept[name].shape)
                self._pairs.append((getattr(self, port).views()[name], kept[name]))

    def emit(self) -> None:
        """Write what was set."""
        for target, kept in self._pairs:
            np.copyto(target, kept)

    def update(self) -> None:
        """Do nothing: there is no input."""
