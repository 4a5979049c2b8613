"""For the runtime: what it keeps in every block, and the hooks that it calls.

Whoever writes a block needs ``Block`` alone. ``RuntimeBlock`` has what declaration, binding and compilation
fill in; a block of one's own neither sets nor calls it. ``BlockHooks`` has what a block may define besides, all
empty or with a default: the tutorial tells when.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.kernel_call import KernelCall
from ...robots.description import RobotDescription
from .context import Context
from .errors import DeclarationError
from .parameters import Parameters
from .ports import Input, Output, Port, PortOwner, State
from .quantities import InputQuantities, OutputQuantities
from .signals import Signal, StateElements
from .steps import PythonCall, declare_steps


class RuntimeBlock(PortOwner):
    """The ports, steps and calls of a block as the runtime has found them."""

    params: Parameters
    context: Context
    named_steps: ClassVar[Mapping[str, Any]] = {}
    """The steps that name what they take, by the name of the method; see ``steps``."""
    overridden_steps: ClassVar[frozenset[str]] = frozenset()
    """Named steps of a base that a step in Python replaces: their calls are made by ``super().step()``."""
    inputs: ClassVar[Mapping[str, Input[Any]]] = {}
    outputs: ClassVar[Mapping[str, Output[Any]]] = {}
    states: ClassVar[Mapping[str, State[Any]]] = {}
    constants: Any
    scratch: Any
    kernel_calls: Sequence[KernelCall | PythonCall] = ()
    """Calls that ``step`` or ``emit`` consists of, where it is nothing but calls."""
    update_calls: Sequence[KernelCall | PythonCall] = ()
    """Calls that ``update`` consists of, likewise."""
    event: NDArray[np.int64] | None = None
    """Request of the last step for ``on_event``, (1,): not zero if so; ``None`` where it never
    does."""
    event_calls: Sequence[KernelCall] = ()
    """Calls that a library without Python makes in place of ``on_event``, if there are any."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        ports = {n: v for n, v in vars(cls).items() if isinstance(v, Port)}
        for name, port in ports.items():
            if isinstance(vars(cls).get(name), Port) and name in _reserved(cls):
                raise DeclarationError(f"{cls.__name__}: a port cannot be called {name!r}")
            port.name = name
        cls.inputs = {**cls.inputs, **{n: p for n, p in ports.items() if isinstance(p, Input)}}
        cls.outputs = {**cls.outputs, **{n: p for n, p in ports.items() if isinstance(p, Output)}}
        cls.states = {**cls.states, **{n: p for n, p in ports.items() if isinstance(p, State)}}
        declare_steps(cls)

    def __init__(self, params: Parameters, context: Context) -> None:
        self.params = params
        self.context = context
        self.parameter_arrays: dict[str, NDArray[Any]] = {}
        """The parameters that kernels read, in the arrays in which they read them."""

    @classmethod
    def is_moore(cls) -> bool:
        """Return whether outputs follow from state alone (``emit`` and ``update``).

        Raises:
            DeclarationError: the class defines neither ``step`` nor ``emit`` and ``update``, or
                methods of both kinds.
        """
        return _is_moore(cls)  # type: ignore[arg-type]  # a class is hashable; mypy asks its instances


@cache
def _is_moore(block_type: type[RuntimeBlock]) -> bool:
    """Return what ``is_moore`` does; a load asks three times for each block."""
    step, emit, update = (hasattr(block_type, name) for name in ("step", "emit", "update"))
    if step and not emit and not update:
        return False
    if emit and update and not step:
        return True
    raise DeclarationError(
        f"{block_type.__name__} must define either step(), or emit() and update(); it defines "
        + (", ".join(n for n in ("step", "emit", "update") if hasattr(block_type, n)) or "none")
    )


@dataclass(frozen=True)
class UnmetRequirement:
    """Something about the graph's robot or a parameter that a block cannot work with.

    ``message`` describes the problem. ``parameter`` is the parameter concerned, if any, as ``name``
    or ``name.key``. ``nearest`` holds legal names that resemble the one found. ``fix`` is the text
    to write instead.
    """

    message: str
    parameter: str = ""
    expected: str = ""
    found: str = ""
    nearest: tuple[str, ...] = ()
    fix: str = ""


class BlockHooks(RuntimeBlock):
    """Properties and methods that a block may define besides its steps; the runtime asks for them."""

    Constants: ClassVar[type[Signal] | None] = None
    """Values that follow from the parameters and the robot: ``prepare`` writes them into
    ``constants``."""

    Scratch: ClassVar[type[Signal] | None] = None
    """Scratch memory of one step, in ``scratch``. No value lasts until the next step."""

    outside: ClassVar[Literal["no", "simulated", "real"]] = "no"
    """Origin of the outputs: the graph alone, a simulator or the real world. A simulator gives the
    same outputs again when it is run again; the real world (a robot, another machine) does not, so
    a replay takes its outputs from the recording."""

    acts_outside: ClassVar[bool] = False
    """True if the block sends to something outside of the run, such as a network, another process or a
    device. A replay and what goes on from a recording never run such a block, nor one whose outputs come
    from the real world: its outputs are the recorded ones."""

    program_files: ClassVar[tuple[str, ...]] = ()
    """The parameters that name a program to run, such as an FMU, or a folder with one. A recording's
    program runs only if the user trusts it."""

    delay_runs: ClassVar[int] = 1
    """After how many runs the outputs of a Moore block depend on what it reads."""

    waits_for_others: bool = False
    """True if a call waits for another process, with a limit of its own. Then the watchdog, which
    ends the run when a call takes longer than ``clock.hangs_after``, does not watch the block."""

    array_allocations: ClassVar[int] = 0
    """Number of arrays that a tick may allocate. It is zero unless a library leaves no choice; then
    ``allocation_reason`` names that library."""

    allocation_reason: ClassVar[str] = ""

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """Dimensions of this block alone; they hide dimensions of the graph with the same name.

        By default every integer parameter is a dimension, so a block with a parameter ``n`` may
        declare fields of shape ``"n"``.
        """
        values = {name: getattr(params, name) for name in type(params).model_fields}
        return {n: v for n, v in values.items() if isinstance(v, int) and not isinstance(v, bool)}

    @classmethod
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Any]:
        """Return the class whose ports are those for these parameters, or this robot; by default
        the class itself.

        Another class has the name of this one. Files that parameters name are relative to
        ``folder``; beside the loaded graph, in ``graph_folder``, users keep their modules. A ``BlockError`` that this raises should be an unmet requirement of ``requires`` as well.
        """
        return cls

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Return the requirements that parameters, robot and graph do not meet.

        Loading reports it. ``context`` is the one that the block will be constructed with: it has
        the robot, the period of the block, the names of its wired inputs, and the folder to which
        its files are relative. This is called only if the robot has everything in ``needs``.
        """
        return ()

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Return the values that follow from the parameters for other blocks, as plain data by
        name.

        A graph writes ``parameter: {from: block.name}`` to use it, so that nothing is declared
        twice; ``name`` may also be a parameter of the block. Loading puts the value in its place.
        An ``UnmetRequirement`` in place of a value is the reason why there is none, reported where
        a graph uses it. ``context`` is as for ``requires``, but has no dimensions and no wired
        inputs; its ``asked`` names the values that are used: one that is costly and not among them may be
        ``None``. What this raises should be an unmet requirement of ``requires`` as well.
        """
        return {}

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the units and frames of outputs whose fields are declared as ``inferred``.

        ``inputs`` has those of the inputs. A gain, for instance, answers ``{"y": u.times(unit)}``
        with ``u = inputs["u"]``, and ``{"y": None}`` while ``u`` is not known. ``inputs.alike("a",
        "b")`` requires that inputs agree. Without this method such an output has a unit that is not
        checked, which ``aloft check`` reports.
        """
        return {}

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Further dimensions that only state fields use.

        It may take long, for example to build a model, so it is called when the graph is bound to
        memory and not when it is checked.
        """
        return {}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return the parameters for the conformance suite: at least those that have no default."""
        return {}

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """Legal inputs for the conformance suite, by input and field, drawn anew every tick.

        They are needed only for fields in which the suite's own values are not legal. These are
        numbers within +-1, unit quaternions for a field called ``orientation``, rotation matrices
        for one called ``rotation``, and members of a field's ``values``.
        """
        return {}

    def prepare(self) -> None:
        """Write into ``constants`` what follows from the parameters.

        Called after ``setup``, and again between two ticks, on the control thread, when live
        parameters have changed. Afterwards the block must go on exactly as one that had these
        parameters from the start and is in the same state, so it writes neither state nor outputs.
        If it raises, the old parameters are restored, and the change is refused with the error's
        text.
        """

    def on_event(self) -> None:
        """Do in Python what the last step asked for by returning true."""

    def start(self) -> None:
        """Open the devices and files that the run needs; called once before the first tick."""

    def stop_cycle(self) -> None:
        """Send one command to come to rest: a robot commands damping here."""

    def close(self) -> None:
        """Close what ``start`` opened; called once, also after a failure."""

    def save_state(self) -> None:
        """Before a snapshot: write what the block keeps elsewhere into its declared state."""

    def load_state(self) -> None:
        """After a restore: read back from the declared state what ``save_state`` wrote there."""

    def state_elements(self) -> Mapping[str, Sequence[StateElements]]:
        """Return the elements of state fields that mix quantities, in order, by ``state.field``."""
        return {}

    def warnings(self) -> Sequence[str]:
        """Warnings to those who read the run's results, such as of a check that was waived.

        Called when every block has started, and again when the run is over; warnings that are new
        then are added.
        """
        return ()


def _reserved(block: type[RuntimeBlock]) -> frozenset[str]:
    """Return the names that the bases of all blocks use, which no port may have."""
    own = (__name__, f"{__package__}.block")
    return frozenset(
        name
        for base in block.__mro__
        if base.__module__ in own
        for name in vars(base)
        if not name.startswith("__")
    )
