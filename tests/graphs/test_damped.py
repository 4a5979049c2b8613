"""A run that the safety monitor has damped is no success, also in a graph without criteria."""

import pytest

import aloft


@pytest.mark.long
def test_a_sway_that_falls_is_no_success() -> None:
    """An accelerometer that speaks in g: the estimate tilts, and the robot is damped."""
    fault = {"on": "robot.imu.specific_force", "kind": "scaled", "factor": 0.102, "start": 0.0}
    graph = {"include": ["aloft:sway"], "robot": "bruce", "faults": {"g": fault}}
    result = aloft.load({**graph, "rate": "500 Hz", "duration": "1 s"}).run()
    assert result.metrics["safety_fault"] == "tilt" and not result.success
    time = result.metrics["safety_fault_time_s"]
    assert result.reason == (
        f"safety: the base leant more than `tilt_limit`; the robot was damped from {time:.6g} s on"
    )
