"""``aloft log``: what is said of a recording, what is exported, what is mended."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft.logs

from .conftest import Call, CallJson


@pytest.fixture
def recorded(folder: Path, counted: bytes) -> Path:
    """A folder with ``count.rrd``."""
    (folder / "count.rrd").write_bytes(counted)
    return folder


def test_the_whole_way(recorded: Path, call: Call, call_json: CallJson) -> None:
    run = aloft.logs.read("count.rrd")
    (name,) = [name for name in run.signals() if name.startswith("counter.")]
    shown = call("log", "info", "count.rrd").stdout
    for text in ("count", "run_hash", name, "running", "ran to its end"):
        assert text in shown
    found = call_json("log", "info", "count.rrd")
    assert found["whole"] is True and found["ticks"] == 100
    assert {"name", "dtype", "shape", "unit", "frame", "text"} <= set(found["signals"][0])

    call("log", "export", "count.rrd", "--csv", "--signal", "counter")
    with open("count.csv", newline="") as file:
        header, *lines = list(csv.reader(file))
    assert header[:2] == ["tick", "t"] and header[2].startswith(name)
    values = [float(line[2]) for line in lines]
    assert np.array(values).tobytes() == run[name].reshape(100, -1)[:, 0].tobytes()

    call_json("log", "export", "count.rrd", "--parquet", "-o", "all.parquet")
    from pyarrow import parquet

    table = parquet.read_table("all.parquet")
    assert table.schema.field("t").metadata == {b"unit": b"s"}
    assert table.schema.metadata[b"aloft.graph"].decode() == run.header.graph
    assert table[header[2]].to_numpy().tobytes() == np.array(values).tobytes()

    problem = call_json("log", "export", "count.rrd", "--csv", "--signal", "countr", code=2)
    assert "no signal 'countr'; the nearest are counter." in problem["reason"]
    problem = call_json("log", "export", "count.rrd", code=2)
    assert problem["reason"] == "say one of --csv, --parquet, --mcap and --bag"
    problem = call_json("log", "export", "count.rrd", "--csv", "-o", "no/a.csv", code=2)
    assert problem["reason"].startswith("no/a.csv cannot be written")
    assert "none.rrd cannot be read" in call_json("log", "info", "none.rrd", code=2)["reason"]

    assert "is whole: nothing was done" in call("log", "repair", "count.rrd").stdout
    data = Path("count.rrd").read_bytes()
    Path("count.rrd").write_bytes(data[: len(data) * 2 // 3])
    found = call_json("log", "info", "count.rrd")
    assert found["whole"] is False and found["damage"] == []
    told = call("log", "repair", "count.rrd").stdout
    assert "count.rrd is mended: it was not closed by who wrote it" in told
    done = call_json("log", "repair", "count.rrd")
    assert done["closed"] is True and done["size_before"] == done["size"]
    assert call_json("log", "info", "count.rrd")["ticks"] == done["ticks"] <= 100


def test_mcap(recorded: Path, call: Call) -> None:
    from mcap.reader import make_reader

    call("log", "export", "count.rrd", "--mcap")
    run = aloft.logs.read("count.rrd")
    found: dict[str, list[Any]] = {}
    with open("count.mcap", "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None and schema.encoding == "jsonschema"
            assert channel.topic != "/log" or schema.name == "foxglove.Log"
            found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
    name = next(iter(run.signals()))
    port, _, field = name.rpartition(".")
    messages = found[port.replace(".", "/")]
    assert [values[field] for _, values in messages] == run[name].tolist()
    assert [instant for instant, _ in messages] == [k * 10_000_000 for k in range(100)]


def test_a_run_is_compared_with_itself_and_another(
    recorded: Path, call: Call, call_json: CallJson
) -> None:
    said = call("log", "compare", "count.rrd", "count.rrd").stdout
    assert "signals are equal in 100 ticks" in said
    found = call_json("log", "compare", "count.rrd", "count.rrd")
    assert found["align"] == "start" and found["signals"] == [] and found["equal"] >= 1
    problem = call_json(
        "log", "compare", "count.rrd", "count.rrd", "--align", "lift-off", code=2
    )  # fmt: skip
    assert problem["reason"] == "count.rrd has no lift-off; compare with --align start"
    assert (
        "none.rrd cannot be read"
        in call_json("log", "compare", "count.rrd", "none.rrd", code=2)["reason"]
    )


def test_without_mcap_it_says_what_to_install(
    recorded: Path, call_json: CallJson, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "mcap", None)
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    problem = call_json("log", "export", "count.rrd", "--mcap", code=2)
    assert (
        problem["reason"] == "MCAP needs the library mcap; pip install 'mcap>=1.2' 'rosbags>=0.11'"
    )
