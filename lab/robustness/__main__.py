"""Repeats what is tried to break runs, within 30 minutes: ``python -m aloft.lab.robustness``.

It prints the tables of ``docs/compiled.md`` (lateness, damaged caches), how a jump of the twin with warm
windings ends, and runs the study of IMUs with wrong units and signs with four seeds. It ends with 1 if a
part did not end with success or within its time.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

GRAPHS = Path(__file__).parents[2] / "graphs"
WARM = [
    "robot.actuators.windings.temperature=50",
    "robot.actuators.windings.ambient=45",
    "robot.actuators.windings.copper=0.0039 1/K",
]


def commands(folder: str) -> list[tuple[str, list[str], int]]:
    """Return what is run: a title, the arguments of Python, and the longest time [s]."""
    settings = [word for setting in WARM for word in ("--set", setting)]
    twin = ["-m", "aloft", "run", str(GRAPHS / "jump_twin.yaml"), "--no-record", *settings]
    study = ["-m", "aloft", "study", str(GRAPHS / "studies" / "wrong_imu.yaml")]
    return [
        ("late ticks", ["-m", "aloft.lab.robustness.lateness"], 180),
        ("damaged caches", ["-m", "aloft.lab.robustness.caches", "1"], 720),
        ("warm windings of the twin", twin, 120),
        ("wrong IMUs", [*study, "--seeds", "99000:99004", "--out", folder], 720),
    ]


def main() -> int:
    """Run everything, one after the other; return the exit code."""
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for title, words, limit in commands(f"{folder}/wrong_imu"):
            print(f"\n# {title}", flush=True)
            try:
                done = subprocess.run([sys.executable, *words], check=False, timeout=limit)
                failed |= done.returncode != 0
            except subprocess.TimeoutExpired:
                print(f"not done within {limit} s", flush=True)
                failed = 1
    return failed


if __name__ == "__main__":
    sys.exit(main())
