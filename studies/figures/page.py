"""The page of the figures, made of ``paper.json`` alone: no number in it is written by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .paper import ARMS, FORWARD, JUMP, SOMERSAULT, STEP, TURN, push_task

Results = Mapping[str, Any]


def page(results: Results) -> str:
    """The whole page as Markdown."""
    seeds = results["seeds"]
    parts = [
        "# The paper's figures, from our runs",
        (
            "Made by `aloft study paper`, numbers and text alike; `paper.json` beside it holds the "
            "numbers. The runs are those of `graphs/studies/paper.yaml`: the whole closed loop with "
            "noise, latency and jitter (the standard trial), seeds "
            f"{seeds[0]} to {seeds[-1]}, on which nothing was tuned. There are few of them: the pictures "
            "show what happens, and success rates to compare with are the other studies'. All pictures show "
            f"seed {results['figure_seed']}, whatever came of it. The paper's numbers are those of its "
            "section VI (Gazebo, or the robot); its pictures have no numbers that could be read off."
        ),
        _jump(results),
        _push(results),
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
        ("k_y in flight, mean [N m s]", "not negligible", _number(numbers, "k_y_in_flight_nms")),
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
                "shown. The CoM is tracked closely in height; angular momentum about y is what the "
                "plan's is until lift-off and then stays at what lift-off left."
            ),
            "The other basic jumps, medians over the seeds:",
            table(further),
            f"Forward: {_successes(forward)} Twist: {_successes(turn)}",
        ]
    )


def _push(results: Results) -> str:
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
    feet = [
        "| arm | +x: left foot wanted / moved [cm] | +y: left foot wanted / moved [cm] | +y: right foot wanted / moved [cm] | +x succeed | +y succeed |"
    ]
    feet.append("|---|---|---|---|---|---|")
    for arm in ARMS:
        ahead, aside = numbers[push_task("+x", arm)], numbers[push_task("+y", arm)]
        tasks = [results["tasks"][push_task(way, arm)] for way in ("+x", "+y")]
        counts = " | ".join(f"{task['successes']} of {task['n']}" for task in tasks)
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
                "Wanted and moved are from the push to touchdown, seen from the CoM along the push; "
                "without the heuristic the feet follow the plan in the body's frame. *The paper's law* "
                "feeds back all momentum and keeps the feet's targets in the planned body, with gains "
                "found by hand, as the paper gives none; *the deviation law*, ours, feeds back what "
                "the plan did not intend and keeps the targets in the world. In the paper a +y push "
                "moves the left foot a lot and the right foot little, because the clearance term adds "
                "for one and subtracts for the other."
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
    task = results["tasks"][SOMERSAULT]
    off, place = (results["figures"][n] for n in ("somersault", "somersault_in_place"))
    rows = [
        ("in place: succeed", "yes", _share(task)),
        ("in place: flight [s]", "-", _number(place["numbers"], "flight_s")),
        ("in place: motors", "relaxed limits", "the robot's"),
        ("off a platform [cm]", "35", "35"),
        ("off a platform: flight [s]", "-", _number(off["numbers"], "flight_s")),
        ("off a platform: motors", "the robot's", str(off["numbers"].get("profile", "-"))),
    ]
    closed = (
        "In place it runs in closed loop (`graphs/somersault.yaml`). "
        f"{_successes(task)} The run shown: {task['shown']['reason']}."
    )
    planned = (
        "**The frames off the platform are of the plan, not of a run**; "
        "`graphs/somersault_forward_35cm.yaml` follows it in closed loop."
    )
    return "\n\n".join(
        [
            "## Somersaults",
            _picture(place, "Frames of a somersault in place in closed loop"),
            closed,
            _picture(off, "Frames of a planned somersault off a platform"),
            planned,
            table(rows),
        ]
    )


def table(rows: Sequence[tuple[str, str, str]]) -> str:
    """Rows of quantity, the paper's value and ours."""
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
