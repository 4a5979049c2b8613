"""The steps on the ground: standing, sitting down, a squat, and hops of rising height.

Every step hangs the robot up and runs a graph as ``aloft run`` does, with the file of the hardware. The
person lowers the robot when its drives hold the pose. The graph judges itself by what the robot knows,
and at its end the robot sits down.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import yaml

from ....hal.bear.protocol import Torque
from ....hal.sitting import sitting_path
from ....mathematics.arrays import Array
from .session import Request, Session, StepReport

STAND, HOP = "aloft:commissioning/bring_up_stand", "aloft:commissioning/bring_up_hop"
"""The graphs of these steps."""
SQUAT_DEPTH = 0.05
"""Depth of the squat [m]."""
HOPS = (0.02, 0.05, 0.08, 0.12)
"""Rise of the centre of mass in each hop [m]."""
HEADROOM = 1.5
"""The share of the planned rise that the time in the air may show at most."""
SAT_WITHIN = 0.35
"""Largest distance of a joint from the end of the way down [rad]: drives in damping give way."""


def stand(session: Session) -> StepReport:
    """Stand on four loaded switches after being lowered."""
    return _run(session, STAND, "stand", {})


def sit(session: Session) -> StepReport:
    """Stand once more, and look how the robot has sat down at the end."""
    report = _run(session, STAND, "stand, then sit down", {"score.judge_time": 2.0})
    if not report.passed:
        return report
    robot, hardware = session.robot, session.hardware
    states = {
        name: session.bus.read(hardware.motors[name].id, "torque_enable")["torque_enable"]
        for name in session.motors
    }
    running = [name for name, state in states.items() if state == Torque.ON]
    if running:
        report.add(
            "drives", "all drives in damping", f"{', '.join(running)} still on",
            "`aloft robot estop`, then --first watchdog",
        )  # fmt: skip
    wanted = sitting_path(robot).pose[-1]
    off = session.joint_positions() - wanted
    report.values["off_rad"] = _by_joint(session, off)
    for joint, angle in zip(robot.joints, off.tolist(), strict=True):
        if abs(angle) > SAT_WITHIN:
            report.add(
                joint.name, f"the lowest pose within {SAT_WITHIN:g} rad", f"{angle:+.2f} rad off",
                "it fell, or the way down was blocked: see the recording of the run",
            )  # fmt: skip
    return report


def squat(session: Session) -> StepReport:
    """Squat and rise."""
    depth = {"plan.squat_depth": SQUAT_DEPTH, "score.squat_depth": SQUAT_DEPTH}
    return _run(session, STAND, f"squat by {100.0 * SQUAT_DEPTH:g} cm", depth)


def hop(rise: float) -> Callable[[Session], StepReport]:
    """Return the step of a hop in which the centre of mass rises by so much [m]."""

    def step(session: Session) -> StepReport:
        text = f"hop by {100.0 * rise:g} cm"
        report = _run(session, HOP, text, {"plan.task.rise": rise})
        seen = float(report.values.get("observed_rise_m", 0.0))
        if report.passed and seen > HEADROOM * max(rise, 0.03):
            report.add(
                "hop", f"a rise of {100.0 * rise:.0f} cm", f"{100.0 * seen:.1f} cm by its time in the air",
                "torque constants or masses are wrong: --first motors",
            )  # fmt: skip
        return report

    return step


def _run(session: Session, graph: str, what: str, settings: Mapping[str, Any]) -> StepReport:
    """Have the robot hung up and the motion confirmed, run the graph, and note its outcome."""
    report = StepReport()
    session.do(
        Request(
            "ready", what,
            f"next the robot will {what}: hang it up with its soles 2 to 10 cm above even ground; when "
            "its legs are stiff lower it until the ropes are slack by 10 cm, and keep hold of them",
        )
    )  # fmt: skip
    given: dict[str, Any] = dict(settings)
    if session.friction_file.exists():
        given |= yaml.safe_load(session.friction_file.read_text(encoding="utf-8"))["set"]
    result = session.run_graph(graph, given)
    keep = ("observed_flight_s", "observed_rise_m", "observed_depth_m", "observed_tilt_deg",
            "drives_at_end", "lost_answers")  # fmt: skip
    report.values |= {"graph": graph, "settings": given, "reason": result.reason}
    report.values |= {name: result.metrics[name] for name in keep if name in result.metrics}
    if not result.success:
        report.add(
            "run", f"a robot that will {what}", result.reason,
            "see its recording beside the file of the hardware; mend what it names, or go back with --from",
        )  # fmt: skip
    return report


def _by_joint(session: Session, values: Array) -> dict[str, float]:
    names = [joint.name for joint in session.robot.joints]
    return dict(zip(names, np.round(values, 3).tolist(), strict=True))
