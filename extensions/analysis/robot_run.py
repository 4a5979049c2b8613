"""Signals of a robot's run by their meaning, found by the types of ports and by the wires."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import (
    BaseState,
    ContactState,
    ContactSwitches,
    DelayEstimate,
    DynamicsTerms,
    ExternalForce,
    ImuReading,
    JointCommand,
    JointState,
    JumpReference,
    MassEstimate,
    Phase,
    PhaseState,
    RobotTruth,
    WholeBodyCommand,
)
from ...logs.replay.replay import Replayable
from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...runtime.language.errors import AloftError
from ...runtime.language.signal_error import SignalError
from ...runtime.language.signals import Signal
from ...runtime.language.stages import BlockSpec


@dataclass(frozen=True)
class RobotRun:
    """A run, in memory or recorded, of a graph with a robot that the simulator knows the truth of.

    Attributes:
        run: the run.
        outcome: how it ended, as ``RunResult.to_json`` has it: ``success``, ``reason`` and ``metrics``.
    """

    run: Replayable
    outcome: Mapping[str, Any]

    def __post_init__(self) -> None:
        if self.run.graph.robot is None or not self.truth:
            raise AloftError(
                "this run cannot be explained: it has no output of the type RobotTruth, from which the "
                "deviations are found; record a run of a simulated robot"
            )
        if not len(self.run.ticks):
            raise AloftError(f"this run has no tick to explain: {self.outcome.get('reason', '')}")

    @property
    def robot(self) -> RobotDescription:
        """The robot's description."""
        robot = self.run.graph.robot
        assert robot is not None
        return robot

    @property
    def period(self) -> float:
        """Length of a tick [s]."""
        return 1.0 / self.run.graph.base_rate

    @cached_property
    def time(self) -> Array:
        """Times of all ticks [s], (n,)."""
        return np.asarray(self.run.ticks * self.period, np.float64)

    @cached_property
    def rows(self) -> NDArray[np.uint8]:
        """The bytes of all signals at every tick, (n, bytes)."""
        return self.run.rows(int(self.run.ticks[0]), int(self.run.ticks[-1]) + 1)[1]

    def __call__(self, port: str, field: str) -> NDArray[Any]:
        """Return all values of a field of ``block.port``, (n, ...)."""
        return self.run.bus.view(self.rows, f"{port}.{field}")

    @cached_property
    def _blocks(self) -> list[BlockSpec]:
        """The blocks in the order of execution, without the delays that loading inserts."""
        graph = self.run.graph
        return [graph.block(path) for path in graph.order if "~" not in path]

    def port(self, signal: type[Signal]) -> str:
        """Return the last output of that type in the order of execution, as ``block.port``; else empty."""
        found = [
            f"{spec.path}.{name}"
            for spec in self._blocks
            for name, output in spec.block_type.outputs.items()
            if issubclass(output.signal, signal) and not output.absent
        ]
        return found[-1] if found else ""

    def read_by(self, block: str, signal: type[Signal]) -> str:
        """Return the source, ``block.port``, of a block's first input of that type; else an empty text."""
        if not block:
            return ""
        spec = self.run.graph.block(block)
        inputs = spec.block_type.inputs
        found = [w.source for n, w in spec.wires.items() if issubclass(inputs[n].signal, signal)]
        return found[0] if found else ""

    @cached_property
    def truth(self) -> str:
        """Source of the simulator's true state."""
        return self.port(RobotTruth)

    @cached_property
    def robot_block(self) -> str:
        """The block of the simulated robot."""
        return self.truth.rpartition(".")[0]

    @cached_property
    def estimator(self) -> str:
        """The block that estimates the base from an IMU; else empty."""
        for spec in self._blocks:
            outputs = spec.block_type.outputs.values()
            if self.read_by(spec.path, ImuReading) and any(
                issubclass(output.signal, BaseState) for output in outputs
            ):
                return spec.path
        return ""

    @cached_property
    def base(self) -> str:
        """The estimated base; else empty."""
        if not self.estimator:
            return ""
        outputs = self.run.graph.block(self.estimator).block_type.outputs
        name = next(n for n, output in outputs.items() if issubclass(output.signal, BaseState))
        return f"{self.estimator}.{name}"

    @cached_property
    def contacts(self) -> str:
        """The contacts that the estimator counts with; else empty."""
        return self.read_by(self.estimator, ContactState)

    def sensor(self, signal: type[ImuReading | JointState]) -> str:
        """Return the estimator's source of that kind of measurement, else the robot's output."""
        return self.read_by(self.estimator, signal) or self.port(signal)

    @cached_property
    def command(self) -> str:
        """Source of the controller's command, before any fault on the way to the robot; else empty."""
        source = self.read_by(self.robot_block, JointCommand)
        while source and issubclass(
            self.run.graph.block(source.rpartition(".")[0]).block_type, SignalError
        ):
            source = self.run.graph.block(source.rpartition(".")[0]).wires["u"].source
        return source

    @cached_property
    def reference(self) -> str:
        """The plan; else empty."""
        return self.port(JumpReference)

    @cached_property
    def push(self) -> str:
        """The force that is put on the robot; else empty."""
        return self.read_by(self.robot_block, ExternalForce)

    @cached_property
    def solver(self) -> str:
        """The answers of the whole-body controller; else empty."""
        return self.port(WholeBodyCommand)

    @cached_property
    def delay(self) -> str:
        """The estimate of the delay; else empty."""
        return self.port(DelayEstimate)

    @cached_property
    def terms(self) -> str:
        """The dynamics that the controller counts with; else empty."""
        return self.port(DynamicsTerms)

    @cached_property
    def mass(self) -> str:
        """The estimate of the robot's mass; else empty."""
        return self.port(MassEstimate)

    @cached_property
    def switches(self) -> str:
        """The foot switches; else empty."""
        return self.port(ContactSwitches)

    @cached_property
    def true_mass(self) -> float:
        """The mass of the simulated robot [kg]."""
        metrics = self.outcome.get("metrics", {})
        return float(metrics.get(f"{self.robot_block}_mass_kg", self.robot.total_mass))

    @cached_property
    def phase(self) -> NDArray[np.int64]:
        """The phase at every tick, (n,); -2 where the graph has none."""
        port = self.port(PhaseState)
        return self(port, "phase") if port else np.full(len(self.time), -2)

    def phase_at(self, row: int) -> str:
        """Return the name of the phase, or an empty text."""
        number = int(self.phase[row])
        return Phase(number).name.lower() if number in set(Phase) else ""

    @cached_property
    def touched(self) -> NDArray[np.bool_]:
        """Contact points that carried load, (n, n_contacts)."""
        return self(self.truth, "contact_touched")
