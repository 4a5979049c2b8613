"""Motion under constant forces: step by step with the bits of the same operations on whole arrays. That it is the motion
of the equations of motion is a test of ``ExactDynamics``."""

from __future__ import annotations

import numpy as np

from aloft.mathematics.arrays import Array
from aloft.mathematics.compiling.compile_calls import run_compiled
from aloft.mathematics.pushed_motion import (
    PushedTurns,
    SeenMotion,
    Stretches,
    follow_stretches,
    turn_memory,
)
from aloft.mathematics.rotations import cross_products, matrices_of_quaternions
from aloft.planner.models.euler_angles import times, times_transposed

INERTIA = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]


def unit(rows: Array) -> Array:
    return np.asarray(rows / np.linalg.norm(rows, axis=-1, keepdims=True))


def test_stretches_have_the_bits_of_whole_arrays() -> None:
    rng, contacts, counts = np.random.default_rng(8), 4, np.array([5, 1, 2, 7])
    n, steps = len(counts), int(counts.sum())
    instants = 2 * steps + n
    parts = np.array([0.2, 0.3, 0.25, 0.01, -0.02, 0.03]) + 0.01 * rng.normal(size=(instants, 6))
    seen = SeenMotion(
        *rng.normal(size=(3, instants, 3)), parts, np.linalg.inv(parts[:, INERTIA]),
        rng.normal(size=(instants, contacts, 3)),
    )  # fmt: skip
    first = np.concatenate([[0], np.cumsum(counts)])
    base = np.hstack([rng.normal(size=(n, 3)), unit(rng.normal(size=(n, 4)))])
    force, (moment, fall) = rng.normal(size=(n, contacts, 3)), rng.normal(size=(2, n, 3))
    force[1] = 0.0
    step, passed = rng.uniform(0.002, 0.02, (2, steps))
    given = Stretches(step, passed, first, base, rng.normal(size=(n, 6)), force, moment, fall)
    pushed = PushedTurns(*(np.zeros((k, *s)) for k, s in (
        (instants, (3,)), (instants, (3, 3)), (steps, (4,)), (steps, (3,)))))  # fmt: skip
    place, velocity = np.zeros((steps, 3)), np.zeros((steps, 6))
    run_compiled(follow_stretches, seen, given, turn_memory(), pushed, place, velocity)

    of_step, of_instant = np.repeat(np.arange(n), counts), np.repeat(np.arange(n), 2 * counts + 1)
    assert pushed.own.tobytes() == times(seen.inverse, seen.momentum).tobytes()
    arms = seen.points - seen.com[:, None]
    lever = np.einsum("nci,ncj->nij", arms, force[of_instant])
    assert (pushed.lever == lever).all()
    starts, ends = 2 * first[:-1] + np.arange(n), 2 * np.arange(1, steps + 1) + of_step
    turn, com, twist = matrices_of_quaternions(base[:, 3:]), seen.com[starts], given.twist
    spin = twist[:, :3] + cross_products(twist[:, 3:], com) + seen.com_velocity[starts]
    speed, time = times(turn, spin)[of_step], passed[:, None]
    flown = (base[:, :3] + times(turn, com))[of_step] + time * speed + 0.5 * time**2 * fall[of_step]
    turns, com = matrices_of_quaternions(pushed.orientation), seen.com[ends]
    assert place.tobytes() == (flown - times(turns, com)).tobytes()
    left = times_transposed(turns, pushed.momentum) - seen.momentum[ends]
    spins = times(seen.inverse[ends], left)
    linear = times_transposed(turns, speed + time * fall[of_step]) - cross_products(spins, com)
    assert velocity.tobytes() == np.hstack([linear - seen.com_velocity[ends], spins]).tobytes()


def test_the_first_step_begins_with_the_momentum_of_the_start() -> None:
    """In a step of no length nothing turns."""
    rng = np.random.default_rng(9)
    parts, (com, rate, carried) = (
        np.tile([0.2, 0.3, 0.25, 0.01, -0.02, 0.03], (3, 1)),
        rng.normal(size=(3, 3, 3)),
    )
    seen = SeenMotion(
        com, rate, carried, parts, np.linalg.inv(parts[:, INERTIA]), np.zeros((3, 1, 3))
    )
    base, twist = np.hstack([np.ones(3), unit(rng.normal(size=4))])[None], rng.normal(size=(1, 6))
    zeros = np.zeros((1, 3))
    given = Stretches(
        np.zeros(1), np.zeros(1), np.array([0, 1]), base, twist, zeros[None], zeros, zeros
    )
    pushed = PushedTurns(np.zeros((3, 3)), np.zeros((3, 3, 3)), np.zeros((1, 4)), np.zeros((1, 3)))
    place, velocity = np.zeros((1, 3)), np.zeros((1, 6))
    run_compiled(follow_stretches, seen, given, turn_memory(), pushed, place, velocity)
    turn = matrices_of_quaternions(base[0, 3:])
    momentum = turn @ (parts[0][INERTIA] @ twist[0, 3:] + carried[0])
    np.testing.assert_allclose(pushed.momentum[0], momentum, atol=1e-14)
    np.testing.assert_allclose(pushed.orientation[0], base[0, 3:], atol=1e-14)
