"""Graphs as Gymnasium environments: Gymnasium's own checker, seeds, ends, and mistakes."""

import warnings

import numpy as np
import pytest

from aloft import AloftError, load

from .needed import needs

needs("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env

from aloft import environments

GRAPH = """
rate: 100 Hz
duration: 1 s
blocks:
  action: {use: blocks.External, with: {unit: m/s}}
  noise: {use: blocks.WhiteNoise, with: {std: 0.1, unit: m/s}}
  speed: {use: blocks.Sum, in: {a: action.y, b: noise.y}}
  place: {use: blocks.Integrator, in: {u: speed.y}}
  cost: {use: blocks.Expression, with: {expression: a ** 2}, in: {a: place.y}}
  reward: {use: blocks.Gain, with: {gain: -1}, in: {u: cost.y}}
  bounds: {use: blocks.Assertion, with: {upper: 0.3}, in: {u: place.y}}
"""


def environment(graph: str = GRAPH, **options: object) -> environments.GraphEnvironment:
    return environments.make(
        graph, action="action", observation=["place.y.value", "speed.y.value"],
        reward="reward.y.value", ticks=5, action_limits=(-10.0, 10.0), **options,  # type: ignore[arg-type]
    )  # fmt: skip


def test_gymnasiums_checker_finds_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it advises finite observation limits
        check_env(environment(), skip_render_check=True)


def test_a_seed_repeats_an_episode_and_episodes_without_differ() -> None:
    env = environment()
    first, _ = env.reset(seed=3)
    path = [env.step(np.zeros(1))[0] for _ in range(3)]
    other, _ = env.reset()
    again, _ = env.reset(seed=3)
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    assert np.array_equal(path, [env.step(np.zeros(1))[0] for _ in range(3)])
    env.close()


def test_an_episode_ends_by_a_block_or_by_the_duration() -> None:
    env = environment()
    env.reset(seed=1)
    ended = env.step(np.array([10.0]))[2:]
    assert ended[:2] == (True, False) and "bounds" in ended[2]["reason"]
    env.reset(seed=1)
    steps = 0
    while True:
        _, reward, terminated, truncated, info = env.step(np.zeros(1))
        steps += 1
        assert reward <= 0.0 and not terminated
        if truncated:
            break
    assert steps == 20 and info["reason"] == "the duration is over"


def test_a_step_after_the_end_is_an_error() -> None:
    env = environment()
    env.reset(seed=1)
    while not env.step(np.array([10.0]))[2]:
        pass
    with pytest.raises(AloftError, match=r"the episode is over \(.*bounds.*\); call reset"):
        env.step(np.zeros(1))
    env.reset(seed=1)
    env.step(np.zeros(1))


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([10.5], "element 0 of the action is 10.5, outside of its limits -10 to 10"),
        ([np.nan], "element 0 of the action is nan, outside"),
        ([0.0, 0.0], r"an action has the shape \(1,\), not \(2,\)"),
    ],
)
def test_an_action_outside_its_box_is_an_error(action: list[float], message: str) -> None:
    env = environment()
    env.reset(seed=1)
    with pytest.raises(AloftError, match=message):
        env.step(np.array(action))


def test_normalised_actions_stand_for_the_limits() -> None:
    found = []
    for normalised, action in ((False, -4.0), (True, -0.4)):
        env = environment(normalised=normalised)
        env.reset(seed=2)
        found.append(env.step(np.array([action]))[0])
    assert np.array_equal(*found) and env.action_space.high == [1.0]
    with pytest.raises(AloftError, match="normalised actions need finite action_limits"):
        environments.make(
            GRAPH, action="action", observation="place.y.value", reward="reward.y.value",
            action_limits=(-1.0, np.inf), normalised=True,
        )  # fmt: skip


def test_many_live_in_one_process() -> None:
    graph = load(GRAPH)
    many = [
        environments.make(
            graph, action="action", observation="place.y.value", reward=lambda run: run.time
        )
        for _ in range(8)
    ]
    for number, env in enumerate(many):
        env.reset(seed=number)
    found = [env.step(np.ones(1))[0].item() for env in many]
    assert len(set(found)) == 8
    assert many[0].step(np.ones(1))[1] == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"action": "speed"}, AloftError, "the action 'speed' is no block blocks.External"),
        ({"observation": []}, AloftError, "at least one observation"),
        ({"observation": "plaec.y.value"}, KeyError, "the nearest is place.y.value"),
        ({"reward": "action"}, KeyError, "no signal 'action'"),
        ({"ticks": 0}, AloftError, "a step is at least 1 tick, not 0"),
    ],
)
def test_mistakes(options: dict[str, object], error: type[Exception], message: str) -> None:
    base: dict[str, object] = {
        "action": "action", "observation": "place.y.value", "reward": "reward.y.value",
    }  # fmt: skip
    with pytest.raises(error, match=message):
        environments.make(GRAPH, **{**base, **options})  # type: ignore[arg-type]


@pytest.mark.parametrize("ticks", [1, 5])
def test_a_fall_in_the_last_tick_is_a_fall(ticks: int) -> None:
    """The bound is broken in tick 99 of 100, or one tick sooner."""
    text = GRAPH.replace(
        "blocks.WhiteNoise, with: {std: 0.1", "blocks.Constant, with: {value: [0.0]"
    )
    env = environments.make(
        text.replace("upper: 0.3", "upper: 0.975"), action="action", observation="place.y",
        reward="reward.y", ticks=ticks,
    )  # fmt: skip
    env.reset()
    while True:
        *_, terminated, truncated, info = env.step(np.ones(1))
        if terminated or truncated:
            break
    assert (terminated, truncated) == (True, False) and "bounds" in info["reason"]
    assert info["time"] == pytest.approx(1.0)


@pytest.mark.filterwarnings("ignore:overflow encountered in cast")  # gymnasium's own
def test_rounding_at_a_limit_is_no_mistake() -> None:
    rng = np.random.default_rng(0)
    pairs = [(-0.1, 0.3), (-1.1, 2.2), (0.0, 0.3), *rng.uniform(-5.0, 5.0, (20, 2)).round(2)]
    for pair in pairs:
        low, high = sorted(float(each) for each in pair)
        env = environments.make(
            GRAPH, action="action", observation="place.y", reward="reward.y",
            action_limits=(low, high),
        )  # fmt: skip
        scaled = gymnasium.wrappers.RescaleAction(env, np.float32(-1), np.float32(1))
        scaled.reset(seed=0)
        for end, limit in ((-1.0, low), (1.0, high)):
            scaled.step(np.array([end]))
            assert low <= env._running()["action.y.value"][0] <= high
            env.step(np.array([limit], np.float32))
            assert env._running()["action.y.value"][0] == pytest.approx(limit, abs=1e-6)
        with pytest.raises(AloftError, match="outside of its limits"):
            env.step(np.array([high + 1e-4 * (high - low)]))
        env.close()


def test_a_port_is_all_its_fields() -> None:
    env = environments.make(
        GRAPH, action="action", observation=["place.y", "bounds.ok"], reward="reward.y"
    )
    observation, _ = env.reset(seed=1)
    assert observation.shape == (2,) and observation[1] == 1.0
    assert env.step(np.ones(1))[1] == env._running()["reward.y.value"][0]
    wide = GRAPH.replace("{std: 0.1,", "{std: 0.1, n: 2,").replace("a: action.y,", "a: noise.y,")
    wide = wide.replace("blocks.Sum", "blocks.Sum, with: {n: 2}").split("  place:")[0]
    with pytest.raises(AloftError, match=r"the reward speed\.y has 2 numbers, expected one"):
        environments.make(wide, action="action", observation="speed.y", reward="speed.y")
