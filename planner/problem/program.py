"""Program of the formulations ``paper`` and ``srbm``: the grid of a jump of one flight, and how they fill it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...robots.description import RobotDescription
from ..models.exact_dynamics import ExactDynamics, half_steps, states_between
from ..models.robot_model import Stance
from ..models.symbolic_model import SymbolicModel
from ..task.boundary_set import unsupported_keys
from ..task.files import PlanError
from ..task.phase import Phase
from ..task.sequence import PHASES
from ..task.task import JumpTask
from .assembly import Assembly, Knot, NonlinearProgram
from .stage_functions import StageFunction


@dataclass(frozen=True)
class Grid:
    """Intervals of squat, thrust, flight and landing.

    Attributes:
        phases: of every interval.
        steps: the intervals' lengths [s].
        flight: the knots in flight, lift-off to the one before touchdown.
        on_ground: the contact points that bear load in every interval.
    """

    phases: tuple[Phase, ...]
    steps: Array
    flight: range
    on_ground: tuple[tuple[int, ...], ...]

    @property
    def times(self) -> Array:
        """The time of every knot [s]."""
        return np.concatenate([[0.0], np.cumsum(self.steps)])


def uniform_grid(task: JumpTask, robot: RobotDescription, flight_time: float) -> Grid:
    """Return intervals of equal length within every phase, as the paper's fixed dt.

    Raises:
        PlanError: the task asks for what only ``formulation: full`` can do.
    """
    check_supported(task)
    phases, steps, on_ground = list[Phase](), list[Array](), list[tuple[int, ...]]()
    for spec in task.phase_specs():
        phase, count = PHASES[spec.phase], spec.knots or 0
        time = flight_time if phase is Phase.FLIGHT else spec.time or 0.0
        loaded = spec.on_ground(robot)
        if phase is not Phase.FLIGHT and not loaded:
            raise PlanError(
                f"{task.name}: no contact point is on the ground in a phase {spec.phase!r}",
                family="formulation",
            )
        phases += [phase] * count
        steps.append(np.full(count, time / count))
        on_ground += [loaded] * count
    before, flying = phases.index(Phase.FLIGHT), phases.count(Phase.FLIGHT)
    return Grid(
        tuple(phases), np.concatenate(steps), range(before, before + flying), tuple(on_ground)
    )


def check_supported(task: JumpTask) -> None:
    """Raise ``PlanError`` for free times and for every key of the task that the formulation has nothing for."""
    asked = list(unsupported_keys(task))
    if not asked:
        asked = [
            f"{spec.phase}_time: free"
            for spec in task.phase_specs()
            if spec.phase != "flight" and spec.time is None
        ]
    if asked:
        raise PlanError(
            f"{task.name}: formulation {task.formulation!r} plans one flight with given times and "
            f"feet that arrive at rest; it has no {', '.join(asked)}; use formulation: full",
            family="formulation",
        )


def ballistic_flight(task: JumpTask, *, backward_steps: int = 0) -> tuple[float, float]:
    """Return the vertical take-off speed [m/s] and flight time [s] from standing height to standing height.

    ``backward_steps`` is the number of steps of the paper's integration, which falls a little
    faster than the exact parabola: g T^2 (1 + 1/n) / 2.
    """
    fall = 0.5 * GRAVITY * (1.0 + (1.0 / backward_steps if backward_steps else 0.0))
    flight = next(spec for spec in task.phase_specs() if spec.phase == "flight")
    height, time = task.landing_height, flight.time
    if task.rise is not None:
        up = math.sqrt(2.0 * GRAVITY * task.rise)
    elif task.take_off_speed is not None:
        up = task.take_off_speed
    else:
        duration = time or math.sqrt(2.0 * max(0.15, height + 0.1) / GRAVITY) * 2.0
        return height / duration + fall * duration, duration
    if time is None:
        inside = up * up - 4.0 * fall * height
        if inside < 0.0:
            raise PlanError(
                f"{task.name}: the jump does not reach ground that is {height:g} m higher; "
                "ask for a greater rise",
                family="apex",
            )
        time = (up + math.sqrt(inside)) / (2.0 * fall)
    return up, time


def joint_torques(
    dynamics: ExactDynamics, time: Array, position: Array, velocity: Array, force: Array
) -> Array:
    """Return the torques [N m] that a planned motion needs in the middle of its intervals, (N, n_joints), by exact
    inverse dynamics under the planned contact forces (N, n_contacts, 3); zero at impacts.
    """
    torque = np.zeros((len(time), velocity.shape[1] - 6))
    lasting = np.flatnonzero(np.diff(time) > 0.0)
    places, rates = dynamics.follow(half_steps(position, velocity, time, force, lasting))
    half = 0.5 * np.diff(time)[lasting]
    _, _, bend = states_between(position[:, 7:], velocity[:, 6:], time, lasting, half)
    torque[lasting] = dynamics.motion(places[::2], rates[::2], bend, force[lasting]).torque
    torque[-1] = torque[-2]
    return torque


@dataclass(frozen=True)
class SimpleProblem(NonlinearProgram):
    """A problem on a fixed grid, ready to be solved.

    Attributes:
        guess: where the solver begins.
        grid: phases and times of the intervals; in flight by their mean where that is a variable.
        start, end: the stances.
    """

    task: JumpTask
    model: SymbolicModel
    guess: Array
    grid: Grid
    start: Stance
    end: Stance

    def state(self, values: Array, k: int) -> Array:
        """Return the states of a knot."""
        start = self.assembly.state_start[k]
        return values[start : start + self.assembly.nx[k]]

    def control(self, values: Array, k: int) -> Array:
        """Return the controls of a knot."""
        start = self.assembly.control_start[k]
        return values[start : start + self.assembly.nu[k]]


class BoundsBuilder:
    """An assembly's bounds, rows and parameters while they are written; nothing is bound at first."""

    def __init__(
        self,
        knots: Sequence[Knot],
        pieces: Mapping[str, StageFunction],
        sizes: Mapping[str, Mapping[str, int]],
    ) -> None:
        self.assembly = Assembly(knots, pieces)
        self.pieces, self.sizes = pieces, sizes
        variables, rows = self.assembly.variables, self.assembly.constraints
        self.lower, self.upper = np.full(variables, -np.inf), np.full(variables, np.inf)
        self.row_lower, self.row_upper = np.zeros(rows), np.zeros(rows)
        self.families = ["integration"] * rows
        self.parameters = np.zeros(self.assembly.parameters)
        self.guess = np.zeros(variables)

    def rows(self, name: str, k: int, families: list[tuple[str, int, float, float]]) -> None:
        """Set families, numbers and bounds of a piece's kept rows on a knot, in order."""
        start, kept = self.assembly.rows_of(name, k)
        for family, count, low, high in families:
            self.families[start : start + count] = [family] * count
            self.row_lower[start : start + count] = low
            self.row_upper[start : start + count] = high
            start += count
        assert start == self.assembly.rows_of(name, k)[0] + len(kept)

    def set(self, name: str, k: int, **values: Any) -> None:
        """Set the parameters of a piece on a knot."""
        start = self.assembly.parameter_start[name, k]
        for key, size in self.sizes[name].items():
            self.parameters[start : start + size] = values[key]
            start += size

    def fix(self, k: int, family: str, values: Array | list[float]) -> None:
        """Fix a knot's fixed variables at these values."""
        rows = self.assembly.fixed_rows(k)
        self.row_lower[rows] = self.row_upper[rows] = values
        for row in rows:
            self.families[row] = family

    def done(self, task: JumpTask, model: SymbolicModel, grid: Grid, start: Stance, end: Stance
             ) -> SimpleProblem:  # fmt: skip
        """Return the program."""
        return SimpleProblem(
            self.assembly, self.lower, self.upper, self.row_lower, self.row_upper,
            self.parameters, self.families, task, model,
            np.clip(self.guess, self.lower, self.upper), grid, start, end,
        )  # fmt: skip
