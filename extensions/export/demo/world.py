"""Writes a whole graph, with its simulated robot, for a page in a browser.

All kernels of the graph become one module of WebAssembly: those of its blocks as its ``step``, and beside
that those of the simulated robot. What the robot calls of MuJoCo and of NumPy's random numbers, the page calls
of MuJoCo's own WebAssembly and of a generator of its own. So a page has the sensors, drives and
disturbances of a trial, and the score, from the same source as a run in Python.
"""

from __future__ import annotations

import ctypes
import json
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mujoco import MjModel
from numpy.typing import NDArray

from aloft.extensions.export.clib.cut import Cut
from aloft.extensions.export.clib.module import Module
from aloft.extensions.export.clib.part import NeedsPython, SubGraph, needs_python
from aloft.extensions.export.clib.targets import TARGETS, compile_module, link
from aloft.hal.simulated.mujoco_model import body_name, mujoco_spec
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.simulated.plant import Plant
from aloft.mathematics.compiling.foreign_call import ForeignCall
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.planner.task.phase import Phase
from aloft.robots.surfaces import robot_surfaces
from aloft.runtime.loading.checked import checked_file
from aloft.runtime.running.memory import BoundGraph

TO_MUJOCO, FROM_MUJOCO = (
    ("ctrl", "xfrc_applied"),
    ("qpos", "qvel", "sensordata", "site_xpos", "xipos"),
)
"""Arrays copied to the simulator before a step, and from it after each part of one."""
MODEL = ("body_mass", "body_inertia", "body_ipos", "geom_friction", "geom_solref", "geom_solimp")
"""Arrays of the simulator's model that a trial's seed changes; MJCF holds them with six digits
only."""
ARRAYS = {
    "phase": "step.phase.phase", "push": "push.push.force", "blow": "push.constants.force",
    "points": "robot.truth.contact_position", "forces": "robot.truth.contact_force",
    "com": "robot.truth.com", "momentum": "robot.truth.angular_momentum",
    "torque": "robot.truth.motor_torque", "planned": "plan.reference.com",
    "places": "landing.feet.landing", "fallen": "score.record.fall_time",
    "forbidden": "score.record.forbidden", "tilt": "score.record.peak_tilt",
    "bus": "", "state": "",
}  # fmt: skip
"""Arrays that a page shows or changes, by block, port or state, and field; and the whole memory of
the graph."""


class World(NamedTuple):
    """A graph whose robot, drawn by a seed, stands, and its module; ``programs`` are the calls of the robot
    in a tick: functions of the module, functions of the simulator ``{call, flags, arguments, when}``, and draws
    ``[kind, place, count]``. ``flags`` say what the model of the call leaves out, and ``when`` is the place of a
    word that leaves the call out where it is zero."""

    bound: BoundGraph
    module: Module
    arrays: dict[str, NDArray[Any]]
    programs: dict[str, list[Any]]

    @property
    def plant(self) -> Plant:
        """The simulated robot without its ports."""
        robot = self.bound.blocks["robot"]
        assert isinstance(robot, MujocoRobot)
        return robot.plant

    def image(self) -> bytearray:
        """Return the bytes of an instance."""
        return self.module.image.bytes_of(constant=False)


def make_world(graph_file: Path, overrides: Sequence[str], name: str) -> World:
    """Load a graph, let its robot stand, and translate it.

    Raises:
        LoadError: the graph may not run.
        NeedsPython: blocks beside the robot need Python, or the robot calls Python in a step.
        StartError: the robot does not stand.
    """
    graph = checked_file(graph_file, overrides)
    bound = BoundGraph(graph)
    blocks = tuple(path for path in graph.order if path != "robot")
    reasons = [
        f"{graph.file}: block '{path}' {why}"
        for path in blocks
        for why in needs_python(bound.blocks[path])
    ]
    if reasons:
        raise NeedsPython(reasons)
    for path in graph.order:
        bound.blocks[path].start()
    robot = bound.blocks["robot"]
    assert isinstance(robot, MujocoRobot)
    plant = robot.plant
    functions: dict[str, Sequence[KernelCall]] = {}
    names: dict[tuple[int, ...], str] = {}
    programs: dict[str, list[Any]] = {}
    for key, calls in robot.calls.items():
        programs[key] = []
        for kind, group in groupby(calls, type):
            if kind is ForeignCall:
                programs[key] += group
                continue
            made = list(group)
            function = names.setdefault(tuple(map(id, made)), f"part{len(names)}")
            functions[function] = made
            programs[key].append(function)
    data = plant.data
    visible = [getattr(data, field) for field in (*TO_MUJOCO, *FROM_MUJOCO)]
    foreign = [c for program in programs.values() for c in program if isinstance(c, ForeignCall)]
    steps = {id(call) for call in foreign if _of_simulator(call)}
    drawing = [call for call in foreign if id(call) not in steps]
    if not all(call.words[3] for call in drawing):  # the address of what is drawn
        raise NeedsPython([f"{graph.file}: block 'robot' calls Python in a step of its simulator"])
    draws = {id(call): _drawn(call) for call in drawing}
    whens = [call.when for call in foreign if call.when is not None]
    memory = bound.memory
    whole = {"bus": memory.bus.buffer, "state": memory.state.buffer}
    arrays = {key: whole[key] if key in whole else _array(bound, at) for key, at in ARRAYS.items()}
    assert graph.resolved is not None
    part = SubGraph(Cut(graph.resolved, "", (), (), graph, ()), graph, bound, blocks, (), ())
    module = Module(
        name, part, 1, {}, functions, [*visible, *arrays.values(), *draws.values(), *whens]
    )

    def told(each: str | ForeignCall) -> Any:
        if isinstance(each, str):
            return each
        if id(each) in steps:
            when = None if each.when is None else module.image.place(each.when)[1]
            model, _, *more = each.run.args
            flags = model.opt.disableflags
            return {"call": each.run.func.__name__, "flags": flags, "arguments": more, "when": when}
        kind = "normal" if isinstance(each.run, partial) else "uniform"  # of `random_streams`
        array = draws[id(each)]
        return [kind, module.image.place(array)[1], array.size]

    return World(
        bound, module, arrays,
        {key: [told(each) for each in program] for key, program in programs.items()},
    )  # fmt: skip


def _array(bound: BoundGraph, place: str) -> NDArray[Any]:
    """Return the memory of a field, by block, port or state, and field."""
    block, *names = place.split(".")
    found: Any = bound.blocks[block]
    for name in names:
        found = getattr(found, name)
    return np.asarray(found)


def _of_simulator(call: ForeignCall) -> bool:
    """Say whether a call is one of MuJoCo's functions of a model and its data."""
    return (
        isinstance(call.run, partial)
        and len(call.run.args) > 1
        and isinstance(call.run.args[0], MjModel)
    )


def _drawn(call: ForeignCall) -> NDArray[np.float64]:
    """Return the memory into which a call draws random numbers."""
    size, address = int(call.words[2]), int(call.words[3])
    return np.ctypeslib.as_array((ctypes.c_double * size).from_address(address))


def write_world(
    graph_file: Path, overrides: Sequence[str], seeds: Sequence[int], to: Path, name: str
) -> Mapping[str, Any]:
    """Write ``NAME.wasm``, and ``NAME.json`` with all that a page needs besides.

    Args:
        seeds: of the robots that a page may choose from.
    """
    base = make_world(graph_file, [*overrides, f"robot.seed={seeds[0]}"], name)
    module = base.module
    (to / f"{name}.o").write_bytes(compile_module(module.text(), TARGETS["wasm"]))
    link(name, to, TARGETS["wasm"])
    (to / f"{name}.o").unlink()
    first = np.frombuffer(bytes(base.image()), np.int64)
    robots = []
    for seed in seeds:
        world = make_world(graph_file, [*overrides, f"robot.seed={seed}"], name)
        assert world.programs == base.programs
        image = np.frombuffer(bytes(world.image()), np.int64)
        model = {field: getattr(world.plant.model, field).ravel().tolist() for field in MODEL}
        world.plant.save()
        robots.append({
            "seed": seed, "model": model, "state": world.plant.physics.integration.tolist(),
            "words": [[int(k), str(image[k])] for k in np.flatnonzero(image != first)],
        })  # fmt: skip
    about = {
        "name": name, "size": module.image.size, "period": base.bound.graph.base_period,
        "programs": base.programs, "robots": robots, "xml": _xml(base),
        "to": _places(base, TO_MUJOCO), "from": _places(base, FROM_MUJOCO),
        "arrays": {
            key: [module.image.place(array)[1], str(array.dtype), array.size]
            for key, array in base.arrays.items()
        },
        "looks": _looks(base), "phases": {int(each): each.name.lower() for each in Phase},
    }  # fmt: skip
    (to / f"{name}.json").write_text(json.dumps(about), encoding="utf-8")
    return about


def _looks(world: World) -> list[dict[str, Any]]:
    """Return the surfaces of the robot's links: the body, corners [m, its frame], triangles, colour
    0xRRGGBB."""
    return [
        {"body": body_name(link), "corners": part.corners.round(4).ravel().tolist(),
         "triangles": part.triangles.ravel().tolist(), "color": part.color}
        for link, parts in robot_surfaces(world.plant._robot).links.items()
        for part in parts
    ]  # fmt: skip


def _places(world: World, fields: Sequence[str]) -> dict[str, list[int]]:
    """Return the place of each array of the simulator in an instance, and its size."""
    arrays = {field: getattr(world.plant.data, field) for field in fields}
    place = world.module.image.place
    return {field: [place(array)[1], array.size] for field, array in arrays.items()}


def _xml(world: World) -> str:
    """Return the simulator's model as MJCF."""
    plant = world.plant
    spec = mujoco_spec(
        plant._robot, scene=plant._params.build_scene(plant._robot), timestep=plant._params.timestep,
        variation=plant.variation,
    )  # fmt: skip
    spec.compile()
    model = plant.model
    for signature in model.exclude_signature:
        first, second = (model.body(int(k)).name for k in (signature >> 16, signature & 0xFFFF))
        spec.add_exclude(bodyname1=first, bodyname2=second)
    spec.option.disableflags = int(model.opt.disableflags)
    spec.compile()
    return str(spec.to_xml())
