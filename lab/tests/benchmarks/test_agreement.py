"""Whether the methods agree, on few programs; ``aloft bench agreement`` has many."""

import numpy as np
import pytest

from aloft.lab.benchmarks.agreement import (
    CLARABEL,
    CONES,
    DAQP,
    OWN,
    Agreement,
    Methods,
    Proposal,
    SolvedState,
    proved_minimum,
    random_states,
    recorded_states,
    show_state,
)
from aloft.mathematics.whole_body_cones import PLANES, cone_memory, solve_with_cones
from aloft.mathematics.whole_body_qp import SOLVED, WholeBodySolution
from aloft.mathematics.whole_body_reduction import reduce_program, reduction_memory
from aloft.mathematics.whole_body_solution import active_set_program

pytestmark = pytest.mark.filterwarnings("ignore:Converted matrix")


@pytest.fixture(scope="module")
def recorded() -> tuple[Methods, list[SolvedState]]:
    block, states = recorded_states({"robot.seed": 7001, "wbc.friction": 0.1}, 0.9, every=15)
    return Methods(block), states


def agreed(found: Agreement) -> None:
    assert not found.unsolved.keys() & {OWN, DAQP, CONES}
    for name in (OWN, DAQP, CONES):
        assert max(found.errors[name]) < 1e-6, name
    assert np.median(found.errors[CLARABEL]) < 1e-5
    assert not found.unproved


def test_they_agree_on_recorded_states(recorded: tuple[Methods, list[SolvedState]]) -> None:
    methods, states = recorded
    assert len(states) > 20
    agreed(methods.compare(states))


def test_they_agree_on_random_programs_and_say_which_have_no_solution(
    recorded: tuple[Methods, list[SolvedState]],
) -> None:
    methods, states = recorded
    found = methods.compare(random_states(states, 150, 3))
    agreed(found)
    assert found.impossible["pyramids"] == found.impossible["round"] > 0
    assert found.limited > 20
    rows = {row.name: row for row in found.rows("random")}
    assert rows["random: own method, round cones, not solved"].met is True
    assert "without a solution" in rows["random: own method, largest error"].note


def test_round_cones_are_stateless_and_plain_python_has_the_same_bytes(
    recorded: tuple[Methods, list[SolvedState]],
) -> None:
    methods, states = recorded
    chosen = list(random_states(states, 12, 5))
    block, call = methods._block, methods._cones

    def solve(state: SolvedState) -> bytes:
        show_state(block, state)
        methods.solve(call)
        code = methods._solution.code.tobytes()
        return (
            methods._solution.torque.tobytes() + code
            if int(methods._solution.code[0]) == SOLVED
            else code
        )

    first = [solve(state) for state in chosen]
    assert [solve(state) for state in reversed(chosen)] == first[::-1]
    assert sum(len(answer) > 8 for answer in first) > 6
    n, contacts = len(block.command.acceleration), len(block.command.force)
    plain = WholeBodySolution(
        np.zeros(n - 6), np.zeros(n), np.zeros((contacts, 3)), np.zeros(1, np.int64)
    )
    for state, expected in zip(chosen[:6], first, strict=False):
        show_state(block, state)
        program, reduction = block._program, reduction_memory(n, contacts)
        own = active_set_program(n, contacts, PLANES)
        reduce_program(program, reduction, plain)
        solve_with_cones(program, reduction, cone_memory(contacts), own, plain)
        if int(plain.code[0]) == SOLVED:
            assert plain.torque.tobytes() + plain.code.tobytes() == expected


def test_forces_lie_in_their_cones_and_reach_further_than_the_pyramid_inside(
    recorded: tuple[Methods, list[SolvedState]],
) -> None:
    methods, states = recorded
    edges = 0
    for state in random_states(states, 60, 9):
        show_state(methods._block, state)
        methods.solve(methods._cones)
        if int(methods._solution.code[0]) != SOLVED:
            continue
        forces = methods._solution.force[state.stance]
        size = np.hypot(forces[:, 0], forces[:, 1])
        assert (size - state.friction * forces[:, 2]).max() < 1e-9
        assert (forces[:, 2] > state.force_min - 1e-9).all()
        edges += int((np.abs(size - state.friction * forces[:, 2]) < 1e-9 * (1 + size)).sum())
    assert edges > 20


def test_a_wrong_proposal_is_not_proved(recorded: tuple[Methods, list[SolvedState]]) -> None:
    methods, states = recorded
    block = methods._block
    for state in random_states(states, 40, 11):
        show_state(block, state)
        methods.full.limit.run()
        active = np.flatnonzero(state.stance)
        program = methods.full.assemble(active)
        methods.solve(methods._own)
        if int(methods._solution.code[0]) != SOLVED:
            continue
        x = np.hstack((methods._solution.acceleration, methods._solution.force[active].ravel()))
        slack = program.inequality.bound - program.inequality.matrix @ x
        if slack.min() < 1e-9:  # a constraint matters
            break
    else:
        raise AssertionError("no program with an active constraint")
    none = np.zeros(len(slack), np.bool_)
    assert proved_minimum(program, Proposal(x, none, np.zeros(0, np.int64)), 0.0) is None
