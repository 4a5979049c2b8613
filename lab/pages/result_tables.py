"""The tables of the pages that are made of the results of studies and benchmarks; see ``refresh``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from aloft.lab.benchmarks.tick.chart import BARS
from aloft.lab.figures.growth import measured, seconds
from aloft.studies.batch.seeds import SeedRow
from aloft.studies.summary import wilson_interval

Row = Mapping[str, Any]
"""A row of a summary or of a benchmark."""


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table in Markdown."""
    return "".join(map(_line, [head, ["---"] * len(head), *rows]))


def _line(cells: Sequence[str]) -> str:
    if all(cell == "---" for cell in cells):
        return "|" + "---|" * len(cells) + "\n"
    return f"| {' | '.join(cells)} |\n"


def percent(share: float) -> str:
    """Format a share as whole percents."""
    return f"{100.0 * share:.0f} %"


def interval(row: Row) -> str:
    """Format the interval of a row's success rate."""
    return f"{percent(row['ci_low'])} to {percent(row['ci_high'])}"


def succeeded(row: Row) -> str:
    """Format the number of a row's runs that succeeded."""
    return f"{row['successes']} of {row['n']}"


AGREEMENT_HEAD = ("programs", "method", "largest error of a torque [N m]", "not solved", "")


def agreement_table(found: Row) -> str:
    """Format a line for every method and set of programs: the largest error, and the number left
    unsolved."""
    lines = []
    rows = {row["name"]: row for row in found["rows"]}
    for name, row in rows.items():
        what, _, rest = name.partition(": ")
        method, _, kind = rest.partition(", largest error")
        if name.endswith(", largest error") and not kind:
            unsolved = rows[f"{what}: {method}, not solved"]["value"]
            lines.append((what, method, f"{row['value']:.1e}", f"{unsolved:.0f}", row["note"]))
        elif not rest:
            lines.append((what, "", "", "", f"{row['value']:.0f} programs, {row['note']}"))
    return table(AGREEMENT_HEAD, lines)


Column = tuple[str, str, str, float]
"""Heading, metric, another one to take off its median, factor to the heading's unit."""

JUMP: tuple[Column, ...] = (
    ("pitch momentum at lift-off [N m s]", "lift_off_pitch_momentum_nms", "", 1.0),
    ("peak tilt after touchdown [deg]", "peak_tilt_deg", "", 1.0),
    ("apex error [cm]", "apex_above_standing_m", "planned_apex_above_standing_m", 100.0),
)
BASE: tuple[Column, ...] = (
    ("velocity in flight [mm/s]", "estimator_velocity_flight_rms_m_s", "", 1e3),
    ("velocity at touchdown [mm/s]", "estimator_velocity_touchdown_m_s", "", 1e3),
    ("position at touchdown [mm]", "estimator_position_touchdown_m", "", 1e3),
    ("attitude in flight [mrad]", "estimator_attitude_flight_rms_rad", "", 1e3),
    ("attitude at touchdown [mrad]", "estimator_attitude_touchdown_rad", "", 1e3),
)
COLUMNS = {"formulations": JUMP, "estimator": BASE}
"""The metrics that a study's table shows."""
AXES = ("jump", "task", "arm")
"""Axes that distinguish the rows of a table, where they differ."""


def comparison_table(summary: Row) -> str:
    """Format one row a cell: the numbers of runs that succeeded and fell, and medians with their 5
    % and 95 %."""
    rows, columns = summary["rows"], COLUMNS[summary["study"]]
    axes = [axis for axis in AXES if len({row.get(axis) for row in rows}) > 1]
    rows = sorted(rows, key=lambda row: [_place(rows, axis, row) for axis in axes])
    head = [*axes, "succeeded", "95 % interval", "fell", *(column[0] for column in columns)]
    lines = []
    for row in rows:
        fell = sum(n for reason, n in row["reasons"].items() if reason.startswith("fell"))
        figures = (_figures(row, *column[1:]) for column in columns)
        places = (row[axis] for axis in axes)
        lines.append((*places, succeeded(row), interval(row), str(fell), *figures))
    return table(head, lines)


def _place(rows: Sequence[Row], axis: str, row: Row) -> int:
    """Return the index of the row's value on an axis of the study."""
    return list(dict.fromkeys(other[axis] for other in rows)).index(row[axis])


def _figures(row: Row, metric: str, less: str, factor: float) -> str:
    """Format median and the two quantiles, with the number of runs that have them where not all do."""
    metrics = row["metrics"]
    if metric not in metrics:
        return "-"
    found = metrics[metric]
    offset = metrics[less]["median"] if less else 0.0
    ends = (found[end] - offset for end in ("median", "low", "high"))
    middle, low, high = (round(factor * end, 6) + 0.0 for end in ends)  # no minus zero
    missing = f", {found['n']} runs" if found["n"] < row["n"] else ""
    return f"{middle:.3g} ({low:.3g} to {high:.3g}{missing})"


FRONTIER_PICTURE = "frontier.svg"
FRONTIER_HEAD = (
    "direction", "lands at 95 %", "runs", "95 % interval", "next that fails, and why", "planned",
    "theory", "what binds there",
)  # fmt: skip


def frontier_table(found: Row) -> str:
    """Format the conditions of the measurement, and one row a direction."""
    seeds = found["seeds"]
    return (
        f"{len(seeds)} seeds a value, {seeds[0]} to {seeds[-1]}.\n\n"
        f"![How far jumps reach in every direction]({FRONTIER_PICTURE})\n\n"
        + table(FRONTIER_HEAD, map(_direction, found["directions"]))
    )


def _direction(each: Row) -> Sequence[str]:
    unit, runs, fails = each["unit"], "-", "-"
    reached, between = "nothing", "-"
    if each["runs"]:
        reached = f"{each['reached']:g} {unit}"
        runs = f"{each['landed']} of {each['runs']}"
        between = interval(each)
    if each["gaps"]:
        reached += f" (but not {', '.join(f'{gap:g}' for gap in each['gaps'])})"
    if each["fails_at"] is not None:
        landed = "" if each["fails_landed"] is None else " ({} of {})".format(*each["fails_landed"])
        fails = f"{each['fails_at']:g} {unit}{landed}: {each['why']}"
    ends = [
        f"{each[key]:g} {unit}" + ("" if each[f"{key}_ended"] else " or more")
        for key in ("planned", "theory")
    ]
    name = f"{each['name']}: {each['what']}"
    return (name, reached, runs, between, fails, *ends, each["binds"] or "-")


QUARTERS = {"ahead": 0, "left": 90, "back": 180, "right": 270}
"""Each with the directions within 45 degrees of it, those at its edges counted half on each side."""


def values_of(rows: Sequence[Row], name: str) -> list[Any]:
    """Return the values that a study has of something, in its order."""
    return list(dict.fromkeys(row[name] for row in rows))


def rate(successes: float, runs: float) -> str:
    """Format a success rate in percent, or a dash where nothing was run."""
    return percent(successes / runs) if runs else "-"


def quarter_table(rows: Sequence[Row]) -> str:
    """Format success over all impulses, a column a quarter of the directions."""
    lines = []
    for arm in values_of(rows, "arm"):
        cells = []
        for middle in QUARTERS.values():
            done = n = 0.0
            for row in rows:
                away = abs((row["direction_deg"] - middle + 180) % 360 - 180)
                if row["arm"] == arm and away <= 45:
                    share = 0.5 if away == 45 else 1.0
                    done, n = done + share * row["successes"], n + share * row["n"]
            cells.append(rate(done, n))
        lines.append((arm, *cells))
    return table(("arm", *QUARTERS), lines)


SEEDS = range(6000, 6020)  # chosen before looking, and never run while anything was tuned
FIGURES = (
    ("apex_above_standing_m", "apex above standing", 100.0, "cm", "10.8 to 13.2"),
    ("apex_from_squat_m", "apex from squat", 100.0, "cm", "at least 15"),
    ("lift_off_speed_m_s", "take-off speed", 1.0, "m/s", ""),
    ("touchdown_speed_m_s", "touchdown speed", 1.0, "m/s", ""),
    ("flight_time_s", "flight", 1000.0, "ms", ""),
    ("peak_tilt_deg", "peak tilt", 1.0, "deg", "below 15"),
    ("final_tilt_deg", "tilt 1.5 s after touchdown", 1.0, "deg", "below 5"),
    ("foot_slip_m", "feet slip", 1000.0, "mm", "below 5"),
    ("peak_motor_torque_nm", "peak motor torque", 1.0, "N m", ""),
    ("peak_motor_speed_rad_s", "peak motor speed", 1.0, "rad/s", ""),
    ("qp_failures", "QP failures", 1.0, "", "0"),
)


def results_table(rows: Sequence[SeedRow]) -> str:
    """Format the table of least, median and greatest over the seeds."""
    lines = []
    for name, text, scale, unit, goal in FIGURES:
        values = [row.metrics[name] * scale for row in rows if name in row.metrics]
        numbers = (f"{each:.3g}" for each in (min(values), median(values), max(values)))
        lines.append((text, *numbers, unit, goal))
    return (
        f"{_successes(rows)}.\n\n"
        + table(("", "least", "median", "greatest", "unit", "goal"), lines)
        + f"\n`aloft run graphs/jump.yaml --seeds {SEEDS.start}:{SEEDS.stop}` repeats it.\n"
    )


def _successes(rows: Sequence[SeedRow]) -> str:
    successes = sum(row.success for row in rows)
    seeds = f"seeds {SEEDS[0]} to {SEEDS[-1]}"
    return f"Jump on the spot, {seeds}: **{successes} of {len(rows)} succeed**"


TASKS_HEAD = ("task", "succeeded", "95 % interval", "goal")


def tasks_table(summary: Row) -> str:
    """Format one row a task: the number of its runs that succeeded, and the interval of the rate."""
    return table(TASKS_HEAD, map(_task, summary["rows"]))


def every_robot_table(rows: Sequence[Row]) -> str:
    """Format one row a file: its joints, and the outcome."""
    return table(
        ("file", "joints", "what became of it"),
        (
            (row["name"], "" if row["value"] is None else f"{row['value']:.0f}", row["note"])
            for row in rows
        ),
    )


def robot_files_table(rows: Sequence[Row]) -> str:
    """Format one row a file: its largest difference to MuJoCo's or Pinocchio's reading, and what becomes of it."""
    return table(
        ("file", "largest difference", "what becomes of it"),
        (
            (row["name"], "" if row["value"] is None else f"{row['value']:.0e}", row["note"])
            for row in rows
            if row["name"] not in ("files that differ", "kinds on purpose")
        ),
    )


def mutated_robots_table(rows: Sequence[Row]) -> str:
    """Format one row a kind of mistake, with the outcomes of its cases in each format; none where a
    format has no such kind.

    The rows are those of ``aloft bench mutated_robots``, called ``FORMAT: KIND``.
    """
    found: dict[str, dict[str, str]] = {}
    formats: dict[str, None] = {}
    for row in rows:
        name, colon, kind = row["name"].partition(": ")
        if colon and row["value"] is not None:
            found.setdefault(kind, {})[name] = row["note"]
            formats[name] = None
    whole = {kind: found.pop(kind) for kind in ("all of them",)}
    return table(
        ("what was made wrong", *formats),
        (
            (kind, *(notes.get(name, "") for name in formats))
            for kind, notes in (found | whole).items()
        ),
    )


def _task(row: Row) -> Sequence[str]:
    goal = f"{percent(row['goal'])}, {'met' if row['met'] else 'missed'}"
    return (row["task"], succeeded(row), interval(row), goal)


TICK_PICTURE = "tick.svg"
TICK_HEAD = ("", "median", "as many times as fast as", "times", "floor", "goal", "")
REACHED, FLOOR, MISSED = "goal reached", "floor reached", "missed"


def tick_tables(found: Row) -> str:
    """Format the conditions of the measurement, the picture, and two tables: of blocks, and of
    ratios."""
    rows: Sequence[Row] = found["rows"]
    blocks = {prefix: _blocks(rows, prefix) for prefix, _ in BARS}
    shown = [(prefix, label) for prefix, label in BARS if blocks[prefix]]
    times = [
        (f"`{block}`", *(_time(blocks[prefix].get(block)) for prefix, _ in shown))
        for block in blocks["block "]
    ]
    ratios = [_ratio(row) for row in rows if not row["name"].startswith(tuple(blocks))]
    return (
        f"{_circumstances(found)}\n\n"
        f"![The blocks of one tick in all tiers]({TICK_PICTURE})\n\n"
        + table(("median [us]", *(label for _, label in shown)), times)
        + "\n"
        + table(TICK_HEAD, ratios)
    )


def ratio_table(found: Row) -> str:
    """Format the conditions of the measurement, and one row each."""
    return f"{_circumstances(found)}\n\n" + table(TICK_HEAD, map(_ratio, found["rows"]))


GROWTH_PICTURE = "growth.svg"


def growth_table(data: Row) -> str:
    """Format the picture and the ends of every curve: by how much the work and its time grow, and the ratios to the earlier build."""
    lines = []
    for curve in measured(data["rows"]):
        few, many = curve.points[0], curve.points[-1]
        ratios = [f"{curve.times[k] / curve.earlier[k]:.2f}" for k in (0, -1) if curve.earlier]
        lines.append(
            (
                f"{curve.work}: {few:,} to {many:,} {curve.over}",
                f"{seconds(curve.times[0])} to {seconds(curve.times[-1])}",
                f"{many / few:.1f}",
                f"{curve.times[-1] / curve.times[0]:.1f}",
                " to ".join(ratios),
            )
        )
    since = data["rows"][0]["peer"][:8]
    head = ("", "processor time", "times as many", "times the time", f"by {since}")
    return (
        f"{_circumstances(data)} Code of commit {data['commit'][:8]}.\n\n"
        f"![What grows with what]({GROWTH_PICTURE})\n\n" + table(head, lines)
    )


def solver_table(found: Row) -> str:
    """Format the ticks with every solver: microseconds, the ratio to the own one's, and how far their torques are apart."""
    cells = []
    for row in found["rows"]:
        if row["value"] is not None:
            ratio = "1" if row["ratio"] is None else f"{row['ratio']:.3g}"
            cells.append(
                [row["name"].removeprefix("tick, "), f"{row['value']:.3g}", ratio, row["note"]]
            )
    return f"{_circumstances(found)}\n\n" + table(("tick", "us", "ratio", ""), cells)


def noted_table(found: Row, head: str) -> str:
    """Format a benchmark's rows: what it is, value, ratio to the first row of its kind, and the note."""
    cells = []
    for row in found["rows"]:
        value = "-" if row["value"] is None else f"{row['value']:.3g} {row['unit']}"
        ratio = "" if row["ratio"] is None else f"{row['ratio']:.3g}"
        cells.append([row["name"], value, ratio, row["note"]])
    if not any(ratio for _, _, ratio, _ in cells):
        return table((head, "", ""), [[name, value, note] for name, value, _, note in cells])
    return table((head, "", "ratio", ""), cells)


def _circumstances(found: Row) -> str:
    machine, load = found["machine"], found["load"]
    return (
        f"{machine['processor']}, {machine['cores']} cores, Python {machine['python']}; load before "
        f"{load['before'][0]:g}, after {load['after'][0]:g}. Ratios bear load well, times do not."
    )


def _time(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"


def _blocks(rows: Sequence[Row], prefix: str) -> dict[str, float]:
    return {r["name"][len(prefix) :]: r["value"] for r in rows if r["name"].startswith(prefix)}


def _ratio(row: Row) -> Sequence[str]:
    unit = row["unit"].removesuffix("/tick")
    value = "-" if row["value"] is None else f"{row['value']:.4g} {unit}"
    cells = [row["name"], value, row["peer"]]
    for key in ("ratio", "floor", "goal"):
        number = row[key]
        if number is None:
            cells.append("")
        else:
            cells.append(f"{1.0 / number:.3g}" if row["peer"] else f"{number:g} {row['unit']}")
    return (*cells, "; ".join(filter(None, (_outcome(row), row["note"]))))


def _outcome(row: Row) -> str:
    measured = row["ratio"] if row["peer"] else row["value"]
    if row["met"] is False and row["floor"] is not None and measured <= row["floor"]:
        return FLOOR
    return {True: REACHED, False: MISSED, None: ""}[row["met"]]


ARMS = ("simulation", "twin")
RISE, TILT = "apex_above_standing_m", "peak_tilt_deg"
TWIN_HEAD = (
    "task", "simulation", "twin", "rise: simulation, twin", "tilt: simulation, twin",
    "seeds that differ",
)  # fmt: skip
Pair = tuple[Row, Row]
"""Two rows of the table of runs, one an arm: ``task``, ``arm``, ``seed``, ``success``, ``reason``."""


def pairs_of(runs: Sequence[Row]) -> dict[str, list[Pair]]:
    """Return for each task the runs of both arms with the same seed, by seed."""
    found: dict[str, dict[int, dict[str, Row]]] = {}
    for run in runs:
        found.setdefault(run["task"], {}).setdefault(run["seed"], {})[run["arm"]] = run
    return {
        task: [(both[ARMS[0]], both[ARMS[1]]) for both in seeds.values() if len(both) == len(ARMS)]
        for task, seeds in found.items()
    }


def twin_table(rows: Sequence[Row], runs: Sequence[Row]) -> str:
    """Format one row a task that both arms ran, the runs that differ, and the verdict over all of
    them."""
    by_task: dict[str, dict[str, Row]] = {}
    for row in rows:
        by_task.setdefault(row["task"], {})[row["arm"]] = row
    pairs = pairs_of(runs)
    shown = [task for task, arms in by_task.items() if len(arms) == len(ARMS) and pairs.get(task)]
    lines = []
    for task in shown:
        arms = [by_task[task][arm] for arm in ARMS]
        rises = ", ".join(_mean(row, RISE, 100.0, "cm") for row in arms)
        tilts = ", ".join(_highest(pairs[task], k) for k in range(len(ARMS)))
        differ = ", ".join(str(one["seed"]) for one, _ in _unlike(pairs[task]))
        lines.append((task, *map(succeeded, arms), rises, tilts, differ or "-"))
    return table(TWIN_HEAD, lines) + "\n" + _verdict({task: pairs[task] for task in shown})


def effects_table(rows: Sequence[Row]) -> str:
    """Format one row an effect, one column a task."""
    tasks = list(dict.fromkeys(row["task"] for row in rows))
    by_effect: dict[str, dict[str, Row]] = {}
    for row in rows:
        by_effect.setdefault(row["effect"], {})[row["task"]] = row
    return table(
        ("effect", *tasks),
        [(effect, *(succeeded(of[task]) for task in tasks)) for effect, of in by_effect.items()],
    )


def real_table(robots: Sequence[Mapping[str, Any]]) -> str:
    """Format one row a kind of jump, one column an arm: the number of robots that land, at each
    time."""
    arms = list(robots[0]["arms"])
    rows = []
    for kind in robots[0]["arms"][arms[0]]:
        cells = [kind]
        for arm in arms:
            runs = [robot["arms"][arm][kind] for robot in robots if arm in robot["arms"]]
            times = [sum(run[k]["success"] for run in runs) for k in range(len(runs[0]))]
            low, high = wilson_interval(times[-1], len(runs))
            cells.append(
                f"{', '.join(map(str, times))} of {len(runs)} ({100 * low:.0f} to {100 * high:.0f} %)"
            )
        rows.append(cells)
    return table(("", *arms), rows)


def equally_likely(first: int, second: int) -> float:
    """Compute the probability of a split at least as uneven as ``first`` to ``second`` between two
    sides that are equally likely: McNemar's exact test, on both sides."""
    n, least = first + second, min(first, second)
    return min(1.0, 2.0 * math.fsum(math.comb(n, k) for k in range(least + 1)) / 2.0**n)


def _unlike(pairs: Sequence[Pair]) -> list[Pair]:
    """Return the pairs of which one run succeeded."""
    return [pair for pair in pairs if pair[0]["success"] != pair[1]["success"]]


def _verdict(pairs: Mapping[str, Sequence[Pair]]) -> str:
    """Return the runs that differ, each with its reason, and McNemar's test over all pairs."""
    every = [pair for group in pairs.values() for pair in group]
    if not every:
        raise ValueError("no task was run by both arms with the same seed")
    good = [sum(pair[k]["success"] for pair in every) for k in range(len(ARMS))]
    only = [sum(pair[k]["success"] for pair in _unlike(every)) for k in range(len(ARMS))]
    seeds = sorted({pair[0]["seed"] for pair in every})
    text = (
        f"{_range(seeds)}. In all {good[0]} of {len(every)} runs succeed in simulation and {good[1]} on the twin: "
        f"{only[0]} of the pairs only in simulation, {only[1]} only on the twin."
    )
    if sum(only):
        text += (
            " If both succeeded equally often, a split at least as uneven would have the probability "
            f"{equally_likely(*only):.2g} (McNemar's exact test)."
        )
    lines = [text, ""]
    for task, group in pairs.items():
        for one, other in _unlike(group):
            arm, failed = (ARMS[0], one) if other["success"] else (ARMS[1], other)
            lines.append(f"- {task}, seed {one['seed']}: only the {arm} fails, {failed['reason']}")
    return "\n".join(lines).rstrip() + "\n"


def _range(seeds: Sequence[int]) -> str:
    return f"Seed {seeds[0]}" if len(seeds) == 1 else f"Seeds {seeds[0]} to {seeds[-1]}"


def _mean(row: Row, name: str, scale: float, unit: str) -> str:
    figures = row["metrics"].get(name)
    return "-" if figures is None else f"{scale * figures['mean']:.1f} {unit}"


def _highest(pairs: Sequence[Pair], arm: int) -> str:
    """Format the highest value over the runs that succeeded: a robot that has fallen says nothing
    about the others."""
    values = [pair[arm][TILT] for pair in pairs if pair[arm]["success"] and pair[arm].get(TILT)]
    return f"{max(values):.0f} deg" if values else "-"
