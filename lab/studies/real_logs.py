"""The tables and pictures of docs/real_logs.md: estimators, dynamics and a swing-up on logs of real robots, and drawn walks.

::

    python -m aloft.lab.studies.real_logs            # writes tables and pictures; some minutes
    python -m aloft.lab.studies.real_logs --print    # prints the tables
    python -m aloft.lab.studies.real_logs dynamics swing_up   # only these parts

It needs ``shared/data`` beside the project's folder, whose logs are public (``docs/real_logs.md`` says where).
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from pathlib import Path

from ...plotting import Curve, Panel, save_panels
from . import DATA, ROOT, drawn_walks, icub_estimators, pendulum_dynamics, swing_up

PARTS = ("estimators", "starts", "walks", "dynamics", "swing_up")


def _dynamics(picture: Path | None) -> Iterator[str]:
    found = pendulum_dynamics.identified()
    if picture is not None:
        time, seen, predicted = pendulum_dynamics.held_out_curves(found)
        panels = [
            Panel(f"torque of joint {j + 1} [N m]",
                  [Curve("measured", time, seen[:, j]), Curve("by the fit", time, predicted[:, j])])
            for j in (0, 1)
        ]  # fmt: skip
        save_panels(panels, "A swing-up that the fit did not see, below 10 Hz", picture)
    yield from pendulum_dynamics.rows(found)


def main() -> None:
    """Write the tables and pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "parts", nargs="*", choices=[*PARTS, []], help="parts to make; all by default"
    )
    parser.add_argument("--print", action="store_true", help="print the tables, write nothing")
    arguments = parser.parse_args()
    if not DATA.is_dir():
        raise SystemExit(
            "there is no folder shared/data beside the project's: see docs/real_logs.md"
        )
    docs = ROOT / "docs"
    for part in arguments.parts or PARTS:
        picture = None if arguments.print else docs / f"real_logs_{part}.svg"
        if part == "estimators":
            lines = icub_estimators.rows()
            if picture is not None:
                icub_estimators.draw(picture)
        elif part == "starts":
            lines = icub_estimators.start_rows()
        elif part == "walks":
            lines = drawn_walks.rows()
        elif part == "dynamics":
            lines = _dynamics(picture)
        else:
            lines = swing_up.rows(picture)
        text = "\n".join(lines)
        if arguments.print:
            print(text, flush=True)
            continue
        page = docs / "real_logs.md"
        mark = re.compile(rf"(<!-- {part} -->\n).*?(<!-- end of {part} -->)", re.DOTALL)
        written = page.read_text()
        before, after = mark.split(written)[0], mark.split(written)[-1]
        found = mark.search(written)
        assert found is not None
        page.write_text(f"{before}{found[1]}{text}\n{found[2]}{after}")


if __name__ == "__main__":
    main()
