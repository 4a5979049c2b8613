"""docs/fmi.md: its graphs, its command lines, and the equality that it promises."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import aloft

pytest.importorskip("fmpy")
pytest.importorskip("pythonfmu3")
PAGE = (Path(__file__).parent.parent / "docs" / "fmi.md").read_text(encoding="utf-8")


@pytest.mark.long
def test_the_page_runs(tmp_path: Path) -> None:
    found = dict(re.findall(r"```(?:yaml|sh) (\w+)\n(.*?)```", PAGE, re.DOTALL))
    assert set(found) == {"controller", "rail", "export", "rail_with_fmu"}
    for name, text in found.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    reference = aloft.load(tmp_path / "rail.yaml").run()
    for line in found["export"].splitlines():
        program, *arguments = line.split()
        module = {"aloft": "aloft", "fmpy": "fmpy"}[program]
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments],
            check=False, cwd=tmp_path, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, (line, done.stdout, done.stderr)
    rows = (tmp_path / "result.csv").read_text().splitlines()
    assert rows[0].replace('"', "") == "time,force"
    assert len(rows) == 52
    result = aloft.load(tmp_path / "rail_with_fmu.yaml").run()
    result.raise_if_failed()
    force = reference.signal("controller/bound.y.value")
    assert np.array_equal(result.signal("controller.force.value"), force)
    assert np.array_equal(result.signal("place.y.value"), reference.signal("place.y.value"))
    assert np.ptp(force) > 5.0
