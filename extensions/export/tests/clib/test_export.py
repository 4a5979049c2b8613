"""``aloft export c``: the library computes the bytes of the graph, by itself and in any memory."""

import ctypes
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

import aloft
from aloft.extensions.export.clib.check import Checked, check
from aloft.extensions.export.clib.library import SharedLibrary
from aloft.extensions.export.clib.module import Status
from aloft.extensions.export.clib.targets import TARGETS
from aloft.extensions.export.clib.write import write_library
from aloft.logs.recording.recorder import Recorder
from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.registry import find_block, known_names

CONTROLLER = """\
inputs: {wish: , measured: }
outputs: {force: bound.y, long_ago: slow.y}
blocks:
  pid: {use: blocks.PID, with: {kp: 20, ki: 5, kd: 3, unit: N/m}, in: {setpoint: inputs.wish, measured: inputs.measured}}
  bound: {use: blocks.Saturation, with: {lower: -5, upper: 5}, in: {u: pid.u}}
  slow: {use: blocks.MovingAverage, rate: 100 Hz, with: {samples: 3}, in: {u: {from: bound.y, delay: 2}}}
"""
MASS = """\
rate: 500 Hz
duration: 1 s
blocks:
  wish: {use: blocks.Step, with: {at: 0.1 s, after: 1 m}}
  controller: {use: controller.yaml, in: {wish: wish.y, measured: place.y}}
  mass: {use: blocks.Gain, with: {gain: 0.5 1/kg}, in: {u: controller.force}}
  speed: {use: blocks.Integrator, in: {u: mass.y}}
  place: {use: blocks.Integrator, in: {u: speed.y}}
"""
needs_compiler = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler (cc)")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The graph of a PID on a mass, and a recording of it."""
    made = tmp_path_factory.mktemp("export")
    (made / "controller.yaml").write_text(CONTROLLER)
    (made / "mass.yaml").write_text(MASS)
    aloft.load(made / "mass.yaml").run(sinks=[Recorder(made / "mass.rrd")]).raise_if_failed()
    return made


@pytest.fixture(scope="module")
def written(folder: Path) -> Path:
    return write_library(str(folder / "mass.yaml"), folder / "pd", "controller").description


UNSOLVABLE = """\
include: [aloft:jump.yaml]
duration: 0.4 s  # it falls later
set: {{wbc.force_min: 50 N, wbc.force_max: 20 N, wbc.cones: {cones}}}
"""
"""No force is at least 50 N and at most 20 N."""
STATUSES = {"FALLBACK": 199, "EVENT": 1}
"""In one tick the safety monitor asks for attention as well."""


@pytest.mark.long
@pytest.mark.parametrize("cones", ["pyramid", "round"])
def test_what_a_controller_does_without_a_solution_gives_all_recorded_bytes(
    tmp_path: Path, cones: str
) -> None:
    graph, recording = tmp_path / "unsolvable.yaml", tmp_path / "run.rrd"
    graph.write_text(UNSOLVABLE.format(cones=cones))
    result = aloft.load(graph).run(sinks=[Recorder(recording)])
    assert result.metrics["qp_failures"] == 200  # every tick
    found = back_to_back(str(graph), recording, tmp_path, "x86_64", statuses=STATUSES)
    assert (found.ticks, found.signal_bytes > 200 * 1000) == (200, True)


@pytest.mark.parametrize("target", TARGETS)
def test_every_byte_of_a_recording_comes_out_of_the_library(folder: Path, target: str) -> None:
    graph, recording = str(folder / "mass.yaml"), folder / "mass.rrd"
    found = back_to_back(graph, recording, folder / "targets", target, "controller")
    assert found.ticks == 500
    assert found.signal_bytes > 500 * 8 * 4
    assert found.state_bytes > 0


@needs_compiler
def test_the_check_names_the_first_byte_that_differs(folder: Path) -> None:
    overrides = ["controller/pid.kp=20.000001"]
    made = write_library(
        str(folder / "mass.yaml"), folder / "other" / "pd", "controller", overrides
    )
    found = check(made.description, folder / "mass.rrd")
    assert found.difference.startswith("tick 50: controller/")


@needs_compiler
@pytest.mark.parametrize("compiler", ["cc", "c++"])
def test_the_example_builds_without_a_warning(written: Path, tmp_path: Path, compiler: str) -> None:
    if not shutil.which(compiler):
        pytest.skip(f"there is no {compiler}")
    language = ["-x", "c++", "-std=c++11"] if compiler == "c++" else ["-std=c99"]
    command = [
        compiler,
        *language,
        "-Wall",
        "-Wextra",
        "-Werror",
        "-pedantic",
        "example.c",
        "-x",
        "none",
    ]
    subprocess.run(
        [*command, "libpd.a", "-lm", "-o", tmp_path / "example"], cwd=written.parent, check=True
    )
    done = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].strip() == "9: 0"


@needs_compiler
def test_the_rust_of_the_page_calls_the_library(written: Path, tmp_path: Path) -> None:
    if not shutil.which("rustc"):
        pytest.skip("there is no rustc")
    page = (Path(aloft.__file__).parent / "extensions" / "export" / "c_library.md").read_text(
        encoding="utf-8"
    )
    (tmp_path / "caller.rs").write_text(page.partition("```rust\n")[2].partition("```")[0])
    command = ["rustc", "--edition", "2021", "-D", "warnings", "-L", written.parent, "caller.rs"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "caller"], capture_output=True, text=True, check=True)
    library = SharedLibrary(written)
    for tick, line in enumerate(done.stdout.splitlines()):
        library.inputs["wish"][...], library.inputs["measured"][...] = 1.0, 0.1 * tick
        library.step()
        names = ("force", "long_ago")
        assert [float(x) for x in line.split()] == [library.outputs[n].item() for n in names]
    assert tick == 9 and library.outputs["force"].item() != 0.0


EXACT = {"floor", "ceil", "rint", "fmod"}
"""Functions of C that have the same bits in every library."""
OF_THE_SYSTEM = {"memcpy", "memset", "_GLOBAL_OFFSET_TABLE_"}


def symbols(file: Path) -> dict[str, list[str]]:
    """The symbols of an object file by the letters that ``nm`` has for their kinds."""
    listed = subprocess.run(["nm", file], capture_output=True, text=True, check=True)
    kinds: dict[str, list[str]] = {}
    for line in listed.stdout.splitlines():
        kind, name = line.split()[-2:]
        kinds.setdefault(kind, []).append(name)
    return kinds


def needed(file: Path) -> set[str]:
    """The functions that an object file takes from elsewhere."""
    return set(symbols(file).get("U", []))


@needs_compiler
def test_a_library_needs_nothing_of_the_system_but_memory_and_mathematics(written: Path) -> None:
    kinds = symbols(written.with_suffix(".o"))
    assert needed(written.with_suffix(".o")) <= OF_THE_SYSTEM
    assert not set(kinds) & {"D", "d", "B", "b", "C"}, "there is data that can be written"


@needs_compiler
def test_instances_are_independent_and_states_come_back(written: Path) -> None:
    first, second = SharedLibrary(written), SharedLibrary(written)
    first.inputs["wish"][...] = 1.0
    second.inputs["wish"][...] = -0.5
    for _ in range(7):
        assert (first.step(), second.step()) == (0, 0)
    kept = first.save()
    forces = [first.step() or float(first.outputs["force"][0]) for _ in range(5)]
    second.restore(kept)
    second.inputs["wish"][...] = 1.0
    assert [second.step() or float(second.outputs["force"][0]) for _ in range(5)] == forces
    first.reset()
    assert bytes(first.memory) == bytes(SharedLibrary(written).memory)
    with pytest.raises(AloftError, match="a state of pd has"):
        first.restore(kept[:-1])


@needs_compiler
def test_a_live_parameter_changes_within_its_bounds(folder: Path) -> None:
    made = write_library(str(folder / "mass.yaml"), folder / "gain" / "gain", "mass")
    library = SharedLibrary(made.description)
    library.inputs["controller/bound.y".replace("/", ".")][...] = 2.0
    assert (library.step(), library.outputs["y"].tolist()) == (0, [1.0])
    library.set("mass.gain[0]", 3.0)
    assert library.get("mass.gain[0]") == 3.0
    assert (library.step(), library.outputs["y"].tolist()) == (0, [6.0])
    with pytest.raises(AloftError, match=r"no live parameter 'mass.gian'; there is mass.gain\[0\]"):
        library.set("mass.gian", 1.0)
    with pytest.raises(AloftError, match="cannot be nan"):
        library.set("mass.gain[0]", np.nan)


@needs_compiler
def test_gains_of_a_pid_are_live_and_what_python_computes_from_the_rest_is_fixed(
    folder: Path, tmp_path: Path
) -> None:
    made = write_library(str(folder / "mass.yaml"), tmp_path / "pd", "controller")
    units = {each["name"]: each["unit"] for each in made.about["parameters"]}
    gains = {
        f"controller/pid.{key}": value for key, value in (("kp", 30.0), ("ki", 2.0), ("kd", 1.5))
    }
    assert [units[f"{name}[0]"] for name in gains] == ["N/m", "N/m/s", "N s/m"]
    assert made.about["fixed_parameters"] == [
        *(f"controller/pid.{name}" for name in ("tracking_time", "lower", "upper")),
        *(f"controller/bound.{name}" for name in ("lower", "upper")),
    ]
    library = SharedLibrary(made.description)
    for name, value in gains.items():
        library.set(f"{name}[0]", value)
    result = aloft.load(folder / "mass.yaml", gains).run()
    steps = zip(
        *(result.signal(f"{n}.value")[:, 0] for n in ("wish.y", "place.y", "controller/bound.y")),
        strict=True,
    )
    for wish, place, force in steps:
        library.inputs["wish"][...], library.inputs["measured"][...] = wish, place
        assert (library.step(), library.outputs["force"].tolist()) == (0, [force])


MOTOR = """
rate: 100 Hz
blocks:
  volts: {use: blocks.External, with: {unit: V}}
  motor:
    use: blocks.StateSpace
    with: {a: [[0.9, 0], [0, 0.8]], b: [[1], [1]], c: [[1, 0], [0, 1]], input_units: V, output_units: [A, rad/s]}
    in: {u: volts.y}
"""


@needs_compiler
def test_the_header_has_the_unit_of_each_element(tmp_path: Path) -> None:
    (tmp_path / "motor.yaml").write_text(MOTOR)
    made = write_library(str(tmp_path / "motor.yaml"), tmp_path / "motor")
    assert "double motor_y[2]; /* [A, rad/s]: " in (tmp_path / "motor" / "motor.h").read_text()
    assert made.about["outputs"][0]["units"] == ("A", "rad/s")


LATE = MASS.replace("measured: place.y", "measured: {from: place.y, delay: 2}")


@needs_compiler
@pytest.mark.parametrize("side", ["inside", "outside"])
def test_delays_of_inputs_are_on_the_side_that_is_asked_for_and_said(
    folder: Path, tmp_path: Path, side: str
) -> None:
    (tmp_path / "controller.yaml").write_text(CONTROLLER)
    (tmp_path / "late.yaml").write_text(LATE)
    made = write_library(str(tmp_path / "late.yaml"), tmp_path / "pd", "controller", delays=side)
    header = (tmp_path / "pd" / "pd.h").read_text()
    words = {
        "inside": "controller/pid.measured reads it 0.004 s late, by a delay in here",
        "outside": "give it 0.004 s late: controller/pid.measured has no delay in here",
    }
    assert words[side] in header
    assert "every 5 ticks (100 Hz), from tick 0: controller/slow\n" in header
    (said,) = made.about["input_delays"]
    assert (said["sources"], said["runs"], said["side"]) == (("place.y",), 2, side)
    library = SharedLibrary(made.description)
    result = aloft.load(tmp_path / "late.yaml").run()
    wish, place, force = (
        result.signal(f"{n}.value")[:, 0] for n in ("wish.y", "place.y", "controller/bound.y")
    )
    late = place if side == "inside" else np.concatenate([[0.0, 0.0], place[:-2]])
    for tick in range(len(place)):
        library.inputs["wish"][...], library.inputs["measured"][...] = wish[tick], late[tick]
        assert (library.step(), library.outputs["force"].tolist()) == (0, [force[tick]])
    aloft.load(tmp_path / "late.yaml").run(sinks=[Recorder(tmp_path / "late.rrd")])
    assert not check(made.description, tmp_path / "late.rrd").difference


@pytest.mark.parametrize(
    ("reads", "message"),
    [
        ("{u: inputs.again}", "place.y cannot be outside: controller/more.u 0 runs late and controller/pid.measured 2"),
        ("{u: {from: inputs.again, delay: 1}}", "controller/more.u 1 runs late and controller/pid.measured 2 runs late"),
        ("{u: {from: [inputs.again, bound.y], delay: 1}}", "its wire joins outputs of both sides"),
    ],
)  # fmt: skip
def test_delays_that_cannot_be_outside(tmp_path: Path, reads: str, message: str) -> None:
    inside = CONTROLLER.replace("measured: }", "measured: , again: }")
    (tmp_path / "controller.yaml").write_text(
        f"{inside}  more: {{use: blocks.Gain, in: {reads}}}\n"
    )
    (tmp_path / "late.yaml").write_text(LATE.replace("in: {wish", "in: {again: place.y, wish"))
    taken = ["controller/more.y", "controller/bound.y"]
    with pytest.raises(AloftError, match=message):
        write_library(
            str(tmp_path / "late.yaml"),
            tmp_path / "pd",
            "controller",
            outputs=taken,
            delays="outside",
        )


@needs_compiler
def test_wrong_calls_and_numbers_are_refused(written: Path) -> None:
    library = SharedLibrary(written)
    name = ctypes.CDLL(str(written.parent / "libpd.so"))
    assert name.pd_step(None, None, None) == Status.BAD_INSTANCE
    room = np.zeros(library.memory.size, np.uint8)
    pointer = ctypes.c_void_p(room.ctypes.data)
    assert name.pd_reset(pointer) == Status.BAD_INSTANCE
    assert name.pd_init(pointer, ctypes.c_int64(room.size - 1)) == Status.BAD_ARGUMENT
    library.inputs["measured"][...] = np.nan
    before = library.memory.copy()
    assert library.step() == Status.BAD_INPUT
    assert bytes(library.memory) == bytes(before)
    library.inputs["measured"][...] = 1e308
    assert library.step() == Status.NOT_FINITE, "the force is infinite"
    library.inputs["measured"][...] = 0.0
    assert library.step() == Status.NOT_FINITE, "nothing goes on before a reset"
    library.reset()
    assert library.step() == Status.OK


CAREFUL = """\
from aloft import Block, Input, Output, kernel
from aloft.blocks.general.vectors import Vector, VectorParameters
from aloft.runtime.language.steps import signal_call


@kernel
def halve(y: Vector) -> None:
    y.value[:] = 0.5 * y.value


class Careful(Block):
    "Passes numbers on, and halves great ones in its event."

    class Params(VectorParameters):
        pass

    params: Params
    u = Input(Vector, text="what is passed on")
    y = Output(Vector, text="the same, or half of it")

    def setup(self) -> None:
        self.event_calls = (signal_call(halve, self.y),)

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector) -> bool:
        y.value[:] = u.value
        return u.value[0] > 10.0

    def on_event(self) -> None:
        self.event_calls[0].run()
"""
WATCHED = """\
rate: 100 Hz
blocks:
  given: {use: blocks.External}
  careful: {use: "careful_block:Careful", in: {u: given.y}}
  bounded: {use: blocks.Assertion, with: {lower: -1, upper: 8}, in: {u: careful.y}}
"""


@needs_compiler
def test_what_a_block_asks_of_python_is_a_status_with_its_name(tmp_path: Path) -> None:
    (tmp_path / "careful_block.py").write_text(CAREFUL)
    (tmp_path / "watched.yaml").write_text(WATCHED)
    made = write_library(
        str(tmp_path / "watched.yaml"), tmp_path / "watched", outputs=["careful.y", "bounded.ok"]
    )
    library = SharedLibrary(made.description)
    found = []
    for given in (3.0, 12.0, 9.0, 3.0):
        library.inputs["given"][...] = given
        status = Status(library.step())
        found.append((status.name, library.last_block(), library.outputs["careful.y"].tolist()))
    assert found == [
        ("OK", "", [3.0]),
        ("FALLBACK", "careful", [6.0]),
        ("EVENT", "bounded", [9.0]),
        ("OK", "", [3.0]),
    ]


FAILING = """\
import math
import numpy as np
from aloft import Block, Input, Output, kernel
from aloft.blocks.general.vectors import Vector, VectorParameters


class Failing(Block):
    "Fails in the way that a number says."

    class Params(VectorParameters):
        pass

    params: Params
    u = Input(Vector, text="the way")
    y = Output(Vector, text="numbers")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector) -> None:
        way = int(u.value[0])
        if way == 1:
            y.value[0] = 1.0 / (u.value[0] - 1.0)
        if way == 2:
            y.value[0] = (way << 61) * way
        if way == 3:
            y.value[0] = math.sqrt(-u.value[0])
        if way == 4:
            y.value[0] = math.exp(1000.0 * u.value[0])
        t = np.zeros(2)
        y.value[0] = t @ np.ones(6)[way : way + 2]
"""


@needs_compiler
def test_a_block_that_fails_says_why(tmp_path: Path) -> None:
    (tmp_path / "failing_block.py").write_text(FAILING)
    (tmp_path / "failing.yaml").write_text(
        "rate: 100 Hz\nblocks:\n  given: {use: blocks.External}\n"
        '  failing: {use: "failing_block:Failing", in: {u: given.y}}\n'
    )
    made = write_library(
        str(tmp_path / "failing.yaml"), tmp_path / "failing", outputs=["failing.y"]
    )
    library = SharedLibrary(made.description)
    found = []
    for way in (0, 1, 2, 3, 4, 5):
        library.reset()
        library.inputs["given"][...] = way
        found.append((Status(library.step()).name, library.last_block()))
    names = ("DIVIDED_BY_ZERO", "TOO_LARGE", "OUT_OF_DOMAIN", "OUT_OF_RANGE", "WRONG_LENGTH")
    assert found == [("OK", ""), *((name, "failing") for name in names)]


def test_blocks_that_need_python_are_named_all_at_once(tmp_path: Path) -> None:
    (tmp_path / "noisy.yaml").write_text(
        "rate: 100 Hz\nblocks:\n"
        "  noise: {use: blocks.WhiteNoise, with: {std: 1}}\n"
        "  twice: {use: blocks.Gain, with: {gain: 2}, in: {u: noise.y}}\n"
        "  drift: {use: blocks.ColouredNoise}\n"
        "  sum: {use: blocks.Sum, in: {a: twice.y, b: drift.y}}\n"
    )
    with pytest.raises(AloftError) as caught:
        write_library(str(tmp_path / "noisy.yaml"), tmp_path / "noisy")
    file = tmp_path / "noisy.yaml"
    assert str(caught.value).splitlines() == [
        "2 blocks need Python, so there is no library:",
        f"  {file}:3:3: block 'noise' (WhiteNoise) has a step in plain Python",
        f"  {file}:5:3: block 'drift' (ColouredNoise) has a step in plain Python",
    ]


def test_names_and_targets_that_cannot_be(folder: Path) -> None:
    graph = str(folder / "mass.yaml")
    with pytest.raises(AloftError, match="'int' cannot be the name of a library; write it as"):
        write_library(graph, folder / "int")
    with pytest.raises(AloftError, match="no target 'z80'; there is x86_64, aarch64, wasm"):
        write_library(graph, folder / "pd", target="z80")


GENERAL = Path(__file__).with_name("general_blocks.yaml")
IN_PYTHON = {
    "blocks.ColouredNoise": "NumPy's random numbers", "blocks.WhiteNoise": "NumPy's random numbers",
    "blocks.External": "what Python sets; in a library it is an input",
    "blocks.Policy": "a network of ONNX", "export.CLibrary": "another library",
}  # fmt: skip
"""The general blocks that no library has, and why."""


def test_the_graph_of_general_blocks_has_all_that_a_library_can_have() -> None:
    graph = aloft.load(GENERAL).checked
    used = {spec.block_type.__name__ for spec in graph.blocks}
    general = [
        each
        for each in known_names()
        if ".general." in find_block(each).__module__ or each == "export.CLibrary"
    ]
    assert sorted(
        set(general) - {f"blocks.{name}" for name in used} | {"blocks.External"}
    ) == sorted(IN_PYTHON)


def back_to_back(
    graph: str, recording: Path, folder: Path, target: str, part: str = "",
    statuses: Mapping[str, int] = MappingProxyType({}),
) -> Checked:  # fmt: skip
    """Write a graph, or a part of it, as a library for a processor, and feed it a recording."""
    tools = TARGETS[target]
    if not tools.linker() or not all(map(shutil.which, tools.runner[:1])):
        pytest.skip(f"no tools for {target}: apt install {tools.packages}")
    found = check(write_library(graph, folder / target, part, target=target).description, recording)
    assert found.difference == ""
    assert found.statuses == statuses
    return found


@pytest.fixture(scope="module")
def general(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of all general blocks."""
    recording = tmp_path_factory.mktemp("general") / "general.rrd"
    aloft.load(GENERAL).run(sinks=[Recorder(recording)]).raise_if_failed()
    return recording


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_general_blocks_give_all_recorded_bytes(general: Path, tmp_path: Path, target: str) -> None:
    found = back_to_back(str(GENERAL), general, tmp_path, target)
    if target == "x86_64":
        assert needed(tmp_path / target / f"{target}.o") <= {*OF_THE_SYSTEM, *EXACT}
    assert found.ticks == 1200
    assert found.signal_bytes > 500 * found.ticks
    assert found.state_bytes > 100


CONTROLLERS = [
    ("x86_64", "hops"),  # BRUCE's, with all that jumps in a row have besides
    ("x86_64", "robots/go2_jump"),  # four legs, with points for feet
    ("aarch64", "robots/g1_jump"),  # two legs, with arms that are held
    ("wasm", "push"),
]
"""Each processor, and each kind of robot. All kernels are compiled the same way for every processor,
and the general blocks, with all functions of mathematics, run on each."""


@pytest.mark.long
@pytest.mark.parametrize(("target", "name"), CONTROLLERS)
def test_the_controllers_of_jumps_give_all_recorded_bytes(
    tmp_path: Path, target: str, name: str
) -> None:
    graph, recording = f"aloft:{name}.yaml", tmp_path / "run.rrd"
    aloft.load(graph).run(sinks=[Recorder(recording)]).raise_if_failed()
    found = back_to_back(graph, recording, tmp_path, target)
    assert found.ticks > 1000
    assert found.signal_bytes > 1000 * found.ticks
    assert found.state_bytes > 10_000
