"""Interpreted functions are CasADi's own to the bit, at any number of instants, here and in other processes."""

from __future__ import annotations

import pickle
import threading
from typing import Any

import casadi as ca
import numpy as np
import pytest

from aloft.mathematics.arrays import Array
from aloft.mathematics.compiling.lanes import OPERATIONS
from aloft.planner.models.interpreted import _places, interpreted
from aloft.planner.models.robot_model import model_of
from aloft.planner.problem import paper_problem, rigid_body_problem
from aloft.planner.problem.stage_functions import (
    COORDINATES,
    PIECES,
    SLOPED,
    SLOPED_PIECES,
    StageFunction,
    make_piece,
)
from aloft.planner.solving.kept_functions import KINDS
from aloft.robots.description import find_robot
from aloft.robots.welding import welded

SPECIAL = [0.0, -0.0, 1.0, -1.0, 0.5, -2.5, 3e-320, 1e300, np.inf, -np.inf, np.nan]
COUNTS = (1, 5, 16)


def same(theirs: Any, own: Any, count: int, draw: np.random.Generator) -> None:
    """Compare a function with its interpretation at ``count`` drawn instants."""
    arguments = []
    for number in range(theirs.n_in()):
        pattern = ca.repmat(theirs.sparsity_in(number), 1, count)
        values = draw.normal(0.0, 10.0 ** draw.uniform(-2.0, 1.0), pattern.nnz())
        values[draw.random(len(values)) < 0.03] = 0.0
        arguments.append(ca.DM(pattern, values))
    expected, found = (
        function.map(count).call(arguments) for function in (theirs, own)
    )  # fmt: skip
    for a, b in zip(expected, found, strict=True):
        assert a.sparsity() == b.sparsity(), theirs.name()
        bits = (np.array(each.nonzeros()).view(np.int64) for each in (a, b))
        differing = np.flatnonzero(np.not_equal(*bits))
        assert not len(differing), f"{theirs.name()}: entries {differing[:5]} of {a.nnz()}"


def check(piece: StageFunction) -> None:
    draw = np.random.default_rng(55)
    for kind in KINDS:
        theirs = getattr(piece, kind)
        own = interpreted(theirs)
        for count in COUNTS:
            same(theirs, own, count, draw)


@pytest.mark.parametrize("name", ["air", "contact"])
def test_a_piece_is_casadis_own_to_the_bit(name: str) -> None:
    model = model_of(find_robot("bruce"))[0]
    coordinates = COORDINATES["full"](model)
    assert coordinates is not None
    check(make_piece(model, coordinates, name))


@pytest.mark.long
@pytest.mark.parametrize("robot", ["bruce", "go2", "g1", "solo12", "anymal_c", "talos"])
def test_every_function_of_robots_is_casadis_own_to_the_bit(robot: str) -> None:
    model = model_of(welded(find_robot(robot)).robot)[0]
    for make in COORDINATES.values():
        coordinates = make(model)
        if coordinates is not None:
            for name in (*PIECES, *(SLOPED + each for each in SLOPED_PIECES)):
                check(make_piece(model, coordinates, name))
    for problem in (paper_problem, rigid_body_problem):
        for name in problem.PIECES:
            check(problem.make_piece(model, name))


def special() -> list[Array]:
    """Return every pair of the special values and of some others."""
    values = np.concatenate([SPECIAL, np.random.default_rng(1).normal(0.0, 3.0, 20)])
    return [each.ravel() for each in np.meshgrid(values, values)]


@pytest.mark.parametrize(
    "operation", sorted(_places()), ids=lambda number: OPERATIONS[_places()[number]]
)
def test_every_operation_is_casadis_own_to_the_bit(operation: int) -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    made = ca.SX.binary(operation, x, y) if _takes_two(operation) else ca.SX.unary(operation, x)
    theirs = ca.Function("one", [x, y], [ca.densify(made), x])
    first, second = special()
    arguments = [ca.DM(first).T, ca.DM(second).T]
    expected, found = (f.map(len(first)).call(arguments)[0] for f in (theirs, interpreted(theirs)))
    a, b = (np.array(each.full()).ravel() for each in (expected, found))
    unequal = (a.view(np.int64) != b.view(np.int64)) & ~(np.isnan(a) & np.isnan(b))
    assert not unequal.any(), (
        first[unequal][:3],
        second[unequal][:3],
        a[unequal][:3],
        b[unequal][:3],
    )


def _takes_two(operation: int) -> bool:
    two = "ADD SUB MUL DIV COPYSIGN LT LE EQ NE AND OR ATAN2 POW CONSTPOW FMIN FMAX IF_ELSE_ZERO"
    return operation in {getattr(ca, f"OP_{name}") for name in two.split()}


def test_an_operation_that_is_not_interpreted_is_named() -> None:
    x = ca.SX.sym("x")
    with pytest.raises(
        ValueError,
        match=r"^odd: instruction 1 is CasADi's operation \d+, which is not interpreted$",
    ):
        interpreted(ca.Function("odd", [x], [ca.erf(x)]))


def polynomial() -> Any:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 0)
    return ca.Function("polynomial", [x, p], [x[0] ** 2 + x[1], ca.SX(2, 2), ca.diag(3.0 * x)])


def test_what_has_no_entries_is_neither_asked_for_nor_given() -> None:
    theirs, own = polynomial(), interpreted(polynomial())
    assert (own.name(), own.n_in()) == ("polynomial", 2)
    assert (own.size1_in(0), own.size1_in(1), own.size1_out(2)) == (2, 0, 2)
    assert own.sparsity_out(2) == theirs.sparsity_out(2)
    same(theirs, own, 3, np.random.default_rng(2))
    value = own([3.0, 1.0], [])
    assert float(value[0]) == 10.0 and value[1].nnz() == 0


def test_arguments_that_casadi_leaves_out_are_zero() -> None:
    own = interpreted(polynomial()).map(2)
    buffer, run = own.buffer()
    found = np.full(2, -1.0)
    buffer.set_res(0, found.data)
    given = np.array([1.0, 2.0, 3.0, 4.0])
    buffer.set_arg(0, given.data)
    run()
    assert found.tolist() == [3.0, 13.0]
    other, again = own.buffer()
    other.set_res(0, found.data)
    again()
    assert found.tolist() == [0.0, 0.0]


def test_a_pickled_function_is_the_same() -> None:
    theirs = polynomial()
    same(theirs, pickle.loads(pickle.dumps(interpreted(theirs))), 4, np.random.default_rng(3))


def test_two_threads_do_not_mix_their_values() -> None:
    own = interpreted(polynomial()).map(4)
    wrong: list[float] = []

    def evaluate(value: float) -> None:
        given = ca.repmat(ca.DM([value, 0.0]), 1, 4)
        for _ in range(300):
            if float(own(given, ca.DM(0, 4))[0][0, 3]) != value * value:
                wrong.append(value)

    threads = [threading.Thread(target=evaluate, args=(value,)) for value in (2.0, 3.0)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
