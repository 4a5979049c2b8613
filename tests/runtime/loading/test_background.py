"""How a graph says that a block works in the background, and what is wrong with it."""

from pathlib import Path

import pytest

from aloft.files.problems import Code, Problem
from aloft.runtime.background.background_block import BackgroundBlock
from aloft.runtime.loading import check, checked_file, checked_text
from aloft.runtime.loading.checked import LoadError
from aloft.runtime.placement.age import worst_age

GRAPH = """
rate: 500 Hz
duration: 0.1 s
blocks:
  wave: {use: blocks.SineWave}
  slow:
    use: blocks.Gain
    in: {u: wave.y}
    rate: 250 Hz
    background: BACKGROUND
  out: {use: blocks.Gain, in: {u: slow.y}}
"""


def graph(background: str, text: str = GRAPH) -> str:
    return text.replace("BACKGROUND", background)


def problems(background: str, text: str = GRAPH) -> list[Problem]:
    with pytest.raises(LoadError) as error:
        checked_text(graph(background, text), "graph.yaml")
    return list(error.value.report.problems)


def test_the_block_is_a_delay_of_so_many_runs() -> None:
    checked = checked_text(graph("{latency: 60 ms, late: hold}"), "graph.yaml")
    kind = checked.block("slow").block_type
    assert issubclass(kind, BackgroundBlock)
    assert (kind.is_moore(), kind.delay_runs, kind.__name__) == (True, 15, "Gain")
    assert checked_text(checked.text, "graph.yaml").text == checked.text
    assert "background: {latency: 60 ms, late: hold}" in checked.text


def test_ages_of_paths_count_the_latency() -> None:
    loop = graph("{latency: 60 ms}").replace("    background: {latency: 60 ms}\n", "")
    ages = [
        worst_age(checked_text(text, "graph.yaml"), "wave.y", "out.u")
        for text in (loop, graph("{latency: 60 ms}"))
    ]
    assert ages[0] == pytest.approx(0.004)
    assert ages[1] == pytest.approx(0.064)


def test_a_path_that_becomes_too_old_is_reported() -> None:
    text = GRAPH + "machines: {a: tcp/127.0.0.1:7450}\nlinks: {paths: {wave.y -> out.u: 60 ms}}\n"
    (found,) = problems("{latency: 60 ms}", text)
    assert found.code is Code.AGE
    assert found.message == "the newest wave.y at out.u can be 64 ms old"


@pytest.mark.parametrize(
    ("latency", "nearest"),
    [
        ("59 ms", ("56 ms", "60 ms")),
        ("3 ms", ("4 ms",)),
        ("2 us", ("4 ms",)),
        ("10 s", ("4000 ms",)),
    ],
)
def test_a_latency_is_a_multiple_of_the_period(latency: str, nearest: tuple[str, ...]) -> None:
    (found,) = problems(f"{{latency: {latency}}}")
    assert found.code is Code.BACKGROUND
    assert found.message.startswith(
        "the outputs of slow, which runs every 4 ms, cannot appear after"
    )
    assert (found.expected, found.found) == ("a multiple of 4 ms, up to 4000 ms", latency)
    assert found.nearest == nearest
    assert found.fix == f"latency: {nearest[-1]}"
    assert (found.where.line, found.at) == (10, "slow.background.latency")


@pytest.mark.parametrize(
    ("background", "code", "message"),
    [
        ("{}", Code.MISSING_KEY, "slow works in the background, and does not say its latency"),
        ("60 ms", Code.WRONG_KIND, "'background' cannot be the text '60 ms'"),
        ("{latency: fast}", Code.BAD_VALUE, "slow.background.latency cannot be the text 'fast'"),
        ("{latency: -4 ms}", Code.BAD_VALUE, "slow.background.latency cannot be the text '-4 ms'"),
        ("{latency: 4 ms, late: wait}", Code.BAD_VALUE, "slow.background.late cannot be the text 'wait'"),
        ("{latenzy: 4 ms, latency: 4 ms}", Code.UNKNOWN_KEY, "'latenzy' is not a key of 'slow.background'"),
        ("{latency: 4 ms, initial: {z: {value: 0}}}", Code.INITIAL, "slow has no output 'z'"),
        ("{latency: 4 ms, initial: {y: {valu: 0}}}", Code.INITIAL, "Vector has no field 'valu'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(background: str, code: Code, message: str) -> None:
    (found,) = problems(background)
    assert found.code is code
    assert found.message.startswith(message)
    assert found.where.line == 10


def test_it_breaks_a_loop() -> None:
    text = GRAPH.replace("{u: wave.y}", "{u: out.y}")
    assert checked_text(graph("{latency: 4 ms}", text), "graph.yaml").order
    (found,) = problems("", text.replace("    background: BACKGROUND\n", ""))
    assert found.code is Code.LOOP


@pytest.mark.parametrize(
    ("use", "reason"),
    [
        ("hal.MujocoRobot", "its outputs come from outside the graph"),
        ("blocks.External", "Python sets its output between two ticks"),
    ],
)
def test_what_belongs_on_the_control_thread_stays_there(use: str, reason: str) -> None:
    text = f"rate: 500 Hz\nrobot: bruce\nblocks: {{a: {{use: {use}, background: {{latency: 4 ms}}}}}}\n"
    found = [each for each in problems("", text) if each.code is Code.BACKGROUND]
    assert [each.message for each in found] == [
        f"a ({use}) cannot work in the background: {reason}"
    ]


def test_a_parameter_of_a_sub_graph_may_be_the_latency(tmp_path: Path) -> None:
    (tmp_path / "part.yaml").write_text(
        "inputs: {u: required}\nparameters: {latency: 8 ms}\noutputs: {y: slow.y}\n"
        "blocks: {slow: {use: blocks.Gain, in: {u: inputs.u}, background: {latency: $latency}}}\n"
    )
    main = tmp_path / "main.yaml"
    blocks = "wave: {use: blocks.SineWave}, part: {use: part.yaml, with: {latency: 6 ms}, in: {u: wave.y}}"
    main.write_text(f"rate: 500 Hz\nblocks: {{{blocks}}}\n")
    assert checked_file(main).block("part/slow").block_type.delay_runs == 3
    main.write_text(
        f"rate: 500 Hz\nblocks: {{{blocks.replace('with:', 'background: {latency: 6 ms}, with:')}}}\n"
    )
    (found,) = check(main).problems
    assert found.code is Code.MISPLACED_KEY
