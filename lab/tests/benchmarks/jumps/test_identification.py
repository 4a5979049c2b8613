"""What a calibration misses is told from what the simulator drew, by quantity, with its goal."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.extensions.commissioning.identification.calibration import Calibration, Value
from aloft.lab.benchmarks.jumps import identification
from aloft.lab.benchmarks.jumps.identification import QUANTITIES, Quantity, errors_of, row_of
from aloft.lab.studies.oracle import oracle_values
from aloft.runtime.graph import Graph


@pytest.fixture(scope="module")
def graph() -> Graph:
    return aloft.load("aloft:commissioning/calibrate").with_seed(5)


def found_exactly(graph: Graph, **changed: Any) -> Calibration:
    """A calibration without errors, with standard deviations of a hundredth."""
    true, robot = oracle_values(graph), graph.checked.robot
    assert robot is not None
    angles = true["timing.position"]

    def one(value: float) -> Value:
        return Value(value=value, std=0.01)

    def named(values: dict[str, float]) -> dict[str, Value]:
        return {name: one(value) for name, value in values.items()}

    def beyond(name: str, nominal: np.ndarray) -> dict[str, Value]:
        pairs = zip(robot.joints, nominal, strict=True)
        return named({joint.name: each + true[name][joint.name] for joint, each in pairs})

    constants = true["robot.motor_model.torque_constant"]
    mean = float(np.mean([*constants.values()]))
    values = {
        "robot": robot.name, "friction": beyond("weight.friction", robot.motors.friction),
        "damping": beyond("weight.damping", robot.motors.damping),
        "torque_constant": named({name: each / mean for name, each in constants.items()}),
        "saturation": one(true["robot.motor_model.saturation"]),
        "load_friction": one(true["robot.motor_model.load_friction"]),
        "rotor_inertia": one(float(np.mean([*true["dynamics.rotor_inertia"].values()]))),
        "mass": one(robot.total_mass),
        "imu_position": tuple(map(one, true["timing.imu_position"])),
        "imu_rotation": tuple(map(one, true["timing.imu_rotation"])),
        "gyro_age": one(true["timing.rate"] - angles),
        "accelerometer_age": one(true["timing.force"] - angles),
        "velocity_age": one(true["timing.velocity"] - angles),
        "play": named(dict.fromkeys([joint.name for joint in robot.joints], true["timing.play"])),
        "resistance": one(true["safety.pack_resistance"]),
    }  # fmt: skip
    return Calibration(**values | changed)


def test_what_is_found_exactly_has_no_errors(graph: Graph) -> None:
    errors = errors_of(found_exactly(graph), graph)
    assert set(errors) == {each.name for each in QUANTITIES}
    for values, claimed in errors.values():
        assert np.allclose(values, 0.0, atol=1e-9)
        assert min(claimed) > 0.0


def test_errors_are_in_the_unit_of_the_goal(graph: Graph) -> None:
    exact = found_exactly(graph)
    wrong = exact.model_copy(
        update={
            "gyro_age": Value(value=exact.gyro_age.value + 3e-4, std=1e-4),
            "friction": {
                name: Value(value=0.9 * each.value, std=0.0)
                for name, each in exact.friction.items()
            },
            "resistance": None,
        }
    )
    errors = errors_of(wrong, graph)
    assert errors["age of the gyroscope"] == ([pytest.approx(0.3)], [pytest.approx(0.1)])
    assert errors["friction, a joint"][0] == pytest.approx([-10.0] * len(wrong.friction))
    assert "resistance of the pack" not in errors


def test_a_row_has_the_root_mean_square_and_how_much_is_within_goal_and_claim() -> None:
    row = row_of(Quantity("age", "ms", 0.2), [([0.1, -0.3], [0.1, 0.1]), ([0.1, 0.1], [0.1, 0.1])])
    assert row.value == pytest.approx(np.sqrt(0.03))
    assert row.met
    assert "2 robots" in row.note
    assert "75% within two of them; 75% within the goal" in row.note
    assert not row_of(Quantity("age", "ms", 0.2), [([0.3], [0.1])]).met


def test_each_robot_is_kept_and_a_failure_is_no_row(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    errors = {each.name: ([0.1], [0.1]) for each in QUANTITIES}
    monkeypatch.setattr(identification, "FOLDER", tmp_path)
    monkeypatch.setattr(identification, "job_results", lambda *_, **__: results(["", ""], errors))
    rows = identification.identification([3, 1])
    assert [row.name for row in rows] == [each.name for each in QUANTITIES]
    assert [*json.loads((tmp_path / "identification.json").read_text())["robots"]] == ["1", "3"]
    monkeypatch.setattr(
        identification, "job_results", lambda *_, **__: results(["it fell"], errors)
    )
    with pytest.raises(RuntimeError, match="it fell"):
        identification.identification([3])


def results(errors: list[str], value: Any) -> Iterator[Any]:
    """Results of jobs, as a generator that can be closed."""
    for index, error in enumerate(errors):
        yield SimpleNamespace(index=index, error=error, value=value)
