"""States of recorded jumps, and random programs made from them, for solvers to agree on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ...blocks.control.whole_body_controller import WholeBodyController
from ...mathematics.arrays import Array, Flags
from ...mathematics.whole_body_qp import RigidBodyTerms, TaskRows
from ...runtime.graph import load
from ...runtime.loading.reading.files import FOLDER
from ...runtime.running.executor import Executor
from ...runtime.running.memory import BoundGraph

GRAPH = FOLDER / "jump.yaml"
SEED = 7001
"""The seed of the recorded jumps; the next ones follow it."""
JUMPS: dict[str, dict[str, Any]] = {
    "as shipped": {},
    "slipping": {"robot.friction": 0.35, "wbc.friction": 0.1},
    "torque-limited": {"wbc.torque_margin": 0.35},
    "turning": {"plan.task": "tasks/twist_30deg.yaml"},
    "aside": {"plan.task": "tasks/side_10cm.yaml"},
}
"""The jumps whose states are used, and what differs from ``graphs/jump.yaml``."""
STANCES = (None, (True, True, False, False), (False, False, False, True))
"""Points in stance that each state is solved with: the recorded ones, one foot, and one point."""


class State(NamedTuple):
    """What a controller had in a tick, and what may differ from its parameters.

    ``peak`` (n_joints,) are the motors' peak torques [N m], ``friction``, ``force_min`` and ``force_max`` [N] the
    limits of the forces.
    """

    rows: TaskRows
    model: RigidBodyTerms
    stance: Flags
    velocity: Array
    peak: Array
    friction: float
    force_min: float
    force_max: float


def recorded_states(
    overrides: dict[str, Any], duration: float | None = None, every: int = 1
) -> tuple[WholeBodyController, list[State]]:
    """The controller of a jump that is over, and its states in ticks with a point in stance.

    Raises:
        RunError: the jump failed.
    """
    graph = load(GRAPH, overrides).checked
    bound = BoundGraph(graph)
    (block,) = (b for b in bound.blocks.values() if isinstance(b, WholeBodyController))
    found: list[State] = []
    step: Callable[[], None] = block.step

    def watched() -> None:
        step()
        if block.phase.stance.any() and bound.clock.tick % every == 0:
            found.append(present_state(block))

    block.step = watched  # type: ignore[method-assign]  # a recorder in its place
    ticks = None if duration is None else round(duration * graph.base_rate)
    Executor(bound, log=False, fuse=False).run(ticks).raise_if_failed()
    return block, found


def present_state(block: WholeBodyController) -> State:
    """The state that a controller has now."""
    w = block._weights
    return State(
        TaskRows(*(array.copy() for array in block._rows)),
        RigidBodyTerms(*(array.copy() for array in block._model)),
        block.phase.stance.copy(),
        block.joints.velocity.copy(),
        block._motors.curves.peak.copy(),
        float(w.friction[0]),
        float(w.force_min[0]),
        float(w.force_max[0]),
    )


def show_state(block: WholeBodyController, state: State) -> None:
    """Write a state into the memory of a controller whose graph does not run."""
    pairs: list[tuple[Array, Any]] = [
        *zip(block._rows, state.rows, strict=True),
        *zip(block._model, state.model, strict=True),
        (block.phase.stance, state.stance),
        (block.joints.velocity, state.velocity),
        (block._motors.curves.peak, state.peak),
        (block._weights.friction, state.friction),
        (block._weights.force_min, state.force_min),
        (block._weights.force_max, state.force_max),
    ]
    for array, values in pairs:
        array.setflags(write=True)  # inputs are read-only for the block itself
        array[...] = values


def random_states(states: list[State], count: int, seed: int) -> Iterator[State]:
    """So many programs made from recorded ones: other points in stance, tasks that ask for up to ten
    times as much with other weights, other speeds, friction and limits.

    One in fifty has no solution: its forces must be larger than they may be. Otherwise there is always one,
    because tasks are no constraints.
    """
    random = np.random.default_rng(seed)
    for _ in range(count):
        state = states[int(random.integers(len(states)))]
        stance = random.random(len(state.stance)) < 0.6
        stance[random.integers(len(stance))] = True
        rows = TaskRows(*(array.copy() for array in state.rows))
        size = 10.0 ** random.uniform(-1.0, 1.0)
        rows.desired[:] += (
            size * np.abs(rows.desired).mean() * random.standard_normal(len(rows.desired))
        )
        rows.weights[:] *= 10.0 ** random.uniform(-1.0, 1.0, len(rows.weights))
        least = float(random.choice([0.0, 0.0, 0.0, 1.0, 10.0, 60.0]))
        yield State(
            rows,
            state.model,
            stance,
            state.velocity + random.normal(0.0, 3.0, len(state.velocity)),
            state.peak * random.uniform(0.15, 1.0),
            random.uniform(0.1, 1.0),
            least,
            least + (float(random.uniform(20.0, 400.0)) if random.random() > 0.02 else -1.0),
        )
