"""Every kernel compiles in Numba's nopython mode as it stands and computes the same.

The arguments are those of a real jump, as the blocks give them, and the same again with all numbers
of the arrays replaced at random, which takes other branches. Where a kernel only adds, multiplies,
divides and takes roots, results are equal to the last bit.
"""

import ast
import importlib
import math
import subprocess
import sys
import types
from pathlib import Path

import numba
import numpy as np
import pytest

import aloft
from aloft.mathematics.body_tree import BodyMotion
from aloft.mathematics.flight_prediction import LandingCost, flight_map
from aloft.mathematics.joint_feedback import Feedback, Motion, SoftStops
from aloft.mathematics.kernel import kernel, kernels
from aloft.mathematics.pid import PidGains, PidMemory
from aloft.robots.description import find_robot
from aloft.robots.five_joint_leg import read_leg
from aloft.robots.limb import read_limb
from aloft.robots.limb_inverse import limb_scratch

ROOT = Path(__file__).parent.parent
ROOMS = ("mathematics", "blocks", "hal")
HOT = [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]
PLAIN = {"Array", "Flags", "Indices", "float", "int", "bool"}
NOT_HOT = {
    "blocks.signals.drive_conditions.conditions": "of an error byte, for people",
    "blocks.signals.drive_conditions.describe": "of an error byte, for people",
    "blocks.signals.drive_conditions.is_critical": "of an error byte, by integer arithmetic",
    "hal.simulated.start_check._millimetres": "for the text of an error, before a run",
    "hal.simulated.mujoco_robot._nearest_step": "for the text of an error, when a graph is loaded",
    "blocks.jumping.landing_heuristic.foot_sides": "of the description, when a graph is loaded",
    "hal.simulated.random_streams._signed": "of exact integers, when a run is restored",
    "hal.bear.supervision._first_lasting": "of plain numbers, in the driver's own Python",
    "mathematics.body_dynamics.inertias": "memory, when a block is set up",
    "mathematics.body_tree.body_motion": "memory, when a block is set up",
    "mathematics.active_set.active_set_memory": "memory, when a block is set up",
    "mathematics.flight_prediction.flight_map": "memory, when a block is set up",
    "mathematics.whole_body_reduction.reduction_memory": "memory, when a block is set up",
    "mathematics.whole_body_solution.solution_memory": "memory, when a block is set up",
    "hal.simulated.scenes.step": "makes a scene, when a run is loaded",
    "hal.simulated.scenes.platform": "makes a scene, when a run is loaded",
    "hal.simulated.stance._solve_positive": "before a run, by MuJoCo's linear algebra",
    "hal.simulated.holding._two_digits": "before a run, of the holding gains",
    "hal.simulated.stance._solve_normal": "before a run, by MuJoCo's linear algebra",
}
"""Functions of numbers and arrays only that need not compile, and why."""

INEXACT = {"sin", "cos", "atan2", "acos", "exp", "hypot", "dot", "tanh", "tan"}
"""What another library, or another order of sums, may round differently."""

LEG = read_leg(find_robot("bruce"), 0)
LIMB = read_limb(find_robot("bruce"), 0)
MIDDLE = LIMB.limits.mean(axis=1)
TARGET = np.array([[0.05, -0.08, -0.3], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
POSE = np.array([[0.02, -0.06, -0.3], [1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
CHAIN = (LIMB.links, LIMB.tip, LIMB.limits, TARGET, np.array([1.0, 0.9, 0.3]))
COEFFICIENTS = np.array([0.2, 0.1, 0.05, -0.5, 0.1])
GAINS = PidGains(
    *np.linspace(-0.5, 2.0, 15).reshape(5, 3), -np.ones(3), np.ones(3), 0.01, 0.3, 0.002
)
NORMAL = np.random.default_rng(3).standard_normal
FLIGHT = flight_map(10, 4)._replace(
    drift=NORMAL((3, 3)), carried=NORMAL((12, 3)), turn=NORMAL((2, 12))
)
REGULAR = 3.0 * np.eye(3) + 0.5 * POSE[1:]
"""A matrix whose inverse is computed to the last bits."""
LANDING = LandingCost(
    np.array([0.02, -0.01, 0.03]),
    np.array([1.0, 2.0, 3.0, 1.5, 0.4, 0.3]),
    np.array([[-0.01, 0.02], [-0.03, 0.01]]),
    np.array([-0.02, 0.01]),
)
SOLES = np.array([[0.05, -0.08, 0.0], [-0.04, -0.08, 0.0], [0.05, 0.08, 0.0], [-0.04, 0.08, 0.0]])
MOVING = BodyMotion(*(NORMAL(shape) for shape in ((2, 3, 3), (2, 3), (1, 6), (2, 6), (2, 6))))
UNUSED = {
    "aloft.mathematics.capture_step.nearest_in_foot": (
        SOLES, np.array([0, 0, 1, 1]), 1, np.array([0.1, 0.02]), np.zeros(2),
    ),
    "aloft.mathematics.capture_step.farthest_foot": (
        SOLES, np.array([0, 0, 1, 1]), 2, np.array([0.1, 0.02]), np.zeros(2),
    ),
    "aloft.mathematics.capture_step.choose_foothold": (
        np.array([-0.1, 0.02]), 6.0, 0.1, 0.1, SOLES, np.array([0, 0, 1, 1]), 1, 2, np.zeros(2),
        np.zeros(2), np.zeros(3),
    ),
    "aloft.mathematics.capture_step.limit_foothold": (
        np.array([0.1, -0.08, 0.0]), 0.3, 1.0, 0.2, 0.09, 0.27, np.array([-0.3, 0.02, 0.0]),
    ),
    "aloft.mathematics.capture_step.approach": (0.1, -0.3, 0.2, 0.05),
    "aloft.mathematics.capture_step.swing_points": (
        1, np.array([0, 0, 1, 1]), np.array([[0.045, 0.0, 0.0], [-0.045, 0.0, 0.0]] * 2),
        np.array([-0.1, 0.1, 0.0]), 0.1, 0.03, 0.13, 0.015, SOLES, NORMAL((4, 3)),
        np.ones(4, bool), np.zeros(4, bool), np.zeros((4, 3)),
    ),
    "aloft.mathematics.flight_prediction.map_flight": (
        np.vstack([NORMAL((3, 16)), np.hstack([REGULAR, NORMAL((3, 13))])]), NORMAL((4, 3, 16)),
        np.eye(3), 4.8, 0.5, flight_map(10, 4),
    ),
    "aloft.mathematics.flight_prediction.predict_tilt": (
        FLIGHT, np.array([0.1, -0.05, 0.02]), np.array([0.02, 0.03, -0.01]), NORMAL(12), 0.2,
        np.array([1.0, 1.0, -1.0, -1.0]), np.zeros(2), np.zeros((2, 4)),
    ),
    "aloft.mathematics.flight_prediction.choose_shift": (
        np.array([0.1, -0.05]), NORMAL((2, 4)), LANDING, np.zeros((4, 4)), np.zeros(4),
    ),
    "aloft.mathematics.flight_prediction.invert": (REGULAR, np.zeros((3, 3))),
    "aloft.mathematics.flight_prediction.solve_rows": (
        REGULAR + REGULAR.T, np.array([[0.3, -0.2, 0.5], [1.0, 0.4, -0.7]]),
    ),
    "aloft.blocks.control.balance_target.pattern_turn": (
        POSE, POSE[0], TARGET, np.array([0.01, 0.02, 0.0]),
    ),
    "aloft.mathematics.landing_law.landing_place": (
        POSE[0], 1.0, POSE[1], POSE[2], np.array([0.1, 0.2, 0.3]), np.array([0.3, 0.2, 0.1]), 0.05,
        np.array([0.1, 0.2]), POSE[3], np.zeros(3),
    ),
    "aloft.mathematics.landing_law.turn_places": (POSE, 0.3, np.zeros((4, 3))),
    "aloft.robots.limb.place_limb": (
        LIMB.links, LIMB.tip, MIDDLE, np.zeros((5, 6)), np.zeros((4, 3)),
    ),
    "aloft.robots.limb.limb_jacobian": (LIMB.links, np.ones((5, 6)), POSE, np.zeros((6, 5))),
    "aloft.robots.limb_error.aim": (POSE[0], POSE[1:], np.zeros((4, 3))),
    "aloft.robots.limb_error.foot_error": (
        LIMB.tip, POSE, TARGET, np.array([1.0, 0.9, 0.3]), np.zeros(6),
    ),
    "aloft.robots.limb_error.weigh_rows": (
        LIMB.tip, POSE, TARGET, np.array([1.0, 0.9, 0.3]), np.ones((6, 5)),
    ),
    "aloft.robots.limb_inverse.approach": (*CHAIN, 3, limb_scratch(5), MIDDLE),
    "aloft.robots.limb_inverse.reach": (
        *CHAIN, np.tile([*MIDDLE, 0.0], (3, 1)), 3, 3, limb_scratch(5), np.zeros(5),
    ),
    "aloft.robots.limb_inverse.limb_velocity": (
        *CHAIN, MIDDLE, np.ones(6), 3e-4, limb_scratch(5), np.zeros(5),
    ),
    "aloft.robots.limb_error.turning": (LIMB.tip, POSE, TARGET, 0.002, 10.0, np.zeros(3)),
    "aloft.robots.limb_inverse._stuck": (LIMB.limits, 1, 0.3, 1.0),
    "aloft.robots.limb_error._along": (POSE, LIMB.tip),
    "aloft.robots.limb_error._product": (POSE, TARGET, 1, 2),
    "aloft.robots.limb_error._unit": (0.1, 0.2, 0.3, 1.0, 0.0, 0.0),
    "aloft.robots.five_joint_reach.slide": (
        LEG.hip, LEG.plane, LEG.signs, LEG.limits, np.add(LEG.hip, [0.25, 0.02, -0.3]), np.eye(3), 0.005,
        0.1, np.zeros(3), np.zeros(5),
    ),
    "aloft.mathematics.rotations.skew": (np.ones(3), np.zeros((3, 3))),
    "aloft.robots.five_joint_reach.pitched_line": (np.eye(3), 0.4, np.zeros(3)),
    "aloft.mathematics.rotations.yaw": (np.array([0.1, 0.2, 0.3, 0.9]),),
    "aloft.blocks.control.balance_target.lengthen": (
        np.array([0.01, -0.04, 0.0]), 0.7, 0.02, 0.25, 0.2, 0.6, *(np.ones(3) for _ in range(3)),
    ),
    "aloft.blocks.control.dynamics.lowest_point": (
        np.array([0.01, 0.0, -0.2]), 0.022, np.eye(3), np.zeros(3),
    ),
    "aloft.blocks.control.dynamics.rolling_drift": (MOVING, 1, POSE[0], POSE[1], np.zeros(3)),
    "aloft.robots.contact_kinematics.see_pattern": (POSE[1:3], REGULAR, *np.ones((3, 3))),
    "aloft.mathematics.joint_feedback.integrate_accelerations": (
        0.002, 0.02, np.ones(10), Motion(np.ones(10), np.ones(10)), Motion(np.ones(10), np.ones(10)),
    ),
    "aloft.mathematics.joint_feedback.add_friction": (
        np.linspace(-1.0, 1.0, 10), np.full(10, 0.07), np.full(10, 0.01), 0.3, np.zeros(10),
        np.ones(10),
    ),
    "aloft.mathematics.joint_feedback.add_soft_stops": (
        np.linspace(-1.0, 1.0, 5),
        SoftStops(np.tile([-0.8, 0.7], (5, 1)), 0.1, 2.0, np.full(5, 60.0), np.full(5, 1.5)),
        Feedback(*(np.full(5, x) for x in (40.0, 0.2, 1.0, 0.3))),
    ),
    "aloft.robots.five_joint_reach.keep_along": (
        np.array([0.0, 0.6, 0.8]), np.array([0.1, 0.2, 0.3]),
    ),
    "aloft.mathematics.inertial_filter.right_up": (
        np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.3, 0.2, 9.8]), 0.01, np.zeros(3),
    ),
    "aloft.mathematics.invariant_contacts.remove_contact": (1, np.full((37, 37), 0.5)),
    "aloft.mathematics.extended_pose.exponential": (
        np.linspace(-0.5, 0.6, 12), np.zeros(4), np.zeros((3, 3)),
    ),
    "aloft.mathematics.extended_pose.unbend": (
        np.array([0.1, -0.4, 0.3]), np.array([0.5, 0.2, -0.3]), np.zeros(3),
    ),
    "aloft.mathematics.extended_pose.logarithm": (
        np.array([0.1, 0.2, 0.3, 0.92]), np.ones((3, 3)), np.zeros(12),
    ),
    "aloft.mathematics.extended_pose.divide": (
        np.array([0.1, 0.2, 0.3, 0.92]), np.ones((3, 3)), np.array([0.6, 0.0, 0.0, 0.8]),
        np.ones((3, 3)), np.zeros(4), np.zeros((3, 3)), np.zeros(4),
    ),
    "aloft.blocks.control.balance_target.add_quadratic_growth": (np.ones(3), 0.6, 0.25, np.zeros(3), np.zeros(3)),
    "aloft.blocks.general.periods.first_tick": (0.5, 0.002),
    "aloft.mathematics.linear.add_product": (POSE, POSE[0], np.ones(4)),
    "aloft.mathematics.linear.multiply_matrices": (POSE, TARGET[1:], np.zeros((4, 3))),
    "aloft.mathematics.discretisation.matrix_exponential": (
        4.0 * POSE[1:], np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)),
    ),
    "aloft.mathematics.second_order_filter.first_order": (20.0, 0.002, True, np.zeros(5)),
    "aloft.mathematics.second_order_filter.second_order": (20.0, 0.7, 0.002, False, np.zeros(5)),
    "aloft.mathematics.second_order_filter.band_stop": (20.0, 2.0, 0.002, np.zeros(5)),
    "aloft.mathematics.second_order_filter.settle": (COEFFICIENTS, POSE[0], np.ones((3, 2))),
    "aloft.mathematics.second_order_filter.advance": (
        COEFFICIENTS, POSE[0], np.ones((3, 2)), np.zeros(3),
    ),
    "aloft.mathematics.pid.start_pid": (GAINS, POSE[0], POSE[2], PidMemory(*np.ones((3, 3)))),
    "aloft.mathematics.pid.step_pid": (
        GAINS, POSE[0], POSE[2], POSE[3], PidMemory(*np.ones((3, 3))), np.zeros(3),
    ),
    "aloft.mathematics.lookup.interval": (np.linspace(-1.0, 1.0, 9), 0, 9, 0.3),
    "aloft.mathematics.lookup.interpolate": (np.linspace(-1.0, 1.0, 4), POSE[:, 2], 0.3, True),
    "aloft.mathematics.lookup.interpolate_grid": (
        np.array([0.0, 1.0, 2.0, 4.0]), np.array([2, 2]), POSE[:, 1], np.array([0.3, 5.0]), False,
        np.zeros(2, np.int64), np.zeros(2),
    ),
    "aloft.mathematics.transfer_function.advance": (
        POSE[1:], POSE[0], TARGET[0], 0.5, POSE[:, 0], TARGET, np.zeros(3), np.zeros(4),
    ),
    "aloft.mathematics.euler_angles.from_euler": (POSE[1], np.zeros(4)),
    "aloft.mathematics.euler_angles.to_euler": (np.array([0.1, 0.2, 0.3, 0.92]), np.zeros(3)),
    "aloft.mathematics.whole_body_qp.share_weight": (
        np.array([True, False, True, True]), 50.0, np.zeros((4, 3)),
    ),
}  # fmt: skip
"""Arguments of kernels that ``graphs/jump.yaml`` does not call with either estimator."""

SAMPLES = 6
EVERY = 211
"""Of a kernel's calls the first and then every so many are kept, up to so many samples."""


PYTHON = {bool, int, float}
"""Other numbers, such as those of an enumeration, are made plain ones."""


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


@pytest.fixture(scope="module")
def calls():
    """For every kernel the arguments of some of its calls during a jump."""
    load_all()
    functions = kernels()
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

        return record

    with pytest.MonkeyPatch.context() as patch:
        for module in [m for name, m in sys.modules.items() if name.startswith("aloft.")]:
            for key, value in list(vars(module).items()):
                if id(value) in name_of:
                    patch.setattr(module, key, recorder(name_of[id(value)], value))
        aloft.load(ROOT / "graphs/jump.yaml").run()
        other = {"estimator.use": "blocks.InvariantKalmanFilter", "legs.beyond": "slide"}
        other["wbc.solver"] = "daqp"
        aloft.load(ROOT / "graphs/jump.yaml", other).run(duration=0.1)
        other = {"estimator.use": "blocks.ComplementaryFilter", "estimator.flight": "ballistic"}
        other |= {"robot.bus_period": None, "safety.tilt_limit": 1e-6, "safety.tilt_hold": 0.0}
        aloft.load(ROOT / "graphs/jump.yaml", other).run(duration=0.02)
        weak = {"wbc.torque_margin": 0.15, "wbc.friction": 0.05}  # constraints come and go
        aloft.load(ROOT / "graphs/jump.yaml", weak).run(duration=0.1)
    for name, arguments in UNUSED.items():
        samples[name].append(arguments)
    return samples


@pytest.fixture(scope="module")
def compiler():
    """Compiles a kernel, and before it the kernels it calls."""
    known = {id(function): name for name, function in kernels().items()}
    compiled = {}

    def build(function):
        name = known[id(function)]
        if name not in compiled:
            scope = dict(function.__globals__)
            for used in function.__code__.co_names:
                if id(scope.get(used)) in known:
                    scope[used] = build(scope[used])
            plain = types.FunctionType(function.__code__, scope, function.__name__)
            compiled[name] = numba.njit(plain, fastmath=False)
        return compiled[name]

    return build


def is_exact(function):
    """Whether neither the kernel nor one it calls uses what may be rounded differently."""
    names = function.__code__.co_names
    callees = [function.__globals__.get(name) for name in names]
    marked = {id(f) for f in kernels().values()}
    return not INEXACT & set(names) and all(is_exact(f) for f in callees if id(f) in marked)


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


@pytest.mark.filterwarnings("ignore::numba.core.errors.NumbaPerformanceWarning")
def test_all_kernels_compile_and_compute_the_same(calls, compiler):
    ours = ("kernels_for_tests.", "tests.")  # other tests of the same process define some of these
    missing = [n for n, samples in calls.items() if not samples and not n.startswith(ours)]
    assert not missing, f"not called by the jump; add arguments to UNUSED: {missing}"
    random = np.random.default_rng(1)
    for name, function in kernels().items():
        if not name.startswith("aloft."):
            continue
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
        assert machine.nopython_signatures, name


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
    assert not {n for n in found if f"aloft.{n}" not in marked} - set(NOT_HOT)
    assert set(NOT_HOT) <= found, "functions that are gone"
    assert len(found) > 60


def test_a_mark_leaves_the_function_alone():
    def double(value: float) -> float:
        return 2.0 * value

    assert kernel(double) is double
    assert double in kernels().values()


def test_nothing_of_ours_needs_numba_to_run():
    modules = [".".join(("aloft", *p.relative_to(ROOT).with_suffix("").parts)) for p in HOT]
    modules = [name.removesuffix(".__init__") for name in modules]
    code = "import importlib, sys\nsys.modules['numba'] = None\n" + "".join(
        f"importlib.import_module({name!r})\n" for name in modules
    )
    code += (
        "import aloft\n"
        f"aloft.load({str(ROOT / 'graphs/jump.yaml')!r}).run(duration=0.02)\n"
        "assert sys.modules['numba'] is None\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=240)


def test_a_difference_would_be_seen(compiler):
    """The comparison is of the compiled code, not of the function with itself."""
    wrap = kernels()["aloft.mathematics.rotations.wrap"]
    assert compiler(wrap) is not wrap
    assert compiler(wrap)(7.0) == pytest.approx(7.0 - 2.0 * math.pi)
