"""Makes the terminal pictures of the README: ``python docs/make_pictures.py`` from the root."""

from __future__ import annotations

import io
from pathlib import Path

from rich.console import Console

from aloft import LoadError, load
from aloft.cli.graph import print_table
from aloft.cli.output import say
from aloft.cli.run import print_result

FOLDER = Path(__file__).parent
JUMP = FOLDER.parent / "graphs" / "jump.yaml"
MISTAKES = """rate: 500 Hz
duration: 1 s
robot: bruce
blocks:
  imu:      {use: runtime.Constant, with: {value: [0, 0, 9.81]}}
  contacts: {use: blocks.ContactDetecter, in: {switches: robot.contacts}}
  filter:   {use: runtime.Gain, with: {gian: 0.5}, in: {u: imu.z}}
"""


def console(width: int) -> Console:
    """A console that remembers what is printed and shows nothing."""
    return Console(record=True, width=width, file=io.StringIO(), highlight=False)


def save(out: Console, name: str, title: str) -> None:
    """Write what was printed as a picture."""
    out.save_svg(str(FOLDER / name), title=title)


def main() -> None:
    """Make all pictures."""
    graph = load(JUMP)
    result = graph.run()
    out = console(90)
    print_result(out, graph.checked.name, result)
    say(out, f"{'success' if result.success else 'no success'}: {result.reason}")
    save(out, "run.svg", "aloft run graphs/jump.yaml")

    out = console(150)
    print_table(out, graph.checked)
    save(out, "graph.svg", "aloft graph graphs/jump.yaml")

    wrong = Path("wrong.yaml")
    wrong.write_text(MISTAKES)
    try:
        load(wrong)
    except LoadError as error:
        out = console(100)
        out.print(error.report.rich())
        save(out, "check.svg", "aloft check wrong.yaml")
    finally:
        wrong.unlink()


if __name__ == "__main__":
    main()
