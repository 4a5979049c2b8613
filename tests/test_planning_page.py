"""docs/planning.md is true: its files plan, its table is the declarations', its code reads a plan."""

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import aloft
from aloft.planner.library.library import SHIPPED
from aloft.planner.task.read_task import read_task
from aloft.studies.batch.plan_grid import read_grid

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "planning.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", PAGE, re.DOTALL))


def test_the_table_of_parameters_is_up_to_date(docs_script: Callable[[str], ModuleType]) -> None:
    script = docs_script("refresh")
    written = PAGE.partition(f"<!-- {script.TASK_PARAMETERS} -->\n")[2]
    written = written.partition(f"<!-- end of {script.TASK_PARAMETERS} -->")[0]
    assert written == script.task_parameter_tables(), "run: make docs"


def test_the_task_and_the_grid_are_what_the_page_says(tmp_path: Path) -> None:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    hop = read_task(tmp_path / "hop.yaml")
    assert (hop.name, hop.rise, hop.distance_x) == ("hop", 0.12, 0.08)
    assert hop.twist == pytest.approx(0.1745, abs=1e-4)
    grid = read_grid(tmp_path / "grid.yaml")
    assert len(grid) == 15
    assert {task.friction for task in grid} == {0.6}


def test_a_plan_is_read_as_the_page_shows() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    names: dict[str, Any] = {"path": next(SHIPPED.glob("in_situ-*.npz"))}
    exec(code, names)  # noqa: S102  # the page that users copy from
    assert "aloft" not in code
    assert names["header"]["names"]["joints"][0] == "right_hip_yaw"


def test_commands_of_the_page_have_options_that_are_there() -> None:
    from typer.main import get_command

    from aloft.cli import make_app

    commands = get_command(make_app()).commands  # type: ignore[attr-defined]
    known = {option for verb in ("plan", "jump", "run") for parameter in commands[verb].params
             for option in (*parameter.opts, *parameter.secondary_opts)}  # fmt: skip
    prose = PAGE.partition("The cluster needs")[0]
    used = set(re.findall(r"--[a-z][a-z-]+", prose))
    assert used <= known, used - known


@pytest.mark.long
@pytest.mark.parametrize("seed", [9000, 9001])
def test_the_task_of_the_page_lands(tmp_path: Path, seed: int) -> None:
    task = tmp_path / "hop.yaml"
    task.write_text(FILES["hop.yaml"])
    sets = {"plan.task": str(task), "plan.library": str(tmp_path / "kept"), "robot.seed": seed}
    result = aloft.load(ROOT / "graphs" / "jump.yaml", sets).run(log=False)
    assert result.success, result.reason
