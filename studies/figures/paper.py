"""Draws all figures of the paper from our runs and plans, with our numbers beside the paper's.

``draw`` writes the pictures and returns the content of ``paper.json``, from which ``page`` is made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...robots.description import find_robot
from ..expansion import load_cell
from .jump_curves import draw_jump, jump_numbers
from .offscreen import NoRendererError, View
from .push_curves import draw_push, push_numbers
from .strip import Moment, Motion, draw_strip, moments_of

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

    from ...hal.simulated.scenes import Scene
    from ...robots.description import RobotDescription
    from ..expansion import Cell
    from ..summary import Row
    from .trace import Trace

JUMP, FORWARD, TURN, STEP = "in-situ jump", "forward jump", "turn", "step up"
SOMERSAULT = "somersault in place"
ARMS = ("heuristic off", "the paper's law", "deviation law")
PLANNED = "somersault_forward_35cm"
"""The task of the somersault that is shown as a plan."""
FILES = {
    "jump": "paper_jump.png",
    "push": "paper_push.png",
    "step": "paper_step.png",
    "somersault": "paper_somersault.png",
    "somersault_in_place": "paper_somersault_in_place.png",
}
KEPT = (
    "apex_above_standing_m", "apex_from_squat_m", "flight_time_s", "lift_off_speed_m_s",
    "peak_tilt_deg", "jump_distance_x_m", "jump_yaw_deg", "peak_motor_torque_nm", "peak_motor_speed_rad_s",
)  # fmt: skip


def push_task(direction: str, arm: str) -> str:
    """The name of a push in the study."""
    return f"push {direction}, {arm}"


def draw(
    traces: Mapping[str, Trace], rows: Sequence[Row], seeds: Sequence[int], out: Path
) -> dict[str, Any]:
    """Draw all figures into the folder ``out``. A figure that cannot be drawn has the ``reason`` instead."""
    from PIL import Image

    robot = find_robot("bruce")
    by_task = {row.cell.task: row for row in rows}
    drawings: dict[str, Callable[[], tuple[Picture, Mapping[str, Any]]]] = {
        "jump": lambda: (draw_jump(traces[JUMP], robot), jump_numbers(traces[JUMP])),
        "push": lambda: _push(traces),
        "step": lambda: _frames(
            "Jump onto a 5 cm step",
            traces[STEP],
            by_task[STEP],
            View((0.06, 0.0, 0.27), 1.25),
            robot,
        ),
        "somersault": lambda: _plan(robot),
        "somersault_in_place": lambda: _frames(
            "Somersault in place",
            traces[SOMERSAULT],
            by_task[SOMERSAULT],
            View((0.05, 0.0, 0.32), 1.6),
            robot,
        ),
    }
    figures: dict[str, Any] = {}
    for name, drawing in drawings.items():
        figures[name] = {"file": FILES[name], "drawn": True, "reason": "", "numbers": {}}
        try:
            picture, numbers = drawing()
        except (NoRendererError, NotThereError) as error:
            figures[name] |= {"drawn": False, "reason": str(error)}
            continue
        # few colours are enough for lines and capsules: a third of the bytes
        small = picture.quantize(256, dither=Image.Dither.NONE)
        small.save(out / FILES[name], optimize=True)
        figures[name] |= {"size": list(picture.size), "numbers": rounded(numbers)}
    return {
        "study": "graphs/studies/paper.yaml",
        "seeds": list(seeds),
        "figure_seed": seeds[0],
        "tasks": {task: _row_json(row, traces[task]) for task, row in by_task.items()},
        "figures": figures,
    }


class NotThereError(NoRendererError):
    """Raised if there is no plan to draw."""


def _row_json(row: Row, trace: Trace) -> dict[str, Any]:
    return {
        "n": row.n,
        "successes": row.successes,
        "ci_low": round(row.ci_low, 3),
        "ci_high": round(row.ci_high, 3),
        "reasons": dict(row.reasons),
        "medians": rounded({k: row.metrics[k].median for k in KEPT if k in row.metrics}),
        "shown": {"success": trace.outcome.success, "reason": trace.outcome.reason},
    }


def _push(traces: Mapping[str, Trace]) -> tuple[Picture, Mapping[str, Any]]:
    arms = {arm: [traces[push_task(way, arm)] for way in ("+x", "+y")] for arm in ARMS}
    numbers = {
        push_task(way, arm): rounded(push_numbers(found[axis], axis))
        for arm, found in arms.items()
        for axis, way in enumerate(("+x", "+y"))
    }
    return draw_push(arms), numbers


def _frames(
    title: str, trace: Trace, row: Row, view: View, robot: RobotDescription
) -> tuple[Picture, Mapping[str, Any]]:
    """The figure of a run as frames."""
    names = ("base_position", "base_orientation", "joint_position")
    motion = Motion(trace.time, *(trace.truth(name) for name in names))
    end = float(trace.time[-1])
    flight = trace.flight_times
    if flight:
        moments = moments_of(min(0.4, flight[0]), *flight, end)
    else:
        moments = [Moment(t, f"{t:.2f} s") for t in np.linspace(0.0, end, 8).tolist()]
    verdict = "succeeds" if trace.outcome.success else f"no success: {trace.outcome.reason}"
    notes = [
        f"Closed loop, standard trial, seed {trace.seed}: {verdict}.",
        f"{row.successes} of {row.n} seeds succeed.",
    ]
    numbers = {"flight_s": flight[1] - flight[0]} if flight else {}
    picture = draw_strip(title, notes, motion, moments, robot, scene_of(row.cell), view)
    return picture, numbers


def _plan(robot: RobotDescription) -> tuple[Picture, Mapping[str, Any]]:
    """The figure of a planned somersault as frames."""
    from ...hal.simulated.scenes import flat, platform
    from ...planner.library.library import SHIPPED, PlanLibrary
    from ...planner.task.read_task import read_task

    task = read_task(SHIPPED.parent / "tasks" / f"{PLANNED}.yaml")
    plan = PlanLibrary(robot).find(task)
    if plan is None:
        raise NotThereError(f"there is no plan of {PLANNED}; make it with 'aloft plan'")
    height = -float(task.landing_height)
    scene = platform(height, float(task.step_edge or 0.1)) if height > 0.0 else flat()
    motion = Motion(plan.time, plan.position[:, :3], plan.position[:, 3:7], plan.position[:, 7:])
    lift_off, touchdown = plan.lift_off_time, plan.touchdown_time
    times = [
        0.7 * lift_off,
        *np.linspace(lift_off, touchdown, 6).tolist(),
        float(plan.time[-1]),
    ]
    names = ["thrust", "lift-off", *["flight"] * 4, "touchdown", "end of the plan"]
    moments = [Moment(t, f"{t:.2f} s  {text}") for t, text in zip(times, names, strict=True)]
    middle = 0.5 * (motion.base[0] + motion.base[-1])
    view = View((float(middle[0]), 0.0, float(motion.base[:, 2].mean())), 1.7 + height)
    verdict = "passes" if plan.valid else "does NOT pass"
    notes = [
        (
            "The PLAN, not a run: its knots posed by the simulator's model. "
            f"It {verdict} the check with exact dynamics, motors '{task.profile}'."
        )
    ]
    numbers = {"profile": task.profile, "valid": plan.valid, "flight_s": touchdown - lift_off}
    title = "Somersault off the 35 cm platform"
    return draw_strip(title, notes, motion, moments, robot, scene, view), numbers


def scene_of(cell: Cell) -> Scene:
    """The ground that a cell's simulated robot jumps on."""
    checked = load_cell(cell.graph, cell.include, cell.overrides, cell.origin).checked
    params: Any = next(spec.params for spec in checked.blocks if spec.path == "robot")
    scene: Scene = params.build_scene()
    return scene


def rounded(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers with four significant digits, so that noise does not change files."""
    return {
        name: float(f"{value:.4g}") if isinstance(value, float) else value
        for name, value in numbers.items()
    }
