"""The whole jump: it succeeds under noise, repeats bit for bit, and is driven by estimates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.blocks.signals import Phase
from aloft.mathematics.quadratic_program import PACKAGES
from aloft.runtime.loading import check

GRAPHS = Path(aloft.__file__).parent / "graphs"
JUMP = GRAPHS / "jump.yaml"


@pytest.fixture(scope="module")
def jump():
    return aloft.load(JUMP, {"robot.seed": 1000}).run()


def variant(tmp_path, text):
    """A graph that includes the jump, and changes it."""
    path = tmp_path / "variant.yaml"
    path.write_text(f"include: [{JUMP}]\n{text}")
    return path


def test_the_graph_has_no_problems():
    assert check(JUMP).ok


def test_it_jumps_lands_and_recovers(jump):
    assert jump.success, jump.reason
    assert jump.metrics["apex_above_standing_m"] >= 0.11
    assert jump.metrics["apex_from_squat_m"] >= 0.21
    assert jump.metrics["qp_failures"] == 0


def test_other_noise_other_delays():
    result = aloft.load(JUMP, {"robot.seed": 1001}).run(log=False)
    assert result.success, result.reason
    assert result.metrics["apex_above_standing_m"] >= 0.11


def test_the_phases_follow_one_another(jump):
    phases = jump.signal("phase.phase.phase")
    changes = phases[np.flatnonzero(np.diff(phases, prepend=-1))]
    assert changes.tolist() == [
        Phase.STAND, Phase.SQUAT, Phase.THRUST, Phase.FLIGHT, Phase.LANDING, Phase.RECOVER,
    ]  # fmt: skip


def test_the_body_follows_its_plan_off_the_ground(jump):
    """At the planned lift-off speed, height and angular momentum are the plan's."""
    phases = jump.signal("phase.phase.phase")
    last = int(np.argmax(phases == Phase.FLIGHT)) - 1
    found = jump.signal("robot.truth.com_velocity")[last]
    planned = jump.signal("plan.reference.com_velocity")[last]
    assert found == pytest.approx(planned, abs=0.1)
    height = jump.signal("robot.truth.com")[last, 2]
    assert height == pytest.approx(jump.signal("plan.reference.com")[last, 2], abs=0.01)
    momentum = jump.signal("robot.truth.angular_momentum")[last]
    assert momentum == pytest.approx(jump.signal("plan.reference.angular_momentum")[last], abs=0.03)


def test_the_same_seed_gives_the_same_bits_and_another_does_not(jump):
    first, again, other = (
        aloft.load(JUMP, {"robot.seed": seed}).run(duration=0.1) for seed in (1000, 1000, 1003)
    )
    assert first.run_hash == again.run_hash != other.run_hash
    assert first.log.rows().tobytes() == jump.log.rows()[:50].tobytes()


def test_no_controller_reads_the_truth():
    graph = aloft.load(JUMP).checked
    readers = {
        spec.path
        for spec in graph.blocks
        if any(wire.source == "robot.truth" for wire in spec.wires.values())
    }
    assert readers == {"push", "score"}


@pytest.mark.parametrize("trial", ["nominal", "standard", "robust"])
def test_every_trial_sets_only_the_robot(trial, tmp_path):
    path = variant(tmp_path, "")
    path.write_text(f"include: [{JUMP}, {GRAPHS / 'trials' / trial}.yaml]\n")
    assert check(path).ok
    text = (GRAPHS / "trials" / f"{trial}.yaml").read_text()
    settings = [line.strip() for line in text.splitlines() if line.startswith("  ")]
    assert settings
    assert all(line.startswith("robot.") for line in settings)


def test_the_robust_trial(tmp_path):
    path = variant(tmp_path, "")
    path.write_text(f"include: [{JUMP}, {GRAPHS / 'trials' / 'robust'}.yaml]\n")
    result = aloft.load(path, {"robot.seed": 8}).run(log=False)
    assert result.metrics["robot_mass_kg"] != pytest.approx(5.118, abs=1e-3)
    assert result.success, result.reason


@pytest.mark.long
@pytest.mark.parametrize("solver", PACKAGES)
def test_every_solver_jumps_and_finds_the_optimum_in_every_tick(solver):
    result = aloft.load(JUMP, {"wbc.solver": solver}).run(log=False)
    assert result.success, result.reason
    assert result.metrics["qp_failures"] == 0
    assert result.metrics["apex_above_standing_m"] == pytest.approx(0.1193, abs=2e-4)


def test_the_papers_controller_lands():
    """Its order of priorities, torso before angular momentum, and all of its other choices."""
    result = aloft.load(GRAPHS / "paper_jump.yaml", {"robot.seed": 1}).run(log=False)
    assert result.metrics["final_tilt_deg"] < 5.0, result.reason
    assert result.metrics["apex_above_standing_m"] > 0.1
