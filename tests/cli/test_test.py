"""``aloft test``: blocks keep their promises, a recording becomes a test, pytest runs."""

from pathlib import Path

import pytest

from .conftest import Call, CallJson


def test_blocks_and_graphs(folder: Path, call: Call, call_json: CallJson) -> None:
    done = call("test", "blocks.ContactDetector")
    assert "13 of 13 checks of 1 block passed" in done.stdout
    answer = call_json("test", "count.yaml", code=1)  # its block has undocumented ports
    problems = {(c["block"], c["check"]): c["problem"] for c in answer["checks"] if c["problem"]}
    assert problems["counter (Counter)", "documented"] == "Counter: port 'y' has no text"
    assert "counter (Counter)" in call("test", "counter:Counter", "count.yaml", code=1).stdout


def test_the_blocks_of_a_graph_are_tested_with_its_robot(folder: Path, call: Call) -> None:
    (folder / "dog.py").write_text(DOG)
    (folder / "dog.yaml").write_text(
        "rate: 100\nrobot: go2\ndimensions: {m: 2}\nblocks: {dog: {use: dog:Dog}}\n"
    )
    call("test", "dog.yaml")
    done = call("test", "dog.yaml", "--robot", "bruce", code=1)
    assert "this is bruce" in " ".join(done.stdout.split())


DOG = """\
from aloft import Block, Field, Output, Signal


class Size(Signal):
    value = Field("m", text="any")


class Dog(Block):
    'A block for one robot.'

    y = Output(Size, text="the number of joints and the period")

    def setup(self):
        name = self.context.robot.name
        if name != "go2":
            raise ValueError(f"this is {name}")

    def step(self):
        self.y.value[:] = self.period
"""


@pytest.mark.long
def test_a_recording_becomes_a_test_that_pytest_runs(
    folder: Path, call: Call, call_json: CallJson, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # starts twice as fast
    call("run", "count.yaml", "--quiet")
    record = "recordings/count.rrd"
    answer = call_json("test", "--recording", record, "--block", "counter", "--ticks", "20:30")
    assert answer["test"] == "test_counter_20_30.py" and answer["runs"] == 10
    (folder / "tests").mkdir()
    done = call(
        "test", "--recording", record, "--block", "double", "--ticks", "5", "--rtol", "1e-9"
    )
    assert "tests/test_double_5_6.py: 1 runs of double" in done.stdout
    assert "rtol=1e-09" in (folder / "tests" / "test_double_5_6.py").read_text()
    answer = call_json("test", "tests")
    assert answer["success"] and answer["pytest_exit_code"] == 0
    source = (folder / "counter.py").read_text()
    (folder / "counter.py").write_text(source.replace("+= 1.0", "+= 1.00001"))
    answer = call_json("test", "test_counter_20_30.py", code=1)
    assert not answer["success"] and answer["pytest_exit_code"] == 1


USERS = {
    "broken.py": "from aloft import Block\n\nimport no_such_library\n",
    "wrong.py": "from aloft import Block\nclass A(Block:\n    pass\n",
    "empty.py": "from aloft import Block\n",
    "needs.py": """\
from aloft import Block, Output, Parameters, parameter
from aloft.blocks.general.vectors import Vector

class Needs(Block):
    \"\"\"Needs three values.\"\"\"

    class Params(Parameters):
        n: int = parameter(text="elements")
        gain: float = parameter(text="a number")

    params: Params
    y = Output(Vector, text="the number")

    def step(self) -> None:
        self.y.value[:] = self.params.gain
""",
}


def test_modules_of_a_user(folder: Path, call_json: CallJson) -> None:
    for name, text in USERS.items():
        (folder / name).write_text(text)
    for target in ("broken:Block", "broken"):
        answer = call_json("test", target, code=2)
        assert answer["reason"] == "ModuleNotFoundError: No module named 'no_such_library'"
        assert answer["where"].endswith("broken.py:3")
    assert call_json("test", "wrong", code=2)["where"].endswith("wrong.py:2:14")
    assert call_json("test", "empty", code=2)["reason"] == "the module empty defines no block"
    (check,) = call_json("test", "needs", code=1)["checks"]
    assert (check["block"], check["check"]) == ("needs:Needs", "example_parameters")
    assert check["problem"] == (
        "n, gain have no default: return values to test with from the class method example_parameters"
    )


def test_what_is_refused(folder: Path, call_json: CallJson) -> None:
    def reason(*arguments: str) -> str:
        return str(call_json("test", *arguments, code=2)["reason"])

    assert reason("--recording", "none.rrd", "--block", "a", "--ticks", "1:2") == (
        "there is no recording none.rrd"
    )
    assert reason("--block", "counter").startswith("--block, --ticks and --out go with --recording")
    assert "blocks.Contacts" in reason("blocks.Contacts")
    call_json("run", "count.yaml")
    record = ("--recording", "recordings/count.rrd")
    assert reason(*record) == "--recording needs --block NAME and --ticks FIRST:END"
    assert reason(*record, "--block", "counter", "--ticks", "a:b") == (
        "ticks 'a:b' are no range like 1200:1400"
    )
    assert "there is no block 'counts' to test" in reason(
        *record, "--block", "counts", "--ticks", "1:2"
    )
