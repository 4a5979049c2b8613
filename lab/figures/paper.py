"""Draws all figures of the paper from our runs and plans, with our numbers beside the paper's.

``draw`` writes the pictures and returns the content of ``paper.json``, from which ``page`` is made.

The page of the figures, made of ``paper.json`` alone: no number in it is written by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...robots.description import find_robot
from ...studies.expansion import load_cell
from ...studies.offscreen import NoRendererError, View
from .curves import draw_jump, draw_push, jump_numbers, push_numbers
from .strip import Moment, Motion, draw_strip, moments_of

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

    from ...robots.description import RobotDescription
    from ...robots.terrain import Terrain
    from ...studies.expansion import Cell
    from ...studies.summary import StudyRow
    from .trace import Trace


JUMP, FORWARD, TURN, STEP = "in-situ jump", "forward jump", "turn", "step up"
SOMERSAULT, OFF = "somersault in place", "somersault off 35 cm"
ARMS = ("without the law", "the paper's law", "the shipped law")
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
    """Return the name of a push in the study."""
    return f"push {direction}, {arm}"


def draw(
    traces: Mapping[str, Trace],
    rows: Sequence[StudyRow],
    stands: Mapping[str, int],
    seeds: Sequence[int],
    out: Path,
) -> dict[str, Any]:
    """Draw all figures into the folder ``out``. A figure that cannot be drawn has the ``reason`` instead.

    Args:
        stands: how many runs of each task stand at the end.
    """
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
        "somersault": lambda: _frames(
            "Somersault off a 35 cm platform",
            traces[OFF],
            by_task[OFF],
            View((0.15, 0.0, 0.30), 2.05),
            robot,
        ),
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
        except NoRendererError as error:
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
        "tasks": {
            task: _row_json(row, traces[task]) | {"stands": stands.get(task, 0)}
            for task, row in by_task.items()
        },
        "figures": figures,
    }


def _row_json(row: StudyRow, trace: Trace) -> dict[str, Any]:
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
    title: str, trace: Trace, row: StudyRow, view: View, robot: RobotDescription
) -> tuple[Picture, Mapping[str, Any]]:
    """Draw the figure of a run as frames."""
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


def scene_of(cell: Cell) -> Terrain:
    """Return the ground that a cell's simulated robot jumps on."""
    checked = load_cell(cell.graph, cell.include, cell.overrides, cell.origin, cell.behind).checked
    params: Any = next(spec.params for spec in checked.blocks if spec.path == "robot")
    scene: Terrain = params.build_scene(None)
    return scene


def rounded(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Round the numbers to four significant digits, so that noise does not change files."""
    return {
        name: float(f"{value:.4g}") if isinstance(value, float) else value
        for name, value in numbers.items()
    }


Results = Mapping[str, Any]


def page(results: Results) -> str:
    """Write the whole page as Markdown."""
    seeds = results["seeds"]
    parts = [
        "# The paper's figures, from our runs",
        (
            "Made by `aloft study paper`, numbers and text alike; `paper.json` beside it holds the "
            "numbers. The runs are those of `graphs/studies/paper.yaml`: the whole closed loop with "
            "noise, latency and jitter (the standard trial) and, except where it says the paper's, the shipped controller, seeds "
            f"{seeds[0]} to {seeds[-1]}, on which nothing was tuned. There are few of them: the pictures "
            "show what happens, and success rates to compare with are the other studies'. All pictures show "
            f"seed {results['figure_seed']}, whatever came of it. The code is that of commit {results['commit'][:8]}. The paper's numbers are those of its "
            "section VI (Gazebo, or the robot); its pictures have no numbers that could be read off."
        ),
        _jump(results),
        _page_push(results),
        _step(results),
        _somersault(results),
    ]
    return "\n\n".join(parts) + "\n"


def _jump(results: Results) -> str:
    task, figure = results["tasks"][JUMP], results["figures"]["jump"]
    numbers, medians = figure["numbers"], task["medians"]
    rows = [
        ("CoM z change, squat to apex [cm]", "15", _number(numbers, "com_squat_to_apex_cm")),
        ("apex above standing [cm]", "-", _scaled(medians, "apex_above_standing_m", 100.0)),
        ("flight [s]", "-", _number(numbers, "flight_s")),
        (
            "torso pitch change in flight [deg]",
            "decreases",
            _number(numbers, "pitch_change_in_flight_deg"),
        ),
        (
            "of that planned [deg]",
            "-",
            _number(numbers, "planned_pitch_change_in_flight_deg"),
        ),
        ("k_y in flight, mean [N m s]", "not negligible", _number(numbers, "k_y_in_flight_nms")),
        ("k_y in the thrust, at most [N m s]", "-", _number(numbers, "k_y_at_most_in_thrust_nms")),
        ("largest joint torque [N m]", "-", _number(numbers, "peak_joint_torque_nm")),
        ("largest joint velocity [rad/s]", "-", _number(numbers, "peak_joint_velocity_rad_s")),
    ]
    forward, turn = results["tasks"][FORWARD], results["tasks"][TURN]
    further = [
        ("forward [cm]", "10", _scaled(forward["medians"], "jump_distance_x_m", 100.0)),
        ("twist [deg]", "30", _scaled(turn["medians"], "jump_yaw_deg", 1.0)),
    ]
    return "\n\n".join(
        [
            "## In-situ jump",
            _picture(figure, "CoM, momenta, joint velocities and torques over an in-situ jump"),
            table(rows),
            (
                f"{_successes(task)} The apex is the median over the seeds, all else is of the run "
                "shown, with the shipped controller. The CoM is tracked closely in height. The torso's turn in flight is what the "
                "plan asks for, against the legs' at nearly no angular momentum; in the paper it is what the "
                "momentum left over at lift-off makes, which the shipped controller does not leave."
            ),
            "The other basic jumps, medians over the seeds:",
            table(further),
            f"Forward: {_successes(forward)} Twist: {_successes(turn)}",
        ]
    )


def _page_push(results: Results) -> str:
    figure = results["figures"]["push"]
    numbers = figure["numbers"]
    measured = numbers[push_task("+x", ARMS[-1])]
    sideways = numbers[push_task("+y", ARMS[-1])]
    rows = [
        ("push on the torso, 0.01 s [N]", "70", "70"),
        ("after lift-off [s]", "0.03", "0.03"),
        ("flight [s]", "about 0.2", _number(measured, "flight_s")),
        ("CoM velocity change, +x push [m/s]", "-", _number(measured, "com_velocity_change_m_s")),
        (
            "k_y change, +x push [N m s]",
            "increases",
            _number(measured, "angular_momentum_change_nms"),
        ),
        ("k_x change, +y push [N m s]", "-", _number(sideways, "angular_momentum_change_nms")),
    ]
    head = "| arm | +x: left foot wanted / moved [cm] | +y: left foot wanted / moved [cm] | +y: right foot wanted / moved [cm]"
    feet = [f"{head} | +x stand, succeed | +y stand, succeed |"]
    feet.append("|---|---|---|---|---|---|")
    for arm in ARMS:
        ahead, aside = numbers[push_task("+x", arm)], numbers[push_task("+y", arm)]
        tasks = [results["tasks"][push_task(way, arm)] for way in ("+x", "+y")]
        counts = " | ".join(
            f"{task['stands']}, {task['successes']} of {task['n']}" for task in tasks
        )
        feet.append(
            f"| {arm} | {_moved(ahead, 'left')} | {_moved(aside, 'left')} | "
            f"{_moved(aside, 'right')} | {counts} |"
        )
    return "\n\n".join(
        [
            "## Push recovery",
            _picture(figure, "Velocity, angular momentum and feet in flight after a push"),
            table(rows),
            "\n".join(feet),
            (
                "Wanted and moved are from the push to touchdown, seen from the CoM along the push. *Without the law* and "
                "*the paper's law* are the paper's whole controller (`graphs/paper_push.yaml`): feet in the planned body, no steps after "
                "touchdown; all that differs is its momentum feedback. *The shipped law* is `graphs/push.yaml`, with the shipped controller "
                "and steps. To *stand* is not to fall and to end within 5 degrees of upright, which is the paper's criterion in words. To "
                "*succeed* is the score's, which also wants 90 % of the planned flight, and that a law which spreads the feet of a robot "
                "that turns cuts short. One factor at a time and more seeds: [the landing study](landing.md#the-papers-push-test). In the "
                "paper a +y push moves the left foot a lot and the right foot little, because the clearance term adds for one and "
                "subtracts for the other."
            ),
        ]
    )


def _step(results: Results) -> str:
    task, figure = results["tasks"][STEP], results["figures"]["step"]
    state = (
        "The whole closed loop does it."
        if task["successes"] == task["n"]
        else "**This does not work reliably in closed loop yet**; the frames show the run as it went."
    )
    return "\n\n".join(
        [
            "## Step jump",
            _picture(figure, "Frames of a jump onto a step"),
            table([("step height [cm]", "5", "5"), ("succeed", "yes", _share(task))]),
            f"{state} {_successes(task)} The run shown: {task['shown']['reason']}.",
        ]
    )


def _somersault(results: Results) -> str:
    task, fall = results["tasks"][SOMERSAULT], results["tasks"][OFF]
    off, place = (results["figures"][n] for n in ("somersault", "somersault_in_place"))
    rows = [
        ("in place: succeed", "yes", _share(task)),
        ("in place: flight [s]", "-", _number(place["numbers"], "flight_s")),
        ("in place: motors", "relaxed limits", "the robot's"),
        ("off a platform [cm]", "35", "35"),
        ("off a platform: succeed", "yes", _share(fall)),
        ("off a platform: flight [s]", "-", _number(off["numbers"], "flight_s")),
        ("off a platform: motors", "the robot's", "the robot's"),
    ]
    in_place = (
        "In place (`graphs/somersault.yaml`). "
        f"{_successes(task)} The run shown: {task['shown']['reason']}. The paper needed relaxed torque limits for it, and this "
        "robot does not. That rests on the speeds of its motors, which nobody has measured: full torque up to 18 rad/s and none "
        "at 30 are estimates (`robots/bruce/bruce.yaml`)."
    )
    platform = (
        "Off the platform of the paper's Fig. 1 (`graphs/somersault_forward_35cm.yaml`), a run, too. "
        f"{_successes(fall)} The run shown: {fall['shown']['reason']}."
    )
    return "\n\n".join(
        [
            "## Somersaults",
            _picture(place, "Frames of a somersault in place in closed loop"),
            in_place,
            _picture(off, "Frames of a somersault off a platform in closed loop"),
            platform,
            table(rows),
        ]
    )


def table(rows: Sequence[tuple[str, str, str]]) -> str:
    """Format rows of quantity, the paper's value and ours."""
    lines = ["| | paper | ours |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {what} | {paper} | {ours} |" for what, paper, ours in rows)])


def _picture(figure: Mapping[str, Any], words: str) -> str:
    if figure["drawn"]:
        return f"![{words}]({figure['file']})"
    return f"*Not drawn: {figure['reason']}.*"


def _number(numbers: Mapping[str, float], name: str) -> str:
    if name not in numbers:
        return "-"
    return f"{numbers[name]:.3g}" if abs(numbers[name]) >= 0.001 else "0"


def _scaled(numbers: Mapping[str, float], name: str, scale: float) -> str:
    return f"{scale * numbers[name]:.3g}" if name in numbers else "-"


def _moved(numbers: Mapping[str, float], foot: str) -> str:
    wanted, moved = _number(numbers, f"{foot}_foot_wanted_cm"), f"{foot}_foot_moved_cm"
    return f"{wanted} / {_number(numbers, moved)}"


def _share(task: Mapping[str, Any]) -> str:
    return f"{task['successes']} of {task['n']}"


def _successes(task: Mapping[str, Any]) -> str:
    low, high = round(100 * task["ci_low"]), round(100 * task["ci_high"])
    return f"{_share(task)} seeds succeed (95 % interval of the rate: {low} to {high} %)."
