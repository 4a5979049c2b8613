"""Round friction cones as planes and Newton steps, against the projection onto a cone in closed form."""

import numpy as np
import pytest

from aloft.mathematics.active_set import (
    QuadraticProgram,
    active_set_memory,
    polish,
    recompute_multipliers,
    solve_program,
)
from aloft.mathematics.whole_body_cones import (
    PLANES,
    add_bending,
    add_curvature,
    add_violated_planes,
    cone_memory,
    multiplier_curvature,
    refresh_support_planes,
    turned,
    write_planes,
)


def projected(force, friction):
    """The nearest force in the cone."""
    size, normal = np.hypot(*force[:2]), force[2]
    if size <= friction * normal:
        return force.copy()
    if friction * size <= -normal:
        return np.zeros(3)
    share = (friction * size + normal) / (friction * friction + 1.0)
    return np.array([*(friction * share * force[:2] / size), share])


def project(forces, friction):
    """The same for all forces at once, by planes and Newton steps; returns also the number of steps."""
    count, n = len(forces), 3 * len(forces)
    first = 6 * count  # no rows of pyramids
    program = QuadraticProgram(
        np.eye(n),
        -forces.ravel(),
        np.zeros((first + PLANES * count, n)),
        np.zeros(first + PLANES * count),
    )
    memory, cones, x = active_set_memory(n, len(program.bound)), cone_memory(count), np.zeros(n)
    for point in range(count):
        program.matrix[6 * point + 5, 3 * point + 2] = -1.0
    rows = write_planes(count, n, first, friction, cones, program)
    assert solve_program(n, rows, program, memory, x) >= 0
    add_violated_planes(count, first, friction, 1e-2, cones, program, memory, x)
    for step in range(12):
        held = int(memory.is_active[:rows].sum())
        gradient = x - forces.ravel()
        recompute_multipliers(n, held, gradient, memory)
        multiplier_curvature(count, held, first, cones, memory, x)
        refresh_support_planes(count, friction, 1e-12, cones, x)
        write_planes(count, n, first, friction, cones, program)
        program.hessian[:] = np.eye(n)
        add_curvature(count, cones, program.hessian)
        assert solve_program(n, rows, program, memory, x) >= 0
        gradient = x - forces.ravel()
        add_bending(count, cones, x, gradient)
        polish(n, gradient, memory, x)
        if step and turned(count, friction, cones, x) < 1e-12:
            return x.reshape(-1, 3), step + 1
    raise AssertionError(f"not exact: {turned(count, friction, cones, x)}")


@pytest.mark.parametrize("seed", range(20))
def test_the_nearest_forces_in_cones(seed):
    random = np.random.default_rng(seed)
    forces, friction = random.normal(0.0, 10.0, (4, 3)), random.uniform(0.1, 1.5)
    found, steps = project(forces, friction)
    expected = np.array([projected(force, friction) for force in forces])
    assert found == pytest.approx(expected, abs=1e-9)
    assert steps <= 10


def test_no_more_planes_than_there_is_room_for():
    cones = cone_memory(1)
    for angle in np.linspace(0.0, 6.0, 40):
        cones.curvature[0] = 1.0
        refresh_support_planes(1, 0.5, 1e-12, cones, np.array([np.cos(angle), np.sin(angle), 1.0]))
        assert cones.used[0] <= PLANES
    newest = np.array([np.cos(6.0), np.sin(6.0)])
    along = cones.planes[0, : cones.used[0]] @ newest
    assert along.max() == pytest.approx(1.0)
    refresh_support_planes(1, 0.5, 1e-12, cones, np.array([np.cos(6.001), np.sin(6.001), 1.0]))
    assert (np.abs(cones.planes[0] @ newest - 1.0) < 1e-9).sum() == 0  # one plane, not two near it


def test_a_force_at_the_apex_has_no_direction():
    cones = cone_memory(1)
    program = QuadraticProgram(np.eye(3), np.zeros(3), np.zeros((14, 3)), np.zeros(14))
    nothing = np.array([1e-9, 0.0, -1e-15])
    assert (
        add_violated_planes(1, 6, 0.5, 1e-2, cones, program, active_set_memory(3, 14), nothing) == 0
    )
    assert turned(1, 0.5, cones, nothing) == 0.0
