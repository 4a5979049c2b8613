"""The worst age on a path, from rates, offsets, delays and free-running links."""

from pathlib import Path

import pytest

from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading import LoadError, checked_file, checked_text
from aloft.runtime.placement.age import worst_age
from aloft.runtime.placement.placed import PlacementError

PATH = Path("graph.yaml")
HEAD = "rate: 100 Hz\nblocks:\n"
SENSOR = "  sensor: {use: blocks.Constant, with: {value: [1.0]}}\n"


def age(blocks: str, target: str, head: str = HEAD) -> float | None:
    return worst_age(checked_text(head + SENSOR + blocks, PATH), "sensor.y", target)


def test_in_one_tick_the_value_is_used_for_one_period() -> None:
    chain = "  a: {use: blocks.Gain, in: {u: sensor.y}}\n  b: {use: blocks.Gain, in: {u: a.y}}\n"
    assert age(chain, "b.u") == pytest.approx(0.01)


@pytest.mark.parametrize("delay", [1, 2, 5])
def test_a_delay_adds_its_periods(delay: int) -> None:
    chain = f"  a: {{use: blocks.Gain, in: {{u: {{from: sensor.y, delay: {delay}}}}}}}\n"
    chain += "  b: {use: blocks.Gain, in: {u: a.y}}\n"
    assert age(chain, "b.u") == pytest.approx(0.01 * (1 + delay))


def test_a_block_with_state_adds_a_period() -> None:
    chain = "  a: {use: blocks.UnitDelay, in: {u: sensor.y}}\n"
    chain += "  b: {use: blocks.Gain, in: {u: a.y}}\n"
    assert age(chain, "b.u") == pytest.approx(0.02)


def test_rates_and_offsets() -> None:
    slow = "  a: {use: blocks.Gain, in: {u: sensor.y}, rate: 25 Hz}\n"
    # the slow block's value is read up to three ticks later, and a slow reader holds it for four
    assert age(slow + "  b: {use: blocks.Gain, in: {u: a.y}}\n", "b.u") == pytest.approx(0.04)
    late = "  b: {use: blocks.Gain, in: {u: a.y}, rate: 25 Hz, offset: 3}\n"
    assert age(slow + late, "b.u") == pytest.approx(0.03 + 0.04)


def test_the_way_with_the_newest_sample_counts_and_loops_do_no_harm() -> None:
    blocks = (
        "  old: {use: blocks.Gain, in: {u: {from: sensor.y, delay: 9}}}\n"
        "  sum: {use: blocks.Sum, in: {a: sensor.y, b: {from: b.y, delay: 1}}}\n"
        "  mix: {use: blocks.Sum, in: {a: old.y, b: sum.y}}\n"
        "  b: {use: blocks.Gain, in: {u: mix.y}}\n"
    )
    assert age(blocks, "b.u") == pytest.approx(0.01)


def test_free_running_links_add_their_limits() -> None:
    head = (
        "rate: 100 Hz\nclock: {kind: paced}\n"
        "machines: {near: tcp/127.0.0.1:7450, far: tcp/127.0.0.1:7451}\n"
        "links: {mode: free, max_age: 5 ms, of: {a: {max_age: 3 ms}}}\nblocks:\n"
    )
    chain = "  a: {use: blocks.Gain, in: {u: sensor.y}, on: far}\n"
    chain += "  b: {use: blocks.Gain, in: {u: a.y}}\n"
    assert age(chain, "b.u", head) == pytest.approx(0.005 + 0.003 + 0.01)
    assert age(chain, "b.u", head.replace("mode: free", "mode: lockstep")) == pytest.approx(0.01)


def test_what_does_not_depend_on_it_has_no_age() -> None:
    blocks = "  other: {use: blocks.Constant, with: {value: [1.0]}}\n"
    blocks += "  b: {use: blocks.Gain, in: {u: other.y}}\n"
    assert age(blocks, "b.u") is None


def test_ends_that_do_not_exist() -> None:
    graph: CheckedGraph = checked_text(
        HEAD + SENSOR + "  b: {use: blocks.Gain, in: {u: sensor.y}}\n", PATH
    )
    with pytest.raises(PlacementError, match=r"no wired output 'sensor.x'; sensor has y"):
        worst_age(graph, "sensor.x", "b.u")
    with pytest.raises(PlacementError, match=r"there is no wired input 'c.u'"):
        worst_age(graph, "sensor.y", "c.u")


def test_the_jump_uses_what_it_has_just_measured() -> None:
    graph = checked_file(Path(__file__).parents[3] / "graphs" / "jump.yaml")
    assert worst_age(graph, "robot.imu", "robot.command") == pytest.approx(0.002)


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        ("sensor.y -> b.u: 9 ms", "age: the newest sensor.y at b.u can be 10 ms old"),
        ("sensor.x -> b.u: 9 ms", "age: there is no wired output 'sensor.x'; sensor has y"),
        ("sensor.y to b.u: 9 ms", "age: 'sensor.y to b.u' is no path"),
        ("sensor.y -> b.u: soon", "bad-value: links.paths.sensor.y -> b.u cannot be"),
    ],
)
def test_assertions_are_part_of_the_load_report(path: str, problem: str) -> None:
    text = HEAD + SENSOR + "  b: {use: blocks.Gain, in: {u: sensor.y}}\n"
    with pytest.raises(LoadError) as caught:
        checked_text(f"{text}links: {{paths: {{{path}}}}}\n", PATH)
    (found,) = caught.value.report.problems
    assert f"{found.code}: {found.message}".startswith(problem)


def test_an_assertion_that_holds() -> None:
    text = HEAD + SENSOR + "  b: {use: blocks.Gain, in: {u: sensor.y}}\n"
    graph = checked_text(f"{text}links: {{paths: {{sensor.y -> b.u: 10 ms}}}}\n", PATH)
    assert graph.links.paths == {"sensor.y -> b.u": 0.01}
    assert checked_text(graph.text, PATH).links == graph.links
