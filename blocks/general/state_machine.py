"""Finite-state machines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field as Key

from ...mathematics.arrays import Flags1D, Indices1D
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.block import (
    Block,
    Context,
    Input,
    Output,
    State,
    UnmetRequirement,
)
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .vectors import (
    Flags,
    Seconds,
)


class Transition(Parameters):
    """One way from a state to another."""

    source: str = Key(alias="from", description="the state it leaves")
    to: str = parameter(text="the state it enters")
    when: str | None = parameter(
        None, text="the condition that must hold, or `not` and the condition that must not"
    )
    after: float = parameter(
        0.0, unit="s", ge=0.0, text="least time that the state must have lasted"
    )


class StateName(Signal):
    """The present state."""

    index = Field((), dtype="int64", text="its place in the list of states, from 0")
    value = Field("n_states", dtype="bool", text="one truth value for each state")


class Transitions(NamedTuple):
    """All transitions, those from the first state first."""

    first: Indices1D
    """Place of each state's first transition; one more for the end."""
    target: Indices1D
    """The state that is entered."""
    condition: Indices1D
    """The place of the condition; -1 where there is none."""
    expected: Flags1D
    """Required value of the condition."""
    least_runs: Indices1D
    """Number of runs that the state must have lasted."""


class MachineState(Signal):
    """Memory of a state machine."""

    index = Field((), dtype="int64", text="the present state")
    runs = Field((), dtype="int64", text="runs that have passed since it was entered")


class StateMachine(Block):
    """A finite-state machine: ``states``, of which the first is the initial one, and transitions.

    In every run the transitions from the present state are tried in the order they are written, and
    the first whose condition holds and whose time has come is taken, at most one in a run. The
    outputs show the state after it::

        states: [idle, running]
        conditions: [start, stop]          # the names of u's elements
        transitions:
          - {from: idle, to: running, when: start}
          - {from: running, to: idle, when: stop, after: 0.5 s}
    """

    class Params(Parameters):
        states: list[str] = parameter(text="the names of all states", min_length=1)
        conditions: list[str] = parameter(
            text="the names of the input's elements, in order", min_length=1
        )
        transitions: list[Transition] = parameter(text="the ways between states")

    params: Params
    u = Input(Flags, text="the conditions")
    state = Output(StateName, text="the present state")
    elapsed = Output(Seconds, text="duration of the state so far")
    x = State(MachineState, text="the present state")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` conditions and ``n_states``."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.conditions), "n_states": len(params.states)}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Every name of a transition must be one of a state or of a condition."""
        assert isinstance(params, cls.Params)
        for key, names in (("states", params.states), ("conditions", params.conditions)):
            for name in dict.fromkeys(name for name in names if names.count(name) > 1):
                yield UnmetRequirement(f"{name!r} is twice in {key}", parameter=key)
        for transition in params.transitions:
            for state in (transition.source, transition.to):
                if state not in params.states:
                    yield _unknown("state", state, params.states)
            if transition.when is not None:
                name = transition.when.removeprefix("not ").strip()
                if name not in params.conditions:
                    yield _unknown("condition", name, params.conditions)

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two states and two conditions."""
        return {
            "states": ["idle", "running"],
            "conditions": ["start", "stop"],
            "transitions": [
                {"from": "idle", "to": "running", "when": "start"},
                {"from": "running", "to": "idle", "when": "not stop", "after": 0.004},
            ],
        }

    def setup(self) -> None:
        p = self.params
        ways = sorted(
            p.transitions, key=lambda way: p.states.index(way.source)
        )  # keeps their order
        names = [(way.when or "").removeprefix("not ").strip() for way in ways]
        self.transitions = Transitions(
            np.searchsorted(
                [p.states.index(way.source) for way in ways], np.arange(len(p.states) + 1)
            ),
            np.array([p.states.index(way.to) for way in ways], np.int64),
            np.array([p.conditions.index(name) if name else -1 for name in names], np.int64),
            np.array([not (way.when or "").startswith("not ") for way in ways], bool),
            np.array([np.ceil(way.after / self.period - 1e-6) for way in ways], np.int64),
        )

    @kernel
    @staticmethod
    def step(
        u: Flags,
        state: StateName,
        elapsed: Seconds,
        x: MachineState,
        transitions: Transitions,
        period: float,
    ) -> None:
        before = x.index
        for k in range(transitions.first[before], transitions.first[before + 1]):
            condition = transitions.condition[k]
            holds = condition < 0 or u.value[condition] == transitions.expected[k]
            if holds and x.runs >= transitions.least_runs[k]:
                x.index = transitions.target[k]
                x.runs = 0
                break
        for k in range(state.value.shape[0]):
            state.value[k] = k == x.index
        state.index = x.index
        elapsed.value[0] = x.runs * period
        x.runs += 1


def _unknown(kind: str, name: str, known: list[str]) -> UnmetRequirement:
    return UnmetRequirement(
        f"there is no {kind} {name!r}",
        parameter="transitions",
        expected=", ".join(known),
        found=name,
    )
