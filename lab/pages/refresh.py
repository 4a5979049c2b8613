"""Writes what is generated in the pages under docs/.

::

    python lab/pages/refresh.py                    all that needs no file
    python lab/pages/refresh.py NAME [FILE ...]    one of ``PAGES``, from the results of a command

``python lab/pages/refresh.py --help`` names all of them, each with the command that makes its files. What is
written stands in the page between ``<!-- mark -->`` and ``<!-- end of mark -->``.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import study_data
from ending_tables import fault_table, ground_table
from result_tables import (
    FRONTIER_PICTURE,
    GROWTH_PICTURE,
    SEEDS,
    TICK_PICTURE,
    agreement_table,
    comparison_table,
    effects_table,
    every_robot_table,
    frontier_table,
    growth_table,
    mutated_robots_table,
    noted_table,
    quarter_table,
    ratio_table,
    real_table,
    results_table,
    robot_files_table,
    solver_table,
    table,
    tasks_table,
    tick_tables,
    twin_table,
)

from aloft.extensions.commissioning.reach.reach import BRUCE, beside
from aloft.lab.benchmarks.tick.chart import tick_chart
from aloft.lab.figures.growth import growth_chart
from aloft.planner.task.boundary_set import BoundarySet
from aloft.planner.task.margins import Margins
from aloft.planner.task.sequence import Hop, KnownStairs, PhaseSpec, RoughGround
from aloft.planner.task.task import JumpTask, Knots, Weights
from aloft.robots.description import find_robot
from aloft.robots.importing.package_files import find_file
from aloft.runtime.language.parameters import Parameters
from aloft.studies.batch.seeds import run_seeds

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def refresh(page: Path, mark: str, text: str, of: str = "") -> None:
    """Write ``text`` between ``<!-- mark -->`` and ``<!-- end of mark -->`` of a page.

    Args:
        of: what the second mark is the end of, where that is not ``mark`` itself.

    Raises:
        ValueError: the page does not have both marks.
    """
    begin, end = f"<!-- {mark} -->\n", f"<!-- end of {of or mark} -->"
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{page.name} has no {begin.strip()} with an {end} behind it")
    page.write_text(before + begin + text + end + after, encoding="utf-8")


def read_json(path: Path) -> Any:
    """Read a file that a command has written."""
    return json.loads(path.read_text(encoding="utf-8"))


def write_agreement(file: Path) -> None:
    """Write the agreement of the methods of the whole-body controller."""
    refresh(DOCS / "whole_body.md", "agreement", agreement_table(read_json(file)))


def write_comparisons(*folders: Path) -> None:
    """Write the comparisons with other methods, and their pictures."""
    page = DOCS / "comparisons.md"
    for folder in folders:
        found = read_json(folder / "summary.json")
        study = found["study"]
        refresh(page, f"study: {study}", comparison_table(found), of=study)
        for picture in found["plots"]:
            shutil.copyfile(folder / f"{picture}.svg", page.with_name(f"{study}_{picture}.svg"))


EXCERPT = re.compile(r"(<!-- from: (\S+) -->\n```\w+\n)(.*?)(```)", re.DOTALL)


def refreshed_excerpt(match: re.Match[str]) -> str:
    """Return the excerpt as the file has it now. It stays what lies between its first and its last
    line.

    Raises:
        ValueError: its first or its last line is gone.
    """
    head, path, text, tail = match.groups()
    excerpt, lines = text.splitlines(), (ROOT / path).read_text(encoding="utf-8").splitlines()
    first = lines.index(excerpt[0])
    last = lines.index(excerpt[-1], first)
    return head + "\n".join(lines[first : last + 1]) + "\n" + tail


def write_excerpts() -> None:
    """Write the pages' excerpts of files; tests/test_docs.py finds one that is out of date."""
    for page in DOCS.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        page.write_text(EXCERPT.sub(refreshed_excerpt, text), encoding="utf-8")


def write_faults(file: Path) -> None:
    """Write the effects of faults on BRUCE, by the time of their onset."""
    refresh(
        DOCS.parent / "extensions" / "analysis" / "analysis.md",
        "faults",
        fault_table(_runs_of([file])),
    )


def write_wrong_imu(file: Path) -> None:
    """Write the effects of an IMU with wrong units and signs, by the time of their onset."""
    refresh(
        DOCS.parent / "extensions" / "analysis" / "analysis.md",
        "wrong_imu",
        fault_table(_runs_of([file])),
    )


def write_frontier(folder: Path) -> None:
    """Write the reach of jumps, with its picture, and the data beside which other robots' reach is
    drawn."""
    found = read_json(folder / "frontier.json")
    refresh(DOCS / "frontier.md", "frontier", frontier_table(found))
    text = json.dumps(beside(found, find_robot("bruce")), indent=1) + "\n"
    BRUCE.write_text(text, encoding="utf-8")
    shutil.copyfile(folder / FRONTIER_PICTURE, DOCS / FRONTIER_PICTURE)


def write_landing(*files: Path) -> None:
    """Write where the landing laws place the feet after a push: two studies."""
    for mark, file in zip(("", " 12 cm"), files, strict=False):
        refresh(DOCS / "landing.md", "quarters" + mark, quarter_table(read_json(file)["rows"]))


def write_results() -> None:
    """Write the results of the standard trial's reported seeds, which are run for it."""
    rows = list(run_seeds(ROOT / "graphs" / "jump.yaml", [], SEEDS))
    refresh(DOCS / "results.md", "results", results_table(rows))


URDF = "package://example-robot-data/robots/go1_description/urdf/go1.urdf"


def printed_of_robots() -> dict[str, str]:
    """Return the output and the files of ``aloft robot`` for an example, by their names on the
    page."""
    source = find_file(URDF, Path("/"))
    if source is None:
        raise SystemExit("the package example-robot-data is not installed")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copy(source, folder / "go1.urdf")

        def aloft(*arguments: str) -> str:
            command = [sys.executable, "-m", "aloft", "robot", *arguments]
            run = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
            return "\n".join(line.rstrip() for line in run.stdout.splitlines()).strip("\n")

        shown = aloft("show", "go1.urdf")
        aloft("import", "go1.urdf")
        written = (folder / "go1.yaml").read_text(encoding="utf-8").strip("\n")
    return {"robot show go1.urdf": shown, "go1.yaml": written}


def with_printed(page: str, blocks: Mapping[str, str]) -> str:
    """Return the page with the blocks behind their marks."""
    for name, text in blocks.items():
        pattern = rf"(<!-- printed: {re.escape(name)} -->\n```\w*\n).*?(```\n)"
        page = re.sub(pattern, lambda m, t=text: f"{m[1]}{t}\n{m[2]}", page, flags=re.DOTALL)
    return page


def write_robots() -> None:
    """Write the output of ``aloft robot`` for an example; needs the package example-robot-data."""
    page = DOCS / "robots.md"
    text = with_printed(page.read_text(encoding="utf-8"), printed_of_robots())
    page.write_text(text, encoding="utf-8")


TASK_PARAMETERS = "task parameters"


def task_parameter_tables() -> str:
    """Return the tables of everything that a task file may say, from the declarations."""
    parts = []
    for title, owner in (
        ("", JumpTask),
        ("One of `jumps`", Hop),
        ("One of `phases`", PhaseSpec),
        ("`rough`", RoughGround),
        ("`stairs`", KnownStairs),
        ("`knots`", Knots),
        ("`weights`", Weights),
        ("`margins`", Margins),
        ("`bounds`", BoundarySet),
    ):
        head = f"{title}:\n\n" if title else ""
        names = ("parameter", "unit", "default", "bounds", "")
        parts.append(head + table(names, _parameters(owner)))
    return "\n".join(parts)


def _parameters(owner: type[Parameters]) -> Iterator[Sequence[str]]:
    for name, field in owner.model_fields.items():
        extra = field.json_schema_extra
        unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
        default = "required" if field.is_required() else _default(field.default)
        cells = (f"`{name}`", unit, default, _bounds(field.metadata), field.description or "")
        yield [cell.replace("|", "\\|") for cell in cells]


def _default(value: Any) -> str:
    if value is None:
        return "-"
    if hasattr(type(value), "model_fields"):
        return "see below"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _bounds(metadata: Sequence[Any]) -> str:
    signs = (("gt", "> "), ("ge", ">= "), ("lt", "< "), ("le", "<= "))
    found = [
        f"{sign}{getattr(item, key):g}"
        for item in metadata
        for key, sign in signs
        if getattr(item, key, None) is not None
    ]
    return ", ".join(found)


def write_task_parameters() -> None:
    """Write the parameters of a task."""
    refresh(DOCS / "planning.md", TASK_PARAMETERS, task_parameter_tables())


def write_tasks(file: Path) -> None:
    """Write the tasks that BRUCE was tried on."""
    summary = read_json(file)
    refresh(DOCS / "results.md", "tasks", tasks_table(summary))


def write_robots_results(file: Path) -> None:
    """Write the tasks that other robots were tried on."""
    refresh(DOCS / "robots_results.md", "tasks", tasks_table(read_json(file)))


def write_robot_files(file: Path) -> None:
    """Write every robot file of dm_control, Gymnasium and example-robot-data, compared with other readings of it."""
    refresh(DOCS / "robots.md", "robot files", robot_files_table(read_json(file)["rows"]))


def write_every_robot(file: Path) -> None:
    """Write every URDF of example-robot-data, read and put on its feet."""
    refresh(DOCS / "robots_results.md", "every robot", every_robot_table(read_json(file)["rows"]))


def write_mutated_robots(file: Path) -> None:
    """Write the outcomes of real descriptions with one mistake each."""
    text = mutated_robots_table(read_json(file)["rows"])
    refresh(DOCS / "robots_results.md", "mutated robots", text)


def write_effects(file: Path) -> None:
    """Write the change that each effect of a real robot makes to a jump."""
    refresh(DOCS / "real_robots.md", "effects", effects_table(read_json(file)["rows"]))


def write_known_effects(file: Path) -> None:
    """Write the change that each effect makes to a jump of a robot that was calibrated with it."""
    refresh(DOCS / "real_robots.md", "known effects", effects_table(read_json(file)["rows"]))


def write_real(file: Path) -> None:
    """Write robots as a bench finds them, untold, calibrated, and learning."""
    refresh(DOCS / "real_robots.md", "real", real_table(read_json(file)["robots"]))


def write_ground(*files: Path) -> None:
    """Write landings on single unevennesses that are unknown to the controller."""
    refresh(DOCS / "ground.md", "ground", ground_table(_runs_of(files), "ground"))


def write_uneven(*files: Path) -> None:
    """Write jumps in the trial ``uneven``."""
    refresh(DOCS / "ground.md", "uneven", ground_table(_runs_of(files), "task"))


def write_slopes(*files: Path) -> None:
    """Write landings on slopes, untold and told."""
    refresh(DOCS / "ground.md", "slopes", ground_table(_runs_of(files), "ground"))


def _runs_of(files: Sequence[Path]) -> list[dict[str, Any]]:
    """Read all runs of studies, of which ``files`` are the summaries."""
    from pyarrow import parquet

    return [
        run for file in files
        for run in parquet.read_table(file.with_name("runs.parquet")).to_pylist()
    ]  # fmt: skip


def write_late(file: Path) -> None:
    """Write late sensors, told and not told."""
    refresh(DOCS / "real_robots.md", "late", effects_table(read_json(file)["rows"]))


def write_export(file: Path) -> None:
    """Write the duration of a tick of the exported library."""
    refresh(
        DOCS.parent / "extensions" / "export" / "c_library.md",
        "export",
        ratio_table(read_json(file)),
    )


def write_tick(file: Path) -> None:
    """Write the duration of a tick, with a picture."""
    found = read_json(file)
    refresh(DOCS / "compiled.md", "tick", tick_tables(found))
    (DOCS / TICK_PICTURE).write_text(tick_chart(found["rows"]), encoding="utf-8")


def write_growth(file: Path) -> None:
    """Write the growth curves: their data file, table and picture."""
    benchmark = "lab/benchmarks/growth.py"
    data = {
        "study": benchmark, "commit": study_data.git(ROOT, "rev-parse", "HEAD"),
        "measures": [benchmark], "pages": ["docs/compiled.md"], **read_json(file),
    }  # fmt: skip
    study_data.write(ROOT, "growth", data)
    refresh(DOCS / "compiled.md", "data: growth", growth_table(data))
    (DOCS / GROWTH_PICTURE).write_text(growth_chart(data["rows"]), encoding="utf-8")


def write_solvers(file: Path) -> None:
    """Write the duration of a tick with every solver of quadratic programs."""
    refresh(DOCS / "whole_body.md", "solvers", solver_table(read_json(file)))


def write_paper_solvers(file: Path) -> None:
    """Write the solvers on the paper's planning problem."""
    refresh(DOCS / "planning.md", "paper solvers", noted_table(read_json(file), "start, solver"))


def write_paper_plans(file: Path) -> None:
    """Write what plans of the paper's problem ask of the motors."""
    text = noted_table(read_json(file), "a jump of 12 cm in place, or as named")
    refresh(DOCS / "planning.md", "paper plans", text)


def write_twin(file: Path) -> None:
    """Write the twin beside the simulation; ``runs.parquet`` beside the summary says which seeds
    differ."""
    from pyarrow import parquet

    runs = parquet.read_table(file.with_name("runs.parquet")).to_pylist()
    refresh(
        DOCS.parent / "extensions" / "commissioning" / "bring_up.md",
        "twin",
        twin_table(read_json(file)["rows"], runs),
    )


class Page(NamedTuple):
    """A part of the pages: the function that writes it, and the command that makes its files."""

    write: Callable[..., None]
    command: str = ""
    files: str = ""


STUDIES = "aloft study graphs/studies/"
PAGES = {
    "agreement": Page(write_agreement, "aloft bench agreement --json > FILE", "FILE"),
    "comparisons": Page(
        write_comparisons, f"{STUDIES}formulations.yaml", "results/formulations ..."
    ),
    "effects": Page(write_effects, f"{STUDIES}effects.yaml", "results/effects/summary.json"),
    "every_robot": Page(write_every_robot, "aloft bench every_robot --json > FILE", "FILE"),
    "robot_files": Page(write_robot_files, "aloft bench robot_files --json > FILE", "FILE"),
    "mutated_robots": Page(
        write_mutated_robots, "aloft bench mutated_robots --json > FILE", "FILE"
    ),
    "excerpts": Page(write_excerpts),
    "export": Page(write_export, "aloft bench export --tsid FOLDER --json > FILE", "FILE"),
    "faults": Page(write_faults, f"{STUDIES}faults.yaml", "results/faults/summary.json"),
    "wrong_imu": Page(
        write_wrong_imu, f"{STUDIES}wrong_imu.yaml", "results/wrong_imu/summary.json"
    ),
    "frontier": Page(write_frontier, "aloft bench frontier", "results/frontier"),
    "growth": Page(write_growth, "aloft bench growth --since COMMIT --json > FILE", "FILE"),
    "ground": Page(write_ground, f"{STUDIES}ground.yaml", "results/ground/summary.json"),
    "known_effects": Page(
        write_known_effects, "aloft bench known_effects", "results/real_robot/effects.json"
    ),
    "landing": Page(
        write_landing,
        f"{STUDIES}push_polar.yaml and push_polar_12cm.yaml",
        "results/push_polar/summary.json results/push_polar_12cm/summary.json",
    ),
    "late": Page(write_late, f"{STUDIES}late_sensors.yaml", "results/late_sensors/summary.json"),
    "real": Page(write_real, "aloft bench real_robot", "results/real_robot/results.json"),
    "results": Page(write_results),
    "robots": Page(write_robots),
    "robots_results": Page(
        write_robots_results, f"{STUDIES}robots.yaml", "results/robots/summary.json"
    ),
    "slopes": Page(write_slopes, f"{STUDIES}slopes.yaml", "results/slopes/summary.json"),
    "task_parameters": Page(write_task_parameters),
    "tasks": Page(write_tasks, f"{STUDIES}tasks.yaml", "results/tasks/summary.json"),
    "paper_plans": Page(write_paper_plans, "aloft bench paper_plans --json > FILE", "FILE"),
    "paper_solvers": Page(write_paper_solvers, "aloft bench paper_solvers --json > FILE", "FILE"),
    "solvers": Page(write_solvers, "aloft bench solvers --json > FILE", "FILE"),
    "tick": Page(write_tick, "aloft bench tick --tsid FOLDER --since COMMIT --json > FILE", "FILE"),
    "twin": Page(write_twin, f"{STUDIES}twin.yaml", "results/twin/summary.json"),
    "uneven": Page(write_uneven, f"{STUDIES}uneven.yaml", "results/uneven/summary.json"),
}


def usage() -> str:
    """List all pages, and the command that makes each."""
    lines = []
    for name, page in PAGES.items():
        lines.append(f"{name}: {page.write.__doc__}")
        if page.files:
            lines += [f"    {page.command}", f"    python lab/pages/refresh.py {name} {page.files}"]
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    """Write what the arguments name. Returns the process's exit code."""
    if not arguments:
        for page in PAGES.values():
            if not page.files:
                page.write()
        return 0
    name, *files = arguments
    if name not in PAGES or bool(files) != bool(PAGES[name].files):
        print(usage(), file=sys.stdout if name == "--help" else sys.stderr)
        return 0 if name == "--help" else 2
    PAGES[name].write(*map(Path, files))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
