"""Every live parameter of a shipped block makes a difference when it is changed in a run.

That the difference is the right one, the conformance suite checks: after a change a block goes on
as one that had the new value from the start.
"""

import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import zip_longest
from typing import Any

import numpy as np
import pytest

from aloft.blocks.signals import Phase
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.runtime.language.block import Block
from aloft.runtime.language.parameter_change import Adjustment
from aloft.runtime.language.parameters import Parameters, is_live
from aloft.runtime.language.registry import find_block, known_names
from aloft.runtime.running.live_parameters import LiveParameters
from aloft.runtime.testing import BlockBench
from aloft.runtime.testing.conformance import live_changes, random_inputs

TICKS = 150
BEFORE = 3
"""Ticks before the change."""

Inputs = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Scene:
    """Parameters that make the live ones count, and what goes on: by default anything at random."""

    params: Mapping[str, Any] = field(default_factory=dict)
    inputs: Callable[[int], Inputs] | None = None


def jumping(lost: int) -> Callable[[int], Inputs]:
    """Thrust, a flight that contacts end, a teetering stance, and in the end no ground at all."""

    def inputs(tick: int) -> Inputs:
        now, active = 0.002 * tick, np.ones(4, np.bool_)
        if lost <= tick < 60 or tick >= 115:
            active[:] = False
        elif tick >= 90:
            active[0], active[1] = tick >= 95, False
        planned = Phase.THRUST if tick >= 20 else Phase.SQUAT
        heights = np.array([0.05, 0.005, 0.0, 0.0])
        return {
            "reference": {"time": now, "phase": planned, "lift_off_time": 0.1,
                          "touchdown_time": 0.2, "com": [0, 0, 0.3]},
            "contacts": {"active": active},
            "terms": {"com": [0, 0, 0.3], "com_velocity": [0, 0, 0.25],
                      "contact_position": np.outer(heights, [0, 0, 1])},
        }  # fmt: skip

    return inputs


def standing(rate: float, force: float = 9.81) -> Callable[[int], Inputs]:
    """All points on the ground, the base turning slowly."""
    return lambda tick: {
        "imu": {"angular_velocity": [rate, 0, 0], "specific_force": [0.1, 0.05, force]},
        "contacts": {"active": True},
        "joints": {"position": 0.1, "velocity": 0.0},
    }


def landed(tick: int) -> Inputs:
    """On the ground, off it for a moment, and on it again for good."""
    return {**standing(0.01)(tick), "contacts": {"active": not 40 <= tick < 45}}


def flying(tick: int) -> Inputs:
    """A flight of 0.3 s from the first tick on."""
    now = 0.002 * tick
    times = {"time_in_phase": now, "time_to_touchdown": 0.3 - now}
    return {"reference": {"phase": Phase.FLIGHT}, "phase": {"phase": Phase.FLIGHT, **times}}


def landing_on(toes_first: bool, tick: int) -> Inputs:
    """The same flight to a landing on the toes first, or on whole feet."""
    inputs = flying(tick)
    return {**inputs, "reference": {**inputs["reference"], "toes_first": toes_first}}


def beyond_reach(tick: int) -> Inputs:
    """Feet that should be where the tilted robot's legs do not reach."""
    turn = np.array([[0.83, 0.0, 0.56], [0.0, 1.0, 0.0], [-0.56, 0.0, 0.83]])
    place = [-0.27, 0.0, -0.18]
    feet = {"position": [place, place], "rotation": [turn, turn], "velocity": 0.0}
    return {"feet": feet, "reference": {"toes_first": False}}


def displaced(tick: int) -> Inputs:
    """A thrust until 0.3 s, with feet that are off their place behind the first tick."""
    feet = np.full((2, 3), 0.02 if tick else 0.0)
    times = {"time": 0.002 * tick, "lift_off_time": 0.3, "touchdown_time": 0.5}
    return {
        "reference": times, "phase": {"phase": Phase.THRUST}, "terms": {"foot_position": feet}
    }  # fmt: skip


def hopping(tick: int) -> Inputs:
    """In the air for ten ticks, on the ground for ten."""
    phase = {"phase": Phase.FLIGHT, "stance": tick // 10 % 2 == 0, "stepping": False}
    return {"reference": {"phase": Phase.FLIGHT}, "phase": phase}


def tottering(
    *velocity: float, turning: float = 0.0, heels: float = 0.0
) -> Callable[[int], Inputs]:
    """After a touchdown the robot moves so fast that its feet cannot hold it; it stays where it is.

    Its heels are so high above the ground.
    """
    points = np.array(
        [[x, y, z] for y in (-0.076, 0.076) for x, z in ((0.0425, 0.0), (-0.0425, heels))]
    )

    def inputs(tick: int) -> Inputs:
        since = 0.002 * tick
        return {
            "reference": {"time": 2.0, "lift_off_time": 1.0, "touchdown_time": 1.3},
            "terms": {
                "contact_position": points, "foot_position": [[0, -0.076, 0], [0, 0.076, 0]],
                "foot_rotation": [np.eye(3)] * 2, "com": [0, 0, 0.25],
                "com_velocity": [*velocity, 0], "angular_momentum": [turning, turning, 0],
            },
            "before": {
                "phase": Phase.RECOVER if since > 0.1 else Phase.LANDING, "time_in_phase": since,
                "time_since_touchdown": since, "stance": True, "stepping": False,
            },
        }  # fmt: skip

    return inputs


def hanging(tick: int) -> Inputs:
    """One foot has landed, and the other still hangs and moves."""
    moving = 0.1 * np.sin(0.1 * tick + np.arange(12)).reshape(4, 3)
    return {
        "before": {"phase": Phase.LANDING, "stance": np.array([True, True, False, False])},
        "terms": {"contact_velocity": moving},
    }


def loaded(n_velocities: int) -> Callable[[int], Inputs]:
    """The legs bear a load that comes and goes, on soles that turn about their toes and rest at the top."""
    jacobian = np.random.default_rng(3).normal(size=(4, 3, n_velocities))
    bias = jacobian[:, 2].sum(axis=0)

    def inputs(tick: int) -> Inputs:
        heels, speed = 0.01 * (1.0 + np.sin(0.08 * tick)), 0.4 * np.cos(0.08 * tick)
        speed = 0.0 if abs(speed) < 0.15 else speed
        return {
            "phase": {"phase": Phase.LANDING},
            "joints": {"torque": 0.0},
            "switches": {"active": np.array([True, False, True, False])},
            "terms": {
                "contact_jacobian": jacobian,
                "nonlinear_effects": 30.0 * (1.0 + np.sin(0.05 * tick)) * bias,
                "contact_position": np.outer([0.0, heels, 0.0, heels], [0, 0, 1]),
                "contact_velocity": np.outer([0.0, speed, 0.0, speed], [0, 0, 1]),
            },
        }  # fmt: skip

    return inputs


def recovering(tick: int) -> Inputs:
    """Rising from the landing."""
    return {"phase": {"phase": Phase.RECOVER, "time_in_phase": 0.002 * tick}}


def pushed(tick: int) -> Inputs:
    """A flight with more momentum than was planned."""
    momenta = {"linear_momentum": [0.1, 0.2, 0.0], "angular_momentum": [0.02, 0.01, 0.0]}
    inputs = flying(tick)
    return {
        "reference": {
            **inputs["reference"],
            "orientation": [0, 0, 0, 1],
            "com": 0.0,
            "com_velocity": 0.0,
            "angular_momentum": 0.0,
            "foot_position": 0.0,
        },
        "phase": inputs["phase"],
        "terms": {**momenta, "base_rotation": np.eye(3)},
    }


def reacting(tick: int) -> Inputs:
    """The same with legs whose motion turns the torso, which tilts."""
    inputs, rng = pushed(tick), np.random.default_rng(1)
    turned = {"base_rotation": [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]}
    matrices = {
        "centroidal_matrix": rng.normal(size=(6, 16)),
        "contact_jacobian": rng.normal(size=(4, 3, 16)),
    }
    return {**inputs, "terms": {**inputs["terms"], **turned, **matrices}}


def nearly_landed(tick: int) -> Inputs:
    """A plan in flight, 50 ms before its touchdown."""
    return {"reference": {"phase": int(Phase.FLIGHT), "time": 0.35, "touchdown_time": 0.4}}


def landing_late(tick: int) -> Inputs:
    """A plan that flies and lands in turn, followed by a robot that is still in the air."""
    phase = Phase.LANDING if tick % 2 else Phase.FLIGHT
    return {"reference": {"phase": int(phase), "time": 0.002 * tick, "joint_velocity": 1.0}}


def leaning(tick: int) -> Inputs:
    """The same with a torso that tilts the other way."""
    inputs = reacting(tick)
    turned = {"base_rotation": [[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]]}
    return {**inputs, "terms": {**inputs["terms"], **turned}}


def long_legged(tick: int) -> Inputs:
    """The robot reacts and falls slowly, on legs that have stroke to draw up and to stop with."""
    inputs = reacting(tick)
    feet = {"foot_position": [[0.0, 0.08, -0.3], [0.0, -0.08, -0.3]]}
    slow = {"com": 0.0, "com_velocity": [0.0, 0.0, -0.5]}
    return {
        **inputs,
        "reference": {**inputs["reference"], **feet},
        "terms": {**inputs["terms"], **slow},
    }


SCENES: Mapping[str, list[Scene]] = {
    "blocks.CircleTarget": [Scene({"start": 0.0})],
    "hopping.Pad": [Scene({"beat": 1, "ahead": 0.1, "aside": 0.1, "turn": 0.1, "hold_time": 0.2})],
    "blocks.Step": [Scene({"at": 0.1})],
    "blocks.Timer": [Scene({"duration": 0.1}, lambda tick: {"u": {"value": True}})],
    "blocks.PID": [
        Scene({"kd": 0.5, "ki": 2.0}),
        Scene({"ki": 5.0, "lower": -0.2, "upper": 0.2}),
    ],
    "blocks.JointPD": [
        Scene({"flight_stiffness": {"*": 40.0}, "flight_damping": 1.0}, hopping),
        Scene({"stance_targets": "acceleration", "friction": 0.1, "stance_stiffness": 1.0}),
        Scene({"stop_gain": 1.0}, lambda tick: {"joints": {"position": 0.9, "velocity": 1.0}}),
        Scene({}, hopping),
    ],
    "blocks.BalanceTarget": [
        Scene({"trim_limit": 0.01, "trim_rate": 20.0}),
        Scene({"place_gain": 0.5, "place_limit": 0.005}, displaced),
        Scene({"place_gain": 0.5}, displaced),
        Scene({}, recovering),
    ],
    "blocks.LandingHeuristic": [
        Scene({"p_max": (0.1, 0.1)}),
        Scene({}, flying),
        *(Scene({}, partial(landing_on, first)) for first in (False, True)),
        Scene({}, pushed),
        Scene({"law": "predicted"}, reacting),
        Scene({"law": "predicted", "height_range": (0.0, 0.0)}, reacting),
        Scene({"law": "predicted", "height_range": (-0.5, 0.0)}, leaning),
        Scene({"law": "predicted"}, long_legged),
    ],
    "blocks.CaptureStep": [
        Scene({"steps": 1, "after": 0.01, "duration": 0.05, "settle": 0.02}, tottering(-0.8, 0.1)),
        Scene({}, hanging),
        Scene({"steps": 1, "after": 0.01, "reach": 0.02}, tottering(-0.8, 0.1)),
        Scene({"steps": 1, "after": 0.01, "apart": (0.9, 1.1)}, tottering(0.1, 0.8)),
        Scene({"steps": 1, "after": 0.01, "apart": (0.9, 1.1)}, tottering(0.1, -0.8)),
        Scene({"steps": 1, "after": 0.01, "confirmation": 0.05}, tottering(-0.8, 0.0)),
        Scene({"steps": 1, "after": 0.01, "margin": 0.02}, tottering(-0.393, 0.0)),
        *(
            Scene({"steps": 1, "after": 0.01, "turn": 0.9}, tottering(-0.35, 0.0, turning=k))
            for k in np.linspace(-0.3, 0.3, 7)
        ),
        *(
            Scene({"steps": 1, "after": 0.01}, tottering(-0.8, 0.1, heels=heels))
            for heels in (0.0003, 0.00045, 0.00055, 0.0008)
        ),
    ],
    "blocks.FootLoadEstimator": [Scene({}, loaded(16))],
    "blocks.LegInverseKinematics": [
        Scene({"speed_limit": 0.5}),
        Scene({"level": 0.9}),
        Scene({}, beyond_reach),
        Scene({"follow": "plan", "level_time": 0.1}, nearly_landed),
        Scene({"follow": "plan"}, landing_late),
    ],
    "blocks.WholeBodyController": [
        Scene({"force_max": 20.0, "force_min": 1.0}),
        Scene({"tasks": ["ContactPoints", {"task": "Posture", "gains": {"joints": ["*"]}}]}),
        # no force is both, so the solver fails and the last torque fades
        Scene(
            {"force_max": 20.0, "force_min": 50.0, "fallback_ticks": 50},
            lambda tick: {"phase": {"stance": True}, "memory": {"torque": 1.0} if tick < 1 else {}},
        ),
    ],
    "blocks.JumpPhase": [
        Scene({"landing_time": 0.05, "lost_contact": 0.04}, jumping(lost)) for lost in (40, 55)
    ],
    "blocks.ComplementaryFilter": [Scene(), Scene({}, standing(0.01)), Scene({}, standing(0.07))],
    "blocks.StateEstimator": [
        Scene(),
        Scene({}, standing(0.07)),
        Scene({}, standing(1.3)),
        Scene({}, standing(0.01, 2.5)),
        Scene({}, landed),
    ],
    "hal.Push": [Scene({"trigger": "start", "delay": 0.02, "duration": 0.05})],
}


IDLE = {
    "blocks.WholeBodyController": sorted(
        [
            *(f"{phase}.angular_by_size" for phase in ("landing", "stand", "thrust")),
            *(
                f"{phase}.rolling_{name}"
                for phase in ("landing", "stand")
                for name in ("damping", "stiffness", "weight")
            ),
            *(f"{phase}.raised_weight" for phase in ("landing", "stand")),
            "thrust.swing_stiffness",
        ]
    ),
}
"""One set of gains serves all phases: feet roll off and rise only in the thrust, and there none swings down. Weights are
those of BRUCE, so its size changes none."""


def blocks_with_live_parameters() -> Iterator[str]:
    for name in known_names():
        if any(is_live(info) for info in find_block(name).Params.model_fields.values()):
            yield name


def trace(
    kind: type[Block], scene: Scene, params: Parameters, changed: Parameters | None
) -> Iterator[int]:
    """A checksum of all memory after each tick, with a change of parameters on the way."""
    bench = BlockBench(kind, params, robot="bruce")
    live = LiveParameters({"block": bench.block})
    live.compile = compile_calls
    rng = np.random.default_rng(0)
    for tick in range(TICKS):
        if tick == BEFORE and changed is not None:
            live.apply(Adjustment({"block": changed}, ()), tick)
        if tick == 0 or (tick % 7 == 0 and scene.inputs is None):
            for port, fields in random_inputs(kind, bench.block.context.dimensions, rng).items():
                bench.set(port, **fields)
        for port, fields in (scene.inputs(tick) if scene.inputs is not None else {}).items():
            bench.set(port, **fields)
        bench.step()
        yield zlib.crc32(bench.memory.state.buffer, zlib.crc32(bench.memory.bus.buffer))


LONG = ("blocks.WholeBodyController",)
"""What takes seconds: the controller has many parameters, and each makes a controller."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.long if name in LONG else ())
        for name in blocks_with_live_parameters()
    ],
)
def test_every_live_parameter_counts(name: str) -> None:
    kind = find_block(name)
    silent: dict[str, None] | None = None
    for scene in SCENES.get(name, [Scene()]):
        params = kind.Params.model_validate({**kind.example_parameters(), **scene.params})
        plain = list(trace(kind, scene, params, None))
        here = {
            path: None
            for path, changed in live_changes(params)
            if (silent is None or path in silent)
            and all(a == b for a, b in zip_longest(plain, trace(kind, scene, params, changed)))
        }
        silent = here
    assert sorted(silent or {}) == IDLE.get(name, [])
