"""Tables are read part by part: what they have does not depend on where parts end, and memory hardly exceeds the numbers'."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aloft.hal.log import tables
from aloft.hal.log.log_file import LogError, read_log

READ = """
import pathlib, sys
from aloft.hal.log.log_file import read_log
import pyarrow.csv, pyarrow.parquet, aloft.hal.log.tables
def memory(of):
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(of))
before = memory("VmRSS:")
log = read_log(pathlib.Path(sys.argv[1]))
print((memory("VmHWM:") - before) / sum(each.values.nbytes for each in log.arrays.values()))
"""


def rows_of(monkeypatch: pytest.MonkeyPatch, part: int, file: Path) -> dict[str, list[float]]:
    monkeypatch.setattr(tables, "_PART", part)
    return {name: each.values[:, 0].tolist() for name, each in read_log(file).arrays.items()}


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_parts_end_anywhere(tmp_path, monkeypatch, end):
    lines = ["t;n;late;day;flag;mixed"]
    for k in range(60):
        late = "" if k < 30 else f"{k},5"
        day = "" if k < 20 else f"2026-11-29 11:05:{k % 60:02d}"
        lines.append(f"{k};{k if k < 40 else f'{k},25'};{late};{day};{str(k % 2 > 0).lower()}; {k}" + " " * (k % 3))  # fmt: skip
        if k % 7 == 0:
            lines += ["# a remark", "", ""]
    file = tmp_path / "log.csv"
    file.write_text(end.join(lines), newline="")
    whole = rows_of(monkeypatch, 10**6, file)
    assert set(whole) == {"t", "n", "late", "day", "flag", "mixed"}
    assert whole["n"][39:42] == [39.0, 40.25, 41.25] and whole["late"][29:31] == [pytest.approx(np.nan, nan_ok=True), 30.5]  # fmt: skip
    for part in (1, 7, 64, 333):
        found = rows_of(monkeypatch, part, file)
        assert {name: pytest.approx(rows, nan_ok=True) for name, rows in whole.items()} == found


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (["0,1"] * 30 + ["1,stop"], "q is text: row 30 has 'stop'"),
        (["0,1"] * 30 + ["1"], "line 32 has 1 values, and the header 2 names"),
        (["0,1"] * 30 + ["1,2026-11-29 11:05:00"], "q has numbers first, and moments from row 30 on"),
        (["0,"] * 30, "q is empty"),
    ],
)  # fmt: skip
def test_a_mistake_behind_many_parts_says_its_row(tmp_path, monkeypatch, rows, said):
    monkeypatch.setattr(tables, "_PART", 3)
    (tmp_path / "log.csv").write_text("\n".join(["t,q", *rows]))
    with pytest.raises(LogError, match=said):
        read_log(tmp_path / "log.csv").array("q")


def test_groups_of_parquet_are_one_column(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    table = pa.table({
        "t": pa.array([10**18 + k for k in range(40)], pa.timestamp("ns")),
        "n": pa.array([None] * 10 + list(range(10, 40)), pa.int64()),
        "v": pa.array([None] * 10 + [[1.0, float(k)] for k in range(30)]),
        "ragged": pa.array([[1.0]] * 20 + [[1.0, 2.0]] * 20),
    })  # fmt: skip
    pq.write_table(table, tmp_path / "log.parquet", row_group_size=10)
    log = read_log(tmp_path / "log.parquet")
    assert log.array("t").whole.tolist() == [10**18 + k for k in range(40)]
    assert log.array("n").values[9:12, 0] == pytest.approx([np.nan, 10.0, 11.0], nan_ok=True)
    assert log.array("v").values[39].tolist() == [1.0, 29.0]
    with pytest.raises(LogError, match="ragged has lists of different lengths, 1 to 2"):
        log.array("ragged")


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is told by Linux")
@pytest.mark.parametrize(("kind", "most"), [("csv", 2.2), ("parquet", 3.0)])
def test_memory_hardly_exceeds_the_numbers(tmp_path, kind, most):
    pa = pytest.importorskip("pyarrow")
    chance, rows = np.random.default_rng(0), 2_000_000
    table = pa.table({"t": np.arange(rows), **{f"q{k}": chance.standard_normal(rows) for k in range(7)}})  # fmt: skip
    file = tmp_path / f"log.{kind}"
    if kind == "csv":
        pytest.importorskip("pyarrow.csv").write_csv(table, file)
    else:
        pytest.importorskip("pyarrow.parquet").write_table(table, file)
    told = subprocess.run([sys.executable, "-c", READ, str(file)], capture_output=True, text=True, check=True)  # fmt: skip
    assert float(told.stdout) < most, "times the numbers' own memory"
