"""A bench to test any block by itself: set its inputs, step it, read its outputs and state."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Generic, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.compile_calls import compile_calls
from ...mathematics.compiling.kernel_call import collect_calls
from ...robots.description import RobotDescription, find_robot
from ..language.block import Block, Clock, Context
from ..language.errors import BlockError
from ..language.parameters import Parameters
from ..language.requirements import unmet_requirements
from ..language.stages import BlockSpec
from ..running.memory import Memory
from ..running.snapshot import Snapshot

B = TypeVar("B", bound=Block)


class BlockBench(Generic[B]):
    """One block with memory of its own, set up and started.

    Args:
        block_type: the block's class.
        params: its parameters as a graph file would give them, or as an object of ``Params``.
        robot: a robot's name, a description, or nothing.
        rate: the base rate, of the ticks [Hz].
        period_ticks: ticks from one run of the block to the next; one step is one run.
        folder: the folder that files named by a parameter are relative to.
        dimensions: named sizes; they win over the robot's, and the block's own win over them.
        wired: the inputs that are wired; all by default. The others read their defaults and cannot
            be set.
        plain: run the block's kernels as plain Python. By default they run as machine code, as in
            a graph, which computes the same bits; where llvmlite is not installed they always run as
            plain Python.

    Raises:
        BlockError: the block cannot work with the robot or the rate; the message is the one that a
            load report would have.
        KeyError: ``wired`` names an input that the block does not have.

    Example::

        bench = BlockBench(Gain, {"gain": 2.0, "n": 3})
        bench.set("u", value=[1.0, 2.0, 3.0])
        bench.step()
        assert bench.get("y").value.tolist() == [2.0, 4.0, 6.0]
    """

    def __init__(
        self,
        block_type: type[B],
        params: Mapping[str, Any] | Parameters | None = None,
        *,
        robot: str | RobotDescription | None = None,
        rate: float = 500.0,
        period_ticks: int = 1,
        folder: Path | None = None,
        dimensions: Mapping[str, int] | None = None,
        wired: Iterable[str] | None = None,
        plain: bool = False,
    ) -> None:
        description = find_robot(robot) if isinstance(robot, str) else robot
        if not isinstance(params, Parameters):
            params = block_type.Params.model_validate(dict(params or {}))
        block_type = cast("type[B]", block_type.specialize(params, folder or Path(), description))
        sizes = {
            **(description.dimensions if description else {}),
            **(dimensions or {}),
            **block_type.dimensions(params, description),
        }
        names = tuple(block_type.inputs) if wired is None else tuple(wired)
        for name in names:
            if name not in block_type.inputs:
                raise KeyError(f"{block_type.__name__} has no input {name!r}")
        spec = BlockSpec("block", block_type, params, {}, sizes)
        self.clock = Clock(1.0 / rate)
        context = Context(
            "block",
            self.clock,
            period_ticks,
            0,
            dimensions=sizes,
            robot=description,
            wired=names,
            folder=folder or Path(),
        )
        unmet = unmet_requirements(block_type, params, context)
        if unmet:
            reasons = "; ".join(requirement.message for requirement in unmet)
            raise BlockError(f"{block_type.__name__}: {reasons}")
        self.memory = Memory([spec], description)
        with collect_calls() as calls:
            self.block: B = block_type(params, context)
            self.memory.set_up(self.block, spec)
        if not plain:
            compile_calls(calls)
        self._is_moore = block_type.is_moore()
        self._settable: dict[str, Mapping[str, NDArray[Any]]] = {
            name: self.memory.bus.signal(block_type.inputs[name].signal, f"block.{name}").views()
            for name in names
        }
        for name in block_type.states:
            self._settable[name] = getattr(self.block, name).views()
        self.block.start()

    def set(self, port: str, /, **fields: Any) -> None:
        """Write fields of a wired input or a state; a single number fills a whole field.

        Raises:
            KeyError: there is no such wired input or state, or no such field.
            ValueError: a value has another shape than the field.
        """
        if port not in self._settable:
            raise KeyError(
                f"{port!r} cannot be set; there is {', '.join(self._settable) or 'nothing'}"
            )
        views = self._settable[port]
        for name, value in fields.items():
            if name not in views:
                raise KeyError(f"{port} has no field {name!r}; it has {', '.join(views)}")
            view, given = views[name], np.asarray(value)
            if given.shape not in ((), view.shape):
                raise ValueError(f"{port}.{name} has shape {view.shape}, not {given.shape}")
            view[...] = given

    def get(self, port: str) -> Any:
        """Return the signal of an output, an input or a state: views, which the next step changes.

        Raises:
            KeyError: there is no such port.
        """
        kind = type(self.block)
        if port not in kind.inputs and port not in kind.outputs and port not in kind.states:
            raise KeyError(f"{kind.__name__} has no port {port!r}")
        return getattr(self.block, port)

    def step(self, runs: int = 1) -> None:
        """Run the block, ``step``, or ``emit`` and then ``update``, and advance by its period.

        After a step of a Moore block its outputs are those that ``emit`` wrote before ``update``;
        call ``bench.block.emit()`` for the outputs that follow from the new state.
        """
        block: Any = self.block
        for _ in range(runs):
            if self._is_moore:
                block.emit()
                block.update()
            else:
                block.step()
            self.clock.tick += block.context.period_ticks

    @property
    def stop_reason(self) -> str | None:
        """Reason why the block requested the end of the run; ``None`` if it did not."""
        return self.clock.stop_reason

    def snapshot(self) -> Snapshot:
        """Copy the block's state and ports, and the tick."""
        self.block.save_state()
        return self.memory.snapshot(self.clock.tick)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot, also one that another bench of the same block took."""
        self.memory.restore(snapshot)
        self.clock.tick = snapshot.tick
        self.clock.stop_reason = None
        self.block.load_state()

    def close(self) -> None:
        """Close the block; also at the end of a ``with``."""
        self.block.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
