"""Every kernel compiles as it stands and computes the same.

The arguments are those of a real jump, as the blocks give them, and the same again with all numbers
of the arrays replaced at random, which takes other branches. Where a kernel only adds, multiplies,
divides and takes roots, results are equal to the last bit.
"""

import ast
import ctypes
import importlib
import linecache
import math
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.blocks.signals import Phase
from aloft.mathematics import arrays
from aloft.mathematics.compiling.arguments import pack, type_of
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.compiling.kernel_registry import is_kernel, kernels, written_code
from aloft.mathematics.compiling.machine_code import MachineCode
from aloft.mathematics.compiling.translate import Translator
from aloft.mathematics.kernel import expand, kernel
from aloft.robots.description import find_robot
from aloft.runtime.language import steps
from aloft.runtime.language.extensions import own_extensions
from aloft.runtime.language.registry import find_block, known_names
from aloft.runtime.testing.bench import BlockBench
from aloft.runtime.testing.conformance import random_inputs, unmet_messages

from . import kernel_samples
from .hal.sensors.mounting import bruce_with

ROOT = Path(__file__).parent.parent
ROOMS = (
    "mathematics",
    "blocks",
    "hal",
    "extensions/hopping/blocks",
    "extensions/commissioning/blocks",
    "extensions/export/blocks",
)
HOT = [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]
PLAIN = {"Array", "Flags", "Indices", "float", "int", "bool", *vars(arrays)} - {"Any"}
NOT_HOT = {
    "blocks.estimation.gross_errors.axes_look_like": "for the text of a fault, once",
    "blocks.estimation.gross_errors.gravity_looks_like": "for the text of a fault, once",
    "blocks.estimation.gross_errors.looks_like": "for the text of a fault, once",
    "blocks.estimation.gross_errors.push_looks_like": "for the text of a fault, once",
    "blocks.estimation.gross_errors.vector_text": "for the text of a fault, once",
    "blocks.general.table_playback._sides": "before a run, when the table is read",
    "hal.log.columns.at_times": "before a run, when the log is read",
    "hal.log.columns.last_rows": "before a run, when the log is read",
    "hal.log.columns.mean_over": "before a run, when the log is read",
    "hal.log.columns.repeats_of": "before a run, when the log is read",
    "hal.log.columns.rows_to_keep": "before a run, when the log is read",
    "hal.log.columns.usual_step": "before a run, when the log is read",
    "hal.log.columns.with_hysteresis": "before a run, when the log is read",
    "hal.log.joint_columns._times": "before a run, when the log is read",
    "hal.log.log_file._no_column": "before a run, when the log is read",
    "hal.log.turns.quaternion_of_rpy": "before a run, when the log is read",
    "hal.log.turns.rates_of": "before a run, when the log is read",
    "hal.log.turns.rotation_of": "before a run, when the log is read",
    "hal.log.turns.rotation_of_rpy": "before a run, when the log is read",
    "hal.log.warned_log._share": "before a run, when the log is read",
    "mathematics.compiling.foreign_call._caller_module": "makes a module of LLVM's language",
    "mathematics.compiling.lanes._all_lanes": "of a constant, in the code that is made",
    "mathematics.compiling.numpy_numbers.demand": "its name stands for a test that the compiler writes",
    "mathematics.rotations.cross_products": "of whole trajectories and logs, outside the loop",
    "mathematics.quadratic_program._sparse": "for solvers of other packages, in plain Python",
    "mathematics.ticks.all_in_ticks": "of a table, in setup",
    "blocks.signals.robot.drive_conditions": "of an error byte, for people",
    "blocks.signals.robot.describe_conditions": "of an error byte, for people",
    "blocks.signals.robot.is_critical": "of an error byte, by integer arithmetic",
    "hal.simulated.start_check._millimetres": "for the text of an error, before a run",
    "hal.simulated.mujoco_robot._is_whole": "when a graph is loaded",
    "hal.simulated.mujoco_robot._nearest_step": "for the text of an error, when a graph is loaded",
    "hal.bear.measurement._first_lasting": "of plain numbers, in the driver's own Python",
    "hal.bear.bus.is_answer": "of a byte, in the driver's own Python",
    "mathematics.rotations.matrices_of_quaternions": "of many rows, outside of ticks",
    "mathematics.rotations.quaternions_of_matrices": "of many rows, outside of ticks",
    "mathematics.linear_algebra.inverse": "before a run, when tables are made",
    "mathematics.linear_algebra.product": "before a run, when tables are made",
    "mathematics.compiling.expressions.cross": "stands for loops in an equation",
    "mathematics.compiling.chain_code.rows_of": "a view, when calls are bound",
    "mathematics.compiling.foreign_call._caller": "makes machine code, when calls are bound",
    "mathematics.compiling.compile_calls._tell": "says how far compiling is, before a run",
    "mathematics.body_dynamics.inertias": "memory, when a block is set up",
    "mathematics.body_dynamics.body_motion": "memory, when a block is set up",
    "mathematics.whole_body_motion.motion_memory": "memory, before plans are checked",
    "mathematics.active_set.active_set_memory": "memory, when a block is set up",
    "mathematics.landing_law.flight_map": "memory, when a block is set up",
    "blocks.control.leg_tracking.limb_memory": "memory, when a block is set up",
    "mathematics.whole_body_reduction.reduction_memory": "memory, when a block is set up",
    "mathematics.whole_body_reduction.equality_program": "memory, when a block is set up",
    "mathematics.whole_body_solution.active_set_program": "memory, when a block is set up",
    "mathematics.quadratic_program.cone_rows": "of the program that Clarabel gets",
    "mathematics.whole_body_cones.cone_memory": "memory, when a block is set up",
    "hal.bear.configuration.imu_rotation_of": "when a file of the hardware is written",
    "hal.simulated.scenes.step": "makes a scene, when a run is loaded",
    "hal.simulated.scenes.platform": "makes a scene, when a run is loaded",
    "hal.simulated.scenes.check_slope": "checks a scene, when a graph is loaded",
    "hal.simulated.stance._solve_positive": "before a run, by MuJoCo's linear algebra",
    "hal.simulated.stance._two_digits": "before a run, of the holding gains",
    "hal.simulated.stance._solve_normal": "before a run, by MuJoCo's linear algebra",
}
"""Functions of numbers and arrays only that need not compile, and why."""

INEXACT = {"dot"}
"""What another order of sums may round differently."""

SAMPLES = 6
EVERY = 211
"""Of a kernel's calls the first and then every so many are kept, up to so many samples."""


SENSORS = {
    "imu": False,
    "chest": {"kind": "imu", "link": "torso"},
    "sole": {"kind": "force_torque", "link": "left_foot", "position": [0.0075, 0.0, -0.024]},
}
"""Sensors of a robot that has none of those that every robot may have."""


PYTHON = {bool, int, float}
"""Other numbers, such as those of an enumeration, are made plain ones."""

UNUSED = kernel_samples.UNUSED | {
    name: arguments
    for each in own_extensions().values()
    if (each.folder / "tests" / "kernel_samples.py").is_file()
    for name, arguments in import_module(
        f"extensions.{each.name}.tests.kernel_samples"
    ).SAMPLES.items()
}
"""Arguments of the kernels that a jump does not call, those of extensions, too."""


def copy(arguments):
    """The same arguments in arrays of the same memory order; named numbers as plain ones."""

    def one(a):
        if isinstance(a, tuple):  # a record of arrays and numbers
            return type(a)(*(one(part) for part in a))
        if isinstance(a, np.ndarray):
            return a.copy(order="K")
        return a if type(a) in PYTHON else int(a)

    return tuple(one(a) for a in arguments)


def leaves(arguments):
    """The arrays and numbers of arguments, also those in records."""
    for a in arguments:
        yield from leaves(a) if isinstance(a, tuple) else (a,)


def load_all():
    for path in HOT:
        importlib.import_module(".".join(("aloft", *path.relative_to(ROOT).with_suffix("").parts)))


FAULTS = {
    "faults.gyro": {"on": "robot.imu.angular_velocity[1]", "kind": "stuck", "value": 0.0},
    "faults.lost": {"on": "robot.joints", "kind": "lost", "share": 0.3, "when": "phase.phase == STAND"},
    "faults.drift": {"on": "robot.imu.specific_force", "kind": "drifting", "value": 0.1},
    "faults.flip": {"on": "robot.command.torque", "kind": "flipped", "bit": 3, "share": 0.5},
    "faults.chirp": {"on": "robot.joints.velocity", "kind": "chirp", "value": 0.01, "low": 5.0, "high": 50.0},
}  # fmt: skip


def run_jump(changes=None, duration=None, graph="jump.yaml"):
    """A jump, or its first part; whether it would succeed does not matter."""
    result = aloft.load(ROOT / "graphs" / graph, changes or {}).run(duration=duration)
    assert result.error is None, result.error


def run_alone(name, robot, **parameters):
    """Some ticks of a block on a bench, with its example parameters, these others, and inputs."""
    block = find_block(name)
    if unmet_messages(block, robot=robot):
        return
    chosen = {**block.example_parameters(), **parameters}
    bench = BlockBench(block, chosen, robot=robot, plain=True)
    random = np.random.default_rng(0)
    for _ in range(4):
        inputs = random_inputs(type(bench.block), bench.block.context.dimensions, random)
        for port, fields in inputs.items():
            bench.set(port, **fields)
        bench.step()
    bench.close()


def steer_alone():
    """A jump that is commanded, and its judgement, without a planner."""
    bruce = find_robot("bruce")
    plan = BlockBench(
        find_block("hopping.SteeredPlan"), {"settle_time": 0.001}, robot=bruce, plain=True
    )
    score = BlockBench(find_block("hopping.CourseScore"), robot=bruce, plain=True)
    plan.set("terms", foot_rotation=np.tile(np.eye(3), (2, 1, 1)))
    plan.set("command", number=1, ahead=0.1)
    plan.set(
        "segment", number=1, segments=1, time=np.arange(20) * 0.1, jump=[0.2, 0.4, 0.6], outcome=2
    )
    score.set("truth", base_position=[0.0, 0.0, 0.4], base_orientation=[0.0, 0.0, 0.0, 1.0])
    for tick in range(400):
        plan.step()
        if tick == 20:  # the landing of the jump under way moves
            plan.set("phase", phase=Phase.THRUST)
            plan.set("command", number=2, ahead=0.12, replaces=True)
        if tick == 100:  # it has jumped, and learns where it landed
            plan.set("phase", phase=Phase.STAND)
            plan.set("command", number=3, placed=True, ahead=0.3, replaces=False)
        score.set("goal", number=int(tick >= 10))
        score.set("truth", contact_touched=np.full(4, not 20 <= tick < 80))
        score.step()


@pytest.fixture(scope="module")
def calls():
    """For every kernel the arguments of some of its calls, during a jump or in a block by itself."""
    load_all()
    # other tests of the same process define kernels of their own, which are none of the package's
    functions = {name: f for name, f in kernels().items() if name.startswith("aloft.")}
    samples = {name: [] for name in functions}
    name_of = {id(function): name for name, function in functions.items()}

    def recorder(name, function):
        count = 0

        def record(*arguments):
            nonlocal count
            if count % EVERY == 0 and len(samples[name]) < SAMPLES:
                samples[name].append(copy(arguments))
            count += 1
            return function(*arguments)

        record.kernel = function
        return record

    def recorded_call(function, *arguments):
        name = name_of.get(id(function))
        return KernelCall(recorder(name, function) if name else function, *arguments)

    used = {}  # which fields a step uses cannot be seen through recorders

    def names_used(function):
        function = getattr(function, "kernel", function)
        return used.get(id(function)) or find_names(function)

    def called(block, function):
        return call_of(block, getattr(function, "kernel", function))

    find_names, call_of = steps.names_used, steps.call_of
    for function in functions.values():  # before its calls of other kernels are replaced
        expand(function)
        used[id(function)] = find_names(function)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steps, "KernelCall", recorded_call)  # steps of blocks are in no module
        patch.setattr(steps, "names_used", names_used)
        for module in [m for name, m in sys.modules.items() if name.startswith("aloft.")]:
            for key, value in list(vars(module).items()):
                if value is call_of:
                    patch.setattr(module, key, called)
                elif id(value) in name_of:
                    patch.setattr(module, key, recorder(name_of[id(value)], value))
        run_jump({})
        other = {"estimator.use": "blocks.InvariantKalmanFilter", "legs.beyond": "slide"}
        run_jump({**other, "wbc.solver": "daqp"}, duration=0.1)
        other = {"estimator.use": "blocks.ComplementaryFilter", "estimator.flight": "ballistic"}
        other["robot.actuators.bus_period"] = None  # drives that give every joint its own feedback
        other |= {"safety.tilt_limit": 1e-6, "safety.tilt_hold": 0.0}  # it is damped
        run_jump({**other, "joint_pd.stance_targets": "acceleration"}, duration=0.02)
        weak = {"wbc.torque_margin": 0.15, "wbc.friction": 0.05}  # constraints come and go
        run_jump(weak, duration=0.1)
        run_jump({**weak, "wbc.cones": "round"}, duration=0.1)
        run_jump({"robot.motor_model.load_friction": 0.05}, 0.02, "from_gantry.yaml")
        run_jump(FAULTS, duration=0.1)
        run_jump(duration=0.3, graph="jump_twin.yaml")  # with the fault detector
        steer_alone()
        run_alone("hal.MujocoRobot", bruce_with(**SENSORS))
        mounted = {"imu_position": [0.01, 0.0, 0.02], "imu_rotation": [0.0, 0.01, 0.02]}
        run_alone("blocks.SensorAlignment", find_robot("bruce"), play=0.01, **mounted)
        gears = {"stiffness": 500.0, "damping": 0.5, "backlash": 0.001}
        run_alone("hal.MujocoRobot", find_robot("bruce"), actuators={"gears": gears})
        for name in known_names():  # blocks that none of these graphs has
            own = [name_of[id(f)] for f in find_block(name).named_steps.values() if is_kernel(f)]
            if not all(samples[each] for each in own):
                run_alone(name, find_robot("bruce"))
    for name, arguments in UNUSED.items():
        samples[name].append(arguments)
    return samples


@pytest.fixture(scope="module")
def compiler():
    """Gives a kernel as a function of Python that runs machine code, for each kind of arguments."""
    translator, made = Translator(), {}

    def build(function):
        def call(*arguments):
            signature = tuple(type_of(each) for each in arguments)
            key = function, signature
            if key not in made:
                count, code = with_results(translator, function, signature)
                made[key] = count, MachineCode(code)
            count, code = made[key]
            results = np.zeros(count or 0)
            words = pack((*arguments, results) if count is not None else arguments)
            code.function(ctypes.c_size_t(words.ctypes.data))
            return tuple(results) if count is not None else None

        return call

    return build


def with_results(translator, function, signature):
    """How many numbers a kernel returns, and its object code; these it writes to one more array."""
    names = [f"a{k}" for k in range(len(signature))]
    count = translator.results(function, signature)
    if not count:
        return None, translator.object_code(function, signature)
    places = ", ".join(f"out[{k}]" for k in range(count))
    text = f"def wrapped({', '.join(names)}, out):\n    {places} = function({', '.join(names)})\n"
    file = f"<wrapped {len(linecache.cache)}>"
    linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file
    scope = {"function": function, "__name__": __name__}
    exec(compile(text, file, "exec"), scope)  # noqa: S102  # of the text above
    wrapped = scope["wrapped"]
    wrapped.__module__ = __name__
    keep.append(wrapped)
    signature = (*signature, type_of(np.zeros(count)))
    return count, translator.object_code(wrapped, signature)


keep = []
"""Functions whose identity a translator remembers."""


def is_exact(function):
    """Whether neither the kernel nor one it calls uses what may be rounded differently."""
    names = written_code(function).co_names
    callees = [function.__globals__.get(name) for name in names]
    marked = {id(f) for f in kernels().values()}
    return not INEXACT & set(names) and all(
        is_exact(f) for f in callees if id(f) in marked and f is not function
    )


def replaced(arguments, random):
    """The arguments with other numbers of about the same size in every array of floats."""
    new = copy(arguments)
    for a in leaves(new):
        if isinstance(a, np.ndarray) and a.dtype == np.float64:
            by = (0.1 * np.abs(a) + 1e-3) * random.standard_normal(a.shape)
            np.add(a, by, out=a, where=np.isfinite(a))
        elif isinstance(a, np.ndarray) and a.dtype == np.bool_:
            a[...] = random.random(a.shape) < 0.5
    return new


def flat(arguments, result):
    """All that a call has written and returned, as arrays."""
    returned = result if isinstance(result, tuple) else () if result is None else (result,)
    return [np.asarray(a) for a in (*leaves(arguments), *returned)]


@pytest.mark.long
def test_all_kernels_compile_and_compute_the_same(calls, compiler):
    missing = [n for n, samples in calls.items() if not samples]
    assert not missing, f"not called by the jump; add arguments to UNUSED: {missing}"
    for name in calls:
        function = kernels()[name]
        # numbers of its own, which do not depend on what other tests of the process import
        random = np.random.default_rng(list(name.encode()))
        machine, exact = compiler(function), is_exact(function)
        for sample in calls[name]:
            for arguments in (sample, *(replaced(sample, random) for _ in range(4))):
                ours, theirs = copy(arguments), copy(arguments)
                expected = flat(ours, function(*ours))
                found = flat(theirs, machine(*theirs))
                assert len(found) == len(expected), name
                for a, b in zip(expected, found, strict=True):
                    if exact:
                        np.testing.assert_array_equal(b, a, err_msg=name)
                    else:
                        scale = max(1.0, float(np.abs(a).max(initial=0.0)))
                        np.testing.assert_allclose(
                            b, a, rtol=1e-12, atol=1e-12 * scale, err_msg=name
                        )


def test_every_function_of_numbers_and_arrays_is_a_kernel():
    load_all()
    marked = set(kernels())
    found = set()
    for path in HOT:
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.FunctionDef) or not node.args.args:
                continue
            texts = [ast.unparse(a.annotation) for a in node.args.args if a.annotation]
            if all(text in PLAIN or text.startswith("NDArray[") for text in texts):
                found.add(f"{module}.{node.name}")
    unmarked = {n for n in found if f"aloft.{n}" not in marked}
    assert sorted(unmarked - set(NOT_HOT)) == []
    assert set(NOT_HOT) <= found, "functions that are gone"
    assert len(found) > 60


def test_a_mark_leaves_the_function_alone():
    def double(value: float) -> float:
        return 2.0 * value

    assert kernel(double) is double
    assert double in kernels().values()


@pytest.mark.long
def test_nothing_of_ours_needs_a_compiler_to_run():
    modules = [".".join(("aloft", *p.relative_to(ROOT).with_suffix("").parts)) for p in HOT]
    modules = [name.removesuffix(".__init__") for name in modules]
    code = "import importlib, sys\nsys.modules['llvmlite'] = None\n" + "".join(
        f"importlib.import_module({name!r})\n" for name in modules
    )
    code += (
        "import aloft\n"
        f"aloft.load({str(ROOT / 'graphs/jump.yaml')!r}).run(duration=0.02)\n"
        "assert sys.modules['llvmlite'] is None\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=240)


def test_a_difference_would_be_seen(compiler):
    """The comparison is of the compiled code, not of the function with itself."""
    wrap = kernels()["aloft.mathematics.rotations.wrap"]
    assert compiler(wrap) is not wrap
    assert compiler(wrap)(7.0)[0] == pytest.approx(7.0 - 2.0 * math.pi)
