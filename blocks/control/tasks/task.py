"""The base class of the whole-body controller's tasks, and the entry by which graphs choose one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.whole_body_qp import TaskRows
from ....robots.description import RobotDescription
from ....runtime.language.parameters import Parameters, parameter
from ...signals import DynamicsTerms, JointState, PhaseState, WholeBodyTarget

G = TypeVar("G")


@dataclass(frozen=True)
class Situation:
    """The signals that a task may read. They are the controller's inputs: their arrays stay the
    same objects and hold the values of the present tick."""

    robot: RobotDescription
    terms: DynamicsTerms
    target: WholeBodyTarget
    phase: PhaseState
    joints: JointState


class Task(ABC, Generic[G]):
    """A desired value of some function of the generalised acceleration a: J a = d.

    A task has a number of rows, fixed when the graph is loaded. In every tick with a point in
    stance it writes their Jacobian J (n, n_velocities), their desired values d (n,) and their
    weights w (n,) to ``self.rows``; the controller minimises the sum of w (J a - d)^2 over all
    tasks. A row that should not count now has weight zero. ``update`` allocates no array.

    To write a task, derive a class with a ``Gains`` record, ``row_count`` and ``update``, and name
    it in the controller's ``tasks`` as ``module:Class``. G is what ``update`` gets: the gains, or
    what ``prepare`` makes of them, such as arrays.
    """

    Gains: ClassVar[type[Parameters]] = Parameters
    """The task's parameters. Those that the controller's ``stand``, ``thrust`` and ``landing`` have
    under the same name are taken from there unless the task's entry in the list sets them."""

    def __init__(self, situation: Situation, rows: TaskRows) -> None:
        """Keep the situation and the rows; a derived class may allocate its scratch memory here."""
        self.situation = situation
        self.rows = rows

    @classmethod
    @abstractmethod
    def row_count(cls, robot: RobotDescription, gains: Any) -> int:
        """How many rows the task has for that robot with these ``Gains``."""

    @classmethod
    def misfits(cls, robot: RobotDescription, gains: Any) -> Iterable[str]:
        """Sentences about misfits of these ``Gains`` and the robot, such as an unknown joint.

        Called at load, once for each kind of phase; the load report contains the sentences.
        """
        return ()

    def prepare(self, gains: Any) -> G:
        """Convert ``Gains`` to the argument of ``update``; called only when the gains are set."""
        return gains  # type: ignore[no-any-return]  # one without types of its own

    @abstractmethod
    def update(self, gains: G) -> None:
        """Write the rows for the present tick."""


class KernelTask(Task[KernelCall]):
    """A task whose rows are written by one kernel: ``prepare`` makes the call of it.

    The controller's step is compiled as a whole where all its tasks are of this kind.
    """

    @abstractmethod
    def prepare(self, gains: Any) -> KernelCall:
        """The call that writes the rows with these ``Gains``; a new one every time."""

    def update(self, gains: KernelCall) -> None:
        gains.run()


class TaskChoice(Parameters):
    """An entry in the controller's list of tasks: a task with gains of its own."""

    task: str = parameter(text="the name of one of aloft's tasks, or module:Class")
    gains: dict[str, Any] = parameter({}, text="the task's gains in all phases")
    stand: dict[str, Any] = parameter({}, text="other gains while standing and squatting")
    thrust: dict[str, Any] = parameter({}, text="other gains in the thrust")
    landing: dict[str, Any] = parameter({}, text="other gains after touchdown")

    def gains_of(self, kind: type[Task[Any]], phase: str, shared: Parameters) -> Parameters:
        """The gains of the task ``kind`` in the phases called ``phase``.

        Args:
            shared: the controller's gains for these phases.

        Raises:
            pydantic.ValidationError: a gain that the task does not have, or a wrong value.
        """
        fields = type(shared).model_fields
        values: dict[str, Any] = {
            name: getattr(shared, name) for name in kind.Gains.model_fields if name in fields
        }
        own: Mapping[str, Any] = getattr(self, phase)
        return kind.Gains.model_validate({**values, **self.gains, **own})
