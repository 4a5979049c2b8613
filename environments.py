"""A graph as a Gymnasium environment (extra ``gym``).

::

    env = aloft.environments.make(
        "cart_pole.yaml",
        action="force",                       # a block blocks.External
        observation=["robot.joints.position", "robot.joints.velocity"],  # fields, or whole signals
        reward="score.y",                     # a signal of one number, or a function of the run
        action_limits=(-10.0, 10.0),
        ticks=5,
    )

An episode begins at the graph's start. ``reset(seed=k)`` gives every parameter called ``seed`` the
value k; without it episodes have seeds that are drawn from the environment's own generator. A block
that asks for the end of the run terminates the episode, also in the last tick, and the graph's duration
truncates it. An action that is outside its limits by a rounding to 32 bits is taken for the limit; one
farther outside, and a step of an episode that is over, are errors. Observation and reward are those of the
last tick of a step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np

from .files.pip_line import pip_line
from .mathematics.arrays import Array
from .runtime.graph import Graph, load
from .runtime.language.errors import AloftError
from .runtime.language.signals import Signal
from .runtime.running.stepping import SteppedRun

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"aloft.environments needs Gymnasium: {pip_line('gym')}") from error

Reward = str | Callable[[SteppedRun], float]
_MOST_SEEDS = 2**31
ROUNDING = 1e-6
"""Share of the largest of the limits' sizes and their distance by which an action may be outside of them: 32 bits
keep 6e-8, and wrappers that scale actions lose some of it."""


class GraphEnvironment(gymnasium.Env[Array, Array]):
    """An environment that steps one graph; ``make`` makes it."""

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        graph: Graph,
        action: str,
        observation: Sequence[str],
        reward: Reward,
        action_limits: tuple[Any, Any],
        normalised: bool,
        ticks: int,
    ) -> None:
        self.graph = graph
        self._action = action
        self._observed = tuple(observation)
        self._reward = reward
        self._ticks = ticks
        self._seeded = bool(graph.seed_parameters)
        self._run: SteppedRun | None = None
        run = self._open(0 if self._seeded else None)
        shape = run[f"{action}.y.value"].shape
        low, high = (np.broadcast_to(np.asarray(a, np.float64), shape) for a in action_limits)
        if normalised and not np.isfinite([low, high]).all():
            raise AloftError("normalised actions need finite action_limits")
        self._normalised = normalised
        self._middle, self._half = 0.5 * (low + high), 0.5 * (high - low)
        if normalised:
            low, high = -np.ones(shape), np.ones(shape)
        self.action_space = gymnasium.spaces.Box(low.copy(), high.copy(), dtype=np.float64)
        self._over = ""
        size = self._observation().shape
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, size, np.float64)
        self._reward_now()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; see the module's text. The first observation is that of tick 0."""
        super().reset(seed=seed)
        if self._seeded:
            chosen = seed if seed is not None else int(self.np_random.integers(_MOST_SEEDS))
            self._open(chosen % _MOST_SEEDS)
        elif self._run is None:
            self._open(None)
        else:
            self._run.reset()
        run = self._running()
        self._over = ""
        run.step()
        return self._observation(), {"time": run.time}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Set the action, run some ticks, and return observation, reward, terminated, truncated.

        Raises:
            AloftError: the episode is over, or the action is outside ``action_space``.
        """
        run = self._running()
        if self._over:
            raise AloftError(f"the episode is over ({self._over}); call reset()")
        run[self._action] = self._checked(action)
        run.step(self._ticks)
        over = run.graph.ticks is not None and run.tick >= run.graph.ticks
        terminated = run.stopped  # a fall in the last tick is no success
        info = {"time": run.time, **({"reason": run.reason} if run.reason else {})}
        if terminated or over:
            self._over = run.reason or "the duration is over"
        truncated = over and not terminated
        return self._observation(), self._reward_now(), terminated, truncated, info

    def close(self) -> None:
        """Close the graph's blocks."""
        if self._run is not None:
            self._run.close()
            self._run = None

    def _open(self, seed: int | None) -> SteppedRun:
        self.close()
        self._run = self.graph.open(seed=seed)
        return self._run

    def _checked(self, action: Array) -> Array:
        """Return the graph's action, (n,), of one in ``action_space``."""
        space, given = self.action_space, np.asarray(action, np.float64)
        assert isinstance(space, gymnasium.spaces.Box)
        if given.shape != space.shape:
            raise AloftError(f"an action has the shape {space.shape}, not {given.shape}")
        low, high = space.low, space.high
        size = np.max([np.abs(low), np.abs(high), high - low], axis=0)
        rounding = np.where(np.isfinite(size), ROUNDING * size, 0.0)
        outside = ~((given >= low - rounding) & (given <= high + rounding))
        if outside.any():
            k = int(np.flatnonzero(outside)[0])
            raise AloftError(
                f"element {k} of the action is {given.flat[k]:g}, outside of its limits "
                f"{space.low.flat[k]:g} to {space.high.flat[k]:g}; clip it, or set action_limits"
            )
        given = np.clip(given, low, high)
        return self._middle + self._half * given if self._normalised else given

    def _running(self) -> SteppedRun:
        if self._run is None:
            raise AloftError("this environment is closed; call reset()")
        return self._run

    def _observation(self) -> Array:
        run = self._running()
        parts = [each for name in self._observed for each in _numbers(run, name)]
        return np.concatenate(parts)

    def _reward_now(self) -> float:
        run = self._running()
        if not isinstance(self._reward, str):
            return float(self._reward(run))
        value = np.concatenate(_numbers(run, self._reward))
        if value.size != 1:
            raise AloftError(f"the reward {self._reward} has {value.size} numbers, expected one")
        return float(value[0])


def _numbers(run: SteppedRun, name: str) -> list[Array]:
    """Return the numbers of a field, or of all fields of a signal, each as a vector."""
    found = run[name]
    fields = found.views().values() if isinstance(found, Signal) else (found,)
    return [np.asarray(field, np.float64).ravel() for field in fields]


def make(
    graph: str | PathLike[str] | Mapping[str, Any] | Graph,
    *,
    action: str,
    observation: str | Sequence[str],
    reward: Reward,
    action_limits: tuple[Any, Any] = (-1.0, 1.0),
    normalised: bool = False,
    ticks: int = 1,
) -> GraphEnvironment:
    """Make an environment of a graph. Many may live in one process.

    Args:
        graph: a graph, or whatever ``aloft.load`` takes.
        action: the path of a block ``blocks.External``.
        observation: fields, ``block.port.field``, or signals with all their fields, ``block.port``; their
            numbers follow each other.
        reward: a field or a signal with one number, or a function of the run.
        action_limits: the least and the greatest action, each a number or one for every element.
        normalised: actions are -1 to 1, and stand for the least to the greatest.
        ticks: how many ticks of the graph a step is.

    Raises:
        LoadError: the graph may not run.
        KeyError: there is no such signal.
        AloftError: the action's block is not there, or a number makes no sense.
    """
    loaded = graph if isinstance(graph, Graph) else load(graph)
    found = [spec for spec in loaded.checked.blocks if spec.path == action]
    if not found or found[0].block_type.__name__ != "External":
        raise AloftError(f"the action {action!r} is no block blocks.External of the graph")
    if ticks < 1:
        raise AloftError(f"a step is at least 1 tick, not {ticks}")
    observed = (observation,) if isinstance(observation, str) else tuple(observation)
    if not observed:
        raise AloftError("an environment needs at least one observation")
    return GraphEnvironment(loaded, action, observed, reward, action_limits, normalised, ticks)
