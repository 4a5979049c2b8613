"""Tasks of the whole-body controller: what a task is, and how the list of a graph finds and makes them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import ValidationError

from ....files.validation import describe, path_text
from ....mathematics.arrays import Array1D, Array2D
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.kernel import kernel
from ....mathematics.whole_body_qp import TaskRows
from ....robots.description import RobotDescription
from ....runtime.language.block import Context, Input
from ....runtime.language.errors import AloftError, UnknownBlockError
from ....runtime.language.importing import import_module
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.registry import find_class, snake_case
from ....runtime.language.signals import Signal
from ....runtime.language.steps import PythonCall, call_of, declare, refresh_parameters
from ...signals import DynamicsTerms, JointState, PhaseState, WholeBodyTarget
from ..frames import FrameModel


def _function(value: Any) -> FunctionType | None:
    """Return the function of a static method."""
    function = value.__func__ if isinstance(value, staticmethod) else value
    return function if isinstance(function, FunctionType) else None


class Task:
    """A desired value of some function of the generalised acceleration a: J a = d.

    A task has a number of rows, fixed when the graph is loaded. In every tick with a point in
    stance its ``step`` writes their Jacobian J (n, n_velocities), their desired values d (n,) and
    their weights w (n,) to ``rows``; the controller minimises the sum of w (J a - d)^2 over all
    tasks. A row that should not count now has weight zero.

    ``step`` is a static method, as a ``@kernel`` or in plain Python, and names what it takes, like
    the step of a block: ``rows``, ``params``, an input, or what ``setup`` has stored. The inputs
    of the controller are ``terms``, ``target``, ``phase`` and ``joints``. Another ``Input`` that a
    class declares becomes an input of the controller, called ``NAME_INPUT`` with the name of the
    task's entry in the list. The controller makes one object for each kind of phase.

    Attributes:
        robot: the robot's description.
        model: gives the frames of the robot, with their motion and Jacobians.
        params: the parameters in the kind of phase that the object is for.
    """

    Gains: ClassVar[type[Parameters]] = Parameters
    """Parameters that the controller has as well, in ``stand``, ``thrust`` and ``landing``: they are
    taken from there unless the task's entry in the list sets them."""
    Params: ClassVar[type[Parameters]] = Parameters
    """All parameters; by default ``Gains``."""
    size: ClassVar[int]
    """The number of rows, where it is the same for all robots."""
    kernels: ClassVar[tuple[str, ...]] = ("step",)
    """The functions that a task has to define, in the order in which they are called."""
    inputs: ClassVar[Mapping[str, Input[Any]]] = {}
    outputs: ClassVar[Mapping[str, Any]] = {}
    states: ClassVar[Mapping[str, Any]] = {}

    terms = Input(DynamicsTerms, text="the whole-body model at the present state")
    target = Input(WholeBodyTarget, text="target of the whole body")
    phase = Input(PhaseState, text="the phase and the points in stance")
    joints = Input(JointState, text="joint angles and velocities")

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.inputs = {**cls.inputs, **_ports(cls)}
        if "Gains" in vars(cls) and "Params" not in vars(cls):
            cls.Params = cls.Gains
        for name in cls.kernels:
            function = _function(vars(cls).get(name))
            if function is not None:
                declare(cls, function)

    def __init__(
        self,
        params: Parameters,
        rows: TaskRows,
        ports: Mapping[str, Signal],
        model: FrameModel,
        context: Context,
    ) -> None:
        assert context.robot is not None
        self.params, self.rows, self.model, self.context = params, rows, model, context
        self.robot, self.period = context.robot, context.period
        self.parameter_arrays: dict[str, Any] = {}
        for name, signal in ports.items():
            setattr(self, name, signal)
        self.setup()
        self.prepare()

    @classmethod
    def own_inputs(cls) -> Mapping[str, Input[Any]]:
        """Return the inputs that the controller does not have without this task."""
        return {
            name: port for name, port in cls.inputs.items() if Task.inputs.get(name) is not port
        }

    @classmethod
    def row_count(cls, params: Any, robot: RobotDescription) -> int:
        """Return the number of rows of the task for that robot with these parameters, those of ``stand``."""
        return cls.size

    @classmethod
    def unmet_requirements(cls, params: Any, robot: RobotDescription) -> Iterable[str]:
        """Sentences about unmet requirements of these parameters and the robot, such as an unknown joint.

        Called at load, once for each kind of phase; the load report contains the sentences.
        """
        return ()

    def setup(self) -> None:
        """Store what the kernels need, once, under the names that they take."""

    def prepare(self) -> None:
        """Compute what follows from ``params``; called after ``setup`` and when gains have changed."""

    def change(self, params: Parameters) -> None:
        """Take over changed parameters."""
        self.params = params
        refresh_parameters(self)
        self.prepare()

    def calls(self) -> Sequence[KernelCall | PythonCall]:
        """Return the calls that write the rows."""
        functions = [_function(getattr(type(self), name)) for name in self.kernels]
        return [call_of(self, function) for function in functions if function is not None]


def _ports(cls: type[Task]) -> Mapping[str, Input[Any]]:
    """Return the inputs that the body of a class declares."""
    return {name: port for name, port in vars(cls).items() if isinstance(port, Input)}


Task.inputs = _ports(Task)


class FeedbackGains(Parameters):
    """Gains of a task with an error: one number, or one for each row."""

    weight: float | tuple[float, ...] = parameter(1.0, text="weight of the squared acceleration")
    stiffness: float | tuple[float, ...] = parameter(100.0, unit="1/s^2", text="gain on the error")
    damping: float | tuple[float, ...] = parameter(
        20.0, unit="1/s", text="gain on the error's rate of change"
    )


class TaskError(NamedTuple):
    """The ``value`` of an error, reference minus actual, its ``rate`` of change, and the ``feedforward``
    acceleration of the reference, (n,) each."""

    value: Array1D
    rate: Array1D
    feedforward: Array1D


class TaskJacobian(NamedTuple):
    """The ``matrix`` J (n, n_velocities) of the actual value, whose acceleration is J v' + ``drift`` (n,)."""

    matrix: Array2D
    drift: Array1D


class FeedbackTask(Task):
    """An error that vanishes like that of a spring and a damper, with feedforward acceleration r''::

        J a + drift = r'' + stiffness e + damping e'

    A class defines two functions, which may be kernels: ``error`` writes e, e' and r'' to
    ``e: TaskError``, and ``jacobian`` writes J and the drift to ``j: TaskJacobian``.
    What they do not write stays zero. The gains are declared here.
    """

    Params: ClassVar[type[Parameters]] = FeedbackGains
    kernels: ClassVar[tuple[str, ...]] = ("error", "jacobian")
    gains_prefix: ClassVar[str] = ""
    """The prefix of the names of the three gains."""

    def __init__(
        self,
        params: Parameters,
        rows: TaskRows,
        ports: Mapping[str, Signal],
        model: FrameModel,
        context: Context,
    ) -> None:
        n = len(rows.desired)
        self.e = TaskError(np.zeros(n), np.zeros(n), np.zeros(n))
        self.j = TaskJacobian(rows.jacobian, np.zeros(n))
        self.weight, self.stiffness, self.damping = np.zeros((3, n))
        super().__init__(params, rows, ports, model, context)

    def prepare(self) -> None:
        for name in FeedbackGains.model_fields:
            getattr(self, name)[:] = getattr(self.params, f"{self.gains_prefix}{name}")

    def calls(self) -> Sequence[KernelCall | PythonCall]:
        feedback = KernelCall(
            feedback_rows,
            self.e,
            self.j.drift,
            self.weight,
            self.stiffness,
            self.damping,
            self.rows,
        )
        return [*super().calls(), feedback]


@kernel
def feedback_rows(
    e: TaskError,
    drift: Array1D,
    weight: Array1D,
    stiffness: Array1D,
    damping: Array1D,
    rows: TaskRows,
) -> None:
    """Write the desired values and weights of a ``FeedbackTask``; the gains are (n,) each."""
    rows.desired[:] = e.feedforward + stiffness * e.value + damping * e.rate - drift
    rows.weights[:] = weight


# The list of tasks in a graph


class TaskChoice(Parameters):
    """An entry in the controller's list of tasks: a task with parameters of its own."""

    task: str = parameter(text="the name of one of aloft's tasks, or module:Class")
    name: str = parameter(
        "", text="prefix of the task's inputs; by default the class in snake_case"
    )
    gains: dict[str, Any] = parameter({}, text="the task's parameters in all phases")
    stand: dict[str, Any] = parameter({}, text="other gains while standing and squatting")
    thrust: dict[str, Any] = parameter({}, text="other gains in the thrust")
    landing: dict[str, Any] = parameter({}, text="other gains after touchdown")


PHASE_KINDS = ("stand", "thrust", "landing")
"""The kinds of phases that have gains of their own."""


class TaskChoiceError(AloftError):
    """An entry of the list of tasks cannot be used; the message is one line."""


@dataclass(frozen=True)
class ChosenTask:
    """A task class, and the entry that chose it."""

    kind: type[Task]
    entry: TaskChoice

    @property
    def inputs(self) -> Mapping[str, str]:
        """The inputs of the controller that exist for this task, by the task's names for them."""
        name = self.entry.name or snake_case(self.kind.__name__)
        return {port: f"{name}_{port}" for port in self.kind.own_inputs()}

    def params(self, phase: str, shared: Parameters) -> Any:
        """Return the task's parameters in the phases called ``phase``; ``shared`` are the controller's gains.

        Raises:
            TaskChoiceError: the entry sets a parameter that the task does not have, or a wrong value.
        """
        fields, names = type(shared).model_fields, self.kind.Gains.model_fields
        values = {name: getattr(shared, name) for name in names if name in fields}
        own: Mapping[str, Any] = getattr(self.entry, phase)
        try:
            return self.kind.Params.model_validate({**values, **self.entry.gains, **own})
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            gain, reason = path_text(first["loc"]), describe(first, self.kind.Params)
            known = ", ".join(self.kind.Params.model_fields) or "none"
            raise TaskChoiceError(
                f"task {self.entry.task}: gain {gain!r}: {reason}; its gains are {known}"
            ) from error


@cache
def own_tasks() -> Mapping[str, type[Task]]:
    """Return the tasks that a graph may choose by name: all that the modules of this package define."""
    package = __name__.rpartition(".")[0]
    names = sorted(path.stem for path in Path(__file__).parent.glob("[!_]*.py"))
    modules = [import_module(f"{package}.{name}") for name in names if name != "task"]
    return {
        kind.__name__: kind
        for module in modules
        for kind in vars(module).values()
        if isinstance(kind, type) and issubclass(kind, Task) and kind.__module__ == module.__name__
    }


def choose_tasks(
    entries: Sequence[str | TaskChoice], folders: Sequence[Path] = ()
) -> tuple[ChosenTask, ...]:
    """Return the tasks of a list, in its order.

    Args:
        folders: the folders in which a user's modules are searched for, in this order.

    Raises:
        TaskChoiceError: there is no such task, it is not a task, or two have an input of one name.
    """
    chosen = []
    for item in entries:
        entry = item if isinstance(item, TaskChoice) else TaskChoice(task=item)
        chosen.append(ChosenTask(_find_task(entry.task, folders), entry))
    ports: set[str] = set()
    for each in chosen:
        for port in each.inputs.values():
            if port in ports or port in Task.inputs or not port.isidentifier():
                raise TaskChoiceError(
                    f"task {each.entry.task}: its input cannot be called {port!r}; give the task "
                    "a name of its own, such as name: left_hand"
                )
            ports.add(port)
    return tuple(chosen)


def _find_task(name: str, folders: Sequence[Path]) -> type[Task]:
    if ":" not in name:
        known = own_tasks()
        if name in known:
            return known[name]
        nearest = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f"did you mean {nearest[0]}? " if nearest else ""
        raise TaskChoiceError(
            f"there is no task called {name!r}; {hint}There are {', '.join(known)}, and a task "
            "of your own is named module:Class"
        )
    found, failure = None, ""
    for folder in dict.fromkeys(folders) or (None,):
        try:
            found = find_class(name, folder)
            break
        except UnknownBlockError as error:
            failure = failure or str(error)
        except AloftError as error:
            raise TaskChoiceError(f"task {name}: {error}") from error
    if found is None:
        raise TaskChoiceError(f"task {name}: {failure}")
    if not (isinstance(found, type) and issubclass(found, Task)):
        raise TaskChoiceError(f"task {name}: {name.partition(':')[2]} does not derive from Task")
    missing = [each for each in found.kernels if _function(getattr(found, each, None)) is None]
    if found.row_count.__func__ is Task.row_count.__func__ and not hasattr(found, "size"):  # type: ignore[attr-defined]
        missing.append("size")
    if missing:
        raise TaskChoiceError(f"task {name}: the class does not define {', '.join(missing)}")
    return found
