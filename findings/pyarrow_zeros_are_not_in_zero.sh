#!/bin/sh
# pyarrow 26.0.1: reading a Parquet file with the filter `in [0.0]` loses every row group in which a float column is zero
# throughout, without an error. The format stores the least zero as -0.0 and the greatest as 0.0; `in` is judged by these bounds
# with -0.0 apart from 0.0, where `==`, `<=` and the same filter on the table in memory take them for one number.
# Seen: two rows of 0.0: `== 0.0` 2 rows, `in [0.0]` 0, `in [0.0, 1.0]` 0, in memory 2; beside a row of 0.5 they are found.
# Writing without statistics (`write_statistics=False`) avoids it. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" pyarrow==26.0.1 numpy==2.4.6
cd "$folder"
PYTHONPATH="$folder" python3 - <<'CODE'
import sys

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq


def rows(file, *condition):
    return pq.read_table(file, filters=[("v", *condition)]).num_rows


zeros = pa.table({"v": [0.0, 0.0]})
pq.write_table(zeros, "zeros.parquet")
pq.write_table(pa.table({"v": [0.0, 0.0, 0.5]}), "mixed.parquet")
pq.write_table(zeros, "plain.parquet", write_statistics=False)
found = {
    "== 0.0": rows("zeros.parquet", "==", 0.0),
    "in [0.0]": rows("zeros.parquet", "in", [0.0]),
    "in [0.0, 1.0]": rows("zeros.parquet", "in", [0.0, 1.0]),
    "in [0.0] in memory": zeros.filter(ds.field("v").isin([0.0])).num_rows,
    "in [0.0] beside 0.5": rows("mixed.parquet", "in", [0.0]),
    "in [0.0] without statistics": rows("plain.parquet", "in", [0.0]),
}
print("pyarrow 26.0.1, rows of two zeros: " + ", ".join(f"{name} {count}" for name, count in found.items()))
sys.exit(0 if list(found.values()) == [2, 0, 0, 2, 2, 2] else 1)
CODE
