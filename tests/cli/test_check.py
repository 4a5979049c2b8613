"""``aloft check`` and ``aloft doctor``, and the flags of a run that the latter speaks of."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from .conftest import Call, CallJson


def test_it_tells_what_the_machine_allows(folder: Path, call: Call, call_json: CallJson) -> None:
    result = call_json("doctor")
    names = {finding["name"] for finding in result["findings"]}
    assert {
        "libraries",
        "kernel",
        "real-time priority",
        "locked memory",
        "isolated processors",
    } <= names
    assert result["ready"] == all(finding["good"] for finding in result["findings"])
    told = call("doctor").stdout
    for finding in result["findings"]:
        assert finding["name"] in told
        assert not finding["change"] or f"{finding['name']}: " in told


def test_a_run_that_is_refused_a_processor_does_not_begin(folder: Path, call: Call) -> None:
    done = call("run", "count.yaml", "--cpu", "4096", "--no-record", code=2)
    assert "--cpu 4096: this process may use the processors" in done.stderr


def test_the_flags_are_for_one_run(folder: Path, call: Call) -> None:
    done = call("run", "count.yaml", "--seeds", "0:2", "--lock-memory", code=2)
    assert "are for one run, in one process" in done.stderr


@pytest.mark.parametrize(
    "verb",
    [("check",), ("run",), ("run", "--seeds", "0:2"), ("graph",), ("test",), ("keys",)],
    ids=" ".join,
)
def test_the_report_of_a_wrong_graph_as_json(
    folder: Path, call_json: Callable[..., dict[str, Any]], verb: tuple[str, ...]
) -> None:
    (folder / "wrong.yaml").write_text(
        "rate: 1\nblocks:\n  a: {use: blocks.Constant, with: {valeu: 1}}\n"
    )
    answer = call_json(verb[0], "wrong.yaml", *verb[1:], code=2)
    (problem, *_) = answer["problems"]
    assert answer["success"] is False and answer["count"] == len(answer["problems"])
    assert (problem["code"], problem["line"]) == ("unknown-parameter", 3)


def test_an_open_endpoint_is_a_warning(folder: Path, call: Call, call_json: CallJson) -> None:
    text = (folder / "count.yaml").read_text()
    text += "machines: {one: tcp/127.0.0.1:7450, two: tcp/10.9.8.7:7450}\nplace: {counter: one, double: two}\n"
    (folder / "count.yaml").write_text(text)
    (warning,) = call_json("check", "count.yaml")["warnings"]
    assert warning.startswith("machine 'two' listens at tcp/10.9.8.7:7450: whoever reaches it can")
    assert f"warning: {warning}\n" in call("check", "count.yaml").stdout
