"""``aloft check``, ``graph``, ``blocks`` and ``bench``, help and completion."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pydantic
import pytest
import typer

import aloft
import aloft.lab.benchmarks.catalogue
import aloft.runtime.loading
from aloft.cli.app import all_verbs, make_app
from aloft.cli.verbs import PANELS, help_page
from aloft.logs.file.code import code_of, remember
from aloft.runtime.loading import flatten

from .conftest import Call, CallJson, Start

ROOT = Path(__file__).parent.parent.parent
HEAVY = {
    "PIL", "asyncio", "casadi", "clarabel", "daqp", "llvmlite", "matplotlib", "multiprocessing", "mujoco",
    "pinocchio", "pyarrow", "qpsolvers", "rerun", "rich", "scipy", "serial", "zenoh",
}  # fmt: skip
"""Libraries and parts of Python that no check needs; each takes 10 ms and more to import."""


def test_a_wrong_graph_is_reported_whole(folder: Path, call: Call, call_json: CallJson) -> None:
    graph = (folder / "count.yaml").read_text()
    wrong = graph.replace("seed: 5", "sed: 5").replace("100 Hz", "100 m") + "extra: 1\n"
    (folder / "wrong.yaml").write_text(wrong)
    result = call_json("run", "wrong.yaml", code=2)
    assert result["success"] is False
    assert result["reason"] == "wrong.yaml: 3 problems"
    assert [problem["line"] for problem in result["problems"]] == [1, 4, 6]
    assert call_json("check", "wrong.yaml", code=2)["problems"] == result["problems"]
    done = call("check", "wrong.yaml", code=2)
    assert done.stdout == ""
    assert "wrong.yaml:4:" in done.stderr
    assert "wrong.yaml: 3 problems" in done.stderr


def test_check_says_that_a_graph_may_run(folder: Path, call: Call, call_json: CallJson) -> None:
    assert call("check", "count.yaml").stdout == "count.yaml: no problems; 2 blocks at 100 Hz\n"
    assert call_json("check", "count.yaml")["ok"] is True
    result = call_json("check", "count.yaml", "--set", "counter.seed=-1", code=2)
    assert result["problems"][0]["at"] == "counter.seed"


def test_a_missing_graph_is_an_input_error(folder: Path, call: Call, call_json: CallJson) -> None:
    assert "cannot read nowhere.yaml" in call("run", "nowhere.yaml", code=2).stderr
    assert call_json("run", "nowhere.yaml", code=2)["problems"][0]["code"] == "file"


def test_a_wrong_command_line_is_an_input_error(
    folder: Path, call: Call, call_json: CallJson
) -> None:
    assert "No such command 'rnu'" in call_json("rnu", code=2)["reason"]
    assert "--sett" in call_json("run", "count.yaml", "--sett", "a=1", code=2)["reason"]
    done = call("run", code=2)
    assert "Missing argument" in done.stderr
    assert done.stdout == ""


def test_blocks_lists_and_describes(call: Call, call_json: CallJson) -> None:
    listing = call("blocks").stdout
    assert "blocks.Gain" in listing
    gain = call("blocks", "blocks.Gain").stdout
    for text in ("y = gain u", "Inputs", "gain times u", "Parameters", "the factor", "(Mealy)"):
        assert text in gain
    data = call_json("blocks", "blocks.Gain")
    assert data["parameters"][2]["name"] == "gain"
    assert data["parameters"][2]["default"] == "1.0"
    assert len(call_json("blocks")["blocks"]) > 5


def test_blocks_names_what_is_alike(call: Call) -> None:
    done = call("blocks", "blocks.Gian", code=2)
    assert "there is no block called 'blocks.Gian'; the nearest are blocks.Gain" in done.stderr


def test_shipped_graphs_have_addresses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Call, call_json: CallJson
) -> None:
    monkeypatch.chdir(tmp_path)
    listed = {row["graph"]: row for row in call_json("graph")["graphs"]}
    assert {"aloft:jump", "aloft:push", "aloft:robots/go2_jump"} <= set(listed)
    assert all(row["summary"] for row in listed.values())
    assert "aloft:jump" in call("graph").stdout
    assert "no problems" in call("check", "aloft:jump").stdout
    assert aloft.load("aloft:jump").checked.name == "jump"
    for wrong in ("jump.yaml", "graphs/jump.yaml", "aloft:jmp"):
        (problem,) = call_json("run", wrong, code=2)["problems"]
        assert problem["fix"].startswith("aloft:jump, which is shipped")
    (tmp_path / "bounce.yaml").write_text("rate: 1 Hz\n")
    (problem,) = call_json("run", "bounse.yaml", code=2)["problems"]
    assert problem["fix"] == "bounce.yaml"
    (problem,) = call_json("run", "zzz.yaml", code=2)["problems"]
    assert problem["message"] == "cannot read zzz.yaml: No such file or directory"
    assert not problem["nearest"] and "jump" not in problem["fix"]


def test_blocks_names_those_of_that_class(call: Call) -> None:
    assert "the nearest are blocks.Gain" in call("blocks", "Gain", code=2).stderr


def test_a_block_beside_the_graph_is_described(folder: Path, call: Call) -> None:
    assert "Counts up from its seed" in call("blocks", "counter:Counter").stdout


def test_graph_prints_order_rates_and_wires(folder: Path, call: Call, call_json: CallJson) -> None:
    (folder / "ring.yaml").write_text("""
rate: 100 Hz
duration: 2 s
blocks:
  setpoint: {use: blocks.SineWave, rate: 50 Hz}
  error: {use: blocks.Sum, with: {weights: [1, -1]}, in: {a: setpoint.y, b: position.y}}
  rate: {use: blocks.Gain, with: {unit: 1/s}, in: {u: error.y}}
  position: {use: blocks.Integrator, in: {u: rate.y}}
""")
    text = call("graph", "ring.yaml").stdout
    assert text.startswith("ring: base rate 100 Hz, 200 ticks\n")
    order = [text.index(f" {name} ") for name in ("position", "setpoint", "error")]
    assert order == sorted(order)
    assert "a <- setpoint.y (Vector, holds 50 Hz)" in text
    data = call_json("graph", "ring.yaml")
    assert [row["path"] for row in data["blocks"]] == ["position", "setpoint", "error", "rate"]
    assert call("graph", "ring.yaml", "--mermaid").stdout.startswith("flowchart LR\n")
    flat = call("graph", "ring.yaml", "--flat", "--set", "position.initial=0.5").stdout
    (folder / "flat.yaml").write_text(flat)
    assert "initial: 0.5" in flat
    runs = [
        call_json("run", *arguments, "--no-record")["run_hash"]
        for arguments in (["flat.yaml"], ["ring.yaml", "--set", "position.initial=0.5"])
    ]
    assert runs[0] == runs[1]


def test_graph_wants_one_form(folder: Path, call: Call) -> None:
    assert "choose one of" in call("graph", "count.yaml", "--flat", "--mermaid", code=2).stderr


def test_check_prints_the_schema(call: Call) -> None:
    schema = json.loads(call("check", "--schema").stdout)
    assert {"rate", "blocks"} <= set(schema["properties"])
    assert "a graph file is needed" in call("check", code=2).stderr


def test_bench_refuses_an_unknown_name(call_json: CallJson) -> None:
    result = call_json("bench", "sheduler", code=2)
    assert result["reason"].startswith("there is no benchmark 'sheduler'; there is tick, solvers,")
    result = call_json("bench", "scheduler", "--seconds", "5", code=2)
    assert (
        result["reason"]
        == "--seconds is for recorder, background, export, paper_solvers, not for scheduler"
    )


def test_bench_prints_rows_and_exits_by_the_goals(
    monkeypatch: pytest.MonkeyPatch, call: Call, call_json: CallJson
) -> None:
    row = {"name": "tick", "value": 1.5, "unit": "us", "ratio": 1.2, "peer": "hand loop"}
    machine = {"processor": "abacus", "cores": 2, "python": "3"}
    results = {"machine": machine, "load": {"before": [0.1], "after": [0.2]}}
    for met, code in ((True, 0), (None, 0), (False, 1)):
        rows = [{**row, "goal": 1.1, "met": met, "note": ""}]
        monkeypatch.setattr(
            aloft.lab.benchmarks.catalogue,
            "run_benchmarks",
            lambda *_, r=rows: {**results, "rows": r},
        )
        assert call_json("bench", "scheduler", code=code)["rows"] == rows
        text = call("bench", code=code).stdout
        assert "hand loop" in text
        assert "abacus" in text


def complete(start: Start, words: str) -> list[str]:
    """What bash would be offered behind these words."""
    position = str(len(words.split(" ")) - 1)
    process = start(_ALOFT_COMPLETE="complete_bash", COMP_WORDS=words, COMP_CWORD=position,
                    before="import sys; sys.argv = ['aloft']")  # fmt: skip
    return process.communicate(timeout=240)[0].split()


@pytest.mark.long
def test_the_tab_key_completes(folder: Path, start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    assert complete(start, "aloft ru") == ["run"]
    assert "--seeds" in complete(start, "aloft run --se")
    assert complete(start, "aloft blocks blocks.Ga") == ["blocks.Gain"]
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    assert complete(start, "aloft run count.yaml --set counter.s") == [], "its module never ran"
    remember(code_of(flatten(folder / "count.yaml")))
    assert complete(start, "aloft run count.yaml --set counter.s") == [
        "counter.seed=",
        "counter.stop_at=",
    ]
    assert complete(start, "aloft run nowhere.yaml --set counter.s") == []


def test_help_documents_the_exit_codes(call: Call) -> None:
    for arguments in (("--help",), ("run", "--help")):
        text = call(*arguments).stdout
        for code in (0, 1, 2, 3, 130, 143):
            assert re.search(rf"^ +{code} ", text, re.MULTILINE)
    assert call("--version").stdout.startswith("aloft ")


def test_the_list_of_verbs_imports_no_verb_and_cuts_no_summary(start: Start) -> None:
    before = "import atexit, sys\natexit.register(lambda: print(*sys.modules))\n"
    for argument in ("--help", "--version"):
        output, errors = start(argument, before=before).communicate(timeout=240)
        *lines, last = output.splitlines()
        tops = {name.partition(".")[0] for name in last.split()}
        assert not tops & {*HEAVY, "typer", "click", "numpy", "pydantic", "yaml"}, errors
        assert all(len(line) <= 80 and "..." not in line.replace("VERB ...", "") for line in lines)
    text = help_page()
    for verb in all_verbs():
        assert re.search(rf"^  {verb} +[A-Z].*\.$", text, re.MULTILINE), verb
    assert re.findall(r"^(\w+):$", text, re.MULTILINE)[: len(PANELS)] == list(PANELS)
    assert "Other:" not in text


def options_of(command: Any, path: str = "aloft") -> list[tuple[str, str]]:
    """Every option of a command and of those in it: the command's path and its option."""
    inner = getattr(command, "commands", {})
    own = [(path, option) for each in command.params for option in each.opts]
    return [*own, *(row for name in inner for row in options_of(inner[name], f"{path} {name}"))]


def test_an_option_has_one_meaning() -> None:
    rows = options_of(typer.main.get_command(make_app()))
    times = {path for path, option in rows if option in ("--from", "--to")}
    assert times == {"aloft plot", "aloft render"}
    assert not {option for _, option in rows} & {"--save", "--write"}
    signals = {path for path, option in rows if option == "--output"}
    assert signals == {"aloft linearise", "aloft export c", "aloft export fmu"}


@pytest.mark.parametrize("verb", ["run", "plot", "replay", "robot", "log"])
def test_help_names_values_as_a_reader_does(call: Call, verb: str) -> None:
    text = call(verb, "--help").stdout
    assert "list[" not in text and " range>" not in text and "<path>" not in text
    assert "..." not in text.replace("[ARGS]...", "").replace("SIGNAL...", "")


def test_check_answers_at_once(start: Start) -> None:
    # How many seconds it takes is measured by `aloft bench startup`. Here is what they depend on: which
    # modules it imports, that nearly no garbage is searched for, and none at the end.
    before = """
import atexit, gc, sys
searched = []
gc.callbacks.append(lambda phase, info: searched.append(info["generation"]) if phase == "stop" else None)
atexit.register(lambda: print(len(searched), gc.get_freeze_count(), *sys.modules))
"""
    output, errors = start("check", str(ROOT / "graphs" / "jump.yaml"), before=before).communicate(
        timeout=240
    )
    told, last = output.splitlines()
    assert told.endswith("no problems; 24 blocks at 500 Hz"), errors
    searches, frozen, *modules = last.split()
    assert int(searches) < 10 and int(frozen) > 10_000
    tops = {name.partition(".")[0] for name in modules}
    assert tops & HEAVY == set()
    # Neither the search through installed packages, nor what compiles, links or loads kernels, nor what other graphs
    # need: machines, a robot in XML, declarations of extensions, what a robot has learnt.
    assert {
        "importlib.metadata", "importlib.resources", "xml.etree.ElementTree", "tomllib", "socket", "pkgutil",
        "aloft.mathematics.compiling.translate", "aloft.mathematics.compiling.machine_code",
        "aloft.runtime.transports", "aloft.planner.library.learnt",
    } & {*modules} == set()  # fmt: skip
    ours = [name for name in modules if name.startswith("aloft.")]
    assert len(ours) < 235
    assert {name for name in ours if name.startswith("aloft.cli.")} == {
        "aloft.cli.app", "aloft.cli.check", "aloft.cli.shared", "aloft.cli.shared.help_texts",
        "aloft.cli.shared.options", "aloft.cli.shared.output", "aloft.cli.shared.plain_console", "aloft.cli.verbs",
    }  # fmt: skip


def test_an_unrecorded_run_imports_no_recorder(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):  # by which Rich takes a pipe for a terminal
        monkeypatch.delenv(name, raising=False)
    # Nor links between processes, nor what checks a plan that has passed or makes a table that is kept.
    graph, before = (
        str(ROOT / "graphs" / "jump.yaml"),
        "import atexit, sys\natexit.register(lambda: print(*sys.modules))\n",
    )
    arguments = ("run", graph, "--no-record", "--json", "--duration", "10 ms")
    for _ in range(2):  # after the first, all is kept
        output, errors = start(*arguments, before=before).communicate(timeout=240)
    modules = {*output.splitlines()[-1].split()}
    assert "aloft.runtime.running.executor" in modules, errors
    assert {
        "aloft.logs", "aloft.runtime.links", "aloft.runtime.transports", "aloft.planner.checking", "aloft.planner.models",
        "aloft.planner.library.reference_table", "html", "concurrent.futures", "rerun", "rich",
    } & modules == set()  # fmt: skip


def test_a_bug_does_not_look_like_a_fall(
    folder: Path, monkeypatch: pytest.MonkeyPatch, call: Call, call_json: CallJson
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(aloft.runtime.loading, "checked_file", broken)
    result = call_json("check", "count.yaml", code=3)
    assert result == {"success": False, "reason": "bug: ZeroDivisionError: by zero"}
    assert "Traceback" in call("check", "count.yaml", code=3).stderr


def test_pydantic_asks_its_loader_of_plugins_for_nothing_else() -> None:
    # A command puts a module of its own in place of it, which has ``get_plugins`` only.
    folder = Path(pydantic.__file__).parent
    texts = [file.read_text(encoding="utf-8") for file in folder.rglob("*.py")]
    asked = [
        line.strip() for text in texts for line in text.splitlines() if "_loader import" in line
    ]
    assert asked == ["from ._loader import get_plugins"]


def test_a_verb_imports_no_other_verbs_file() -> None:
    code = (
        "import sys; sys.argv = ['aloft', 'check', 'nothing.yaml']\n"
        "from aloft.cli import run_arguments\n"
        "try: run_arguments()\n"
        "except SystemExit: pass\n"
        "print(sorted(m for m in sys.modules if m in ('aloft.cli.run', 'aloft.cli.plan')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
