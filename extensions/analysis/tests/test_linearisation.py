"""Linear models of whole graphs against closed forms, and against the simulation itself."""

from pathlib import Path
from textwrap import dedent, indent

import numpy as np
import pytest

import aloft
from aloft.extensions.analysis import linearise
from aloft.extensions.analysis.coordinates import signal_coordinates
from aloft.extensions.analysis.instant import bound_graph
from aloft.extensions.analysis.period import Period
from aloft.logs.file.header import recorded_signals

GRAPHS = Path(__file__).parents[3] / "graphs"
PROJECTS = Path(__file__).parents[3] / "docs" / "projects"
T = 0.01
QUIET = {"push.force": 0.0, "robot.jitter": 0.0, "robot.sensors.joint_velocity_noise": 0.0, "robot.sensors.switch_bounce": 0.0,
         **{f"robot.sensors.{sensor}_{error}": 0.0
            for sensor in ("gyro", "accelerometer") for error in ("noise", "bias")}}  # fmt: skip


def graph(blocks: str, rate: str = "100 Hz") -> aloft.Graph:
    return aloft.load(f"rate: {rate}\nblocks:\n{indented(blocks)}")


def indented(blocks: str) -> str:
    return indent(dedent(blocks), "  ")


MASS = """
  r: {use: blocks.Constant, with: {value: [1.0], unit: m}}
  pid:
    use: blocks.PID
    with: {kp: 8.0, ki: 3.0, kd: 2.0, derivative_time_constant: 0.02, unit: s^-2}
    in: {setpoint: r.y, measured: x.y}
  v: {use: blocks.Integrator, in: {u: pid.u}}
  x: {use: blocks.Integrator, in: {u: v.y}}
"""


def test_a_mass_and_its_pid_controller_have_the_matrices_of_their_equations() -> None:
    model = linearise(graph(MASS), inputs="pid.u", outputs="x.y", at=0.1)
    assert model.states == (
        "pid.x.integral[0]", "pid.x.derivative[0]", "pid.x.before[0]", "v.x.value[0]", "x.x.value[0]",
    )  # fmt: skip
    kp, ki, kd, tau = 8.0, 3.0, 2.0, 0.02
    # D+ = (tau D + kd (d - d-)) / (tau + T) with d = -x, and u = I + D+ - kp x
    old, new = tau / (tau + T), kd / (tau + T)
    a = np.array([
        [1, 0, 0, 0, -T * ki],
        [0, old, -new, 0, -new],
        [0, 0, 0, 0, -1],
        [T, T * old, -T * new, 1, -T * (kp + new)],
        [0, 0, 0, T, 1],
    ])  # fmt: skip
    assert np.allclose(model.a, a, atol=1e-7)
    assert np.allclose(model.b[:, 0], [0, 0, 0, T, 0], atol=1e-9)
    assert model.c.tolist() == pytest.approx([0, 0, 0, 0, 1]) or np.allclose(
        model.c, [0, 0, 0, 0, 1]
    )
    assert (model.d == 0.0).all()
    assert model.output_units == ("m",)
    assert not model.uncertain
    assert model.period == T


def test_the_model_is_a_state_space_of_python_control() -> None:
    model = linearise(graph(MASS), inputs="pid.u", outputs="x.y", at=0.1)
    system = model.system
    assert (system.nstates, system.dt) == (5, T)
    assert system.input_labels == ["pid/u/value[0]"]
    assert system.output_labels == ["x/y/value[0]"]
    w = np.array([1.0, 20.0, 200.0])
    assert np.allclose(model.response(w)[:, 0, 0], system(np.exp(1j * w * T)), rtol=1e-6)


@pytest.mark.parametrize("at", [0.1, 0.11, 0.12])
@pytest.mark.parametrize("delayed", ["{from: k.y, delay: 3}", "d.y"])
def test_a_delay_is_the_same_in_whatever_place_of_its_ring(at: float, delayed: str) -> None:
    # x+ = x - g T x[n-3]
    blocks = f"""
      k: {{use: blocks.Gain, with: {{gain: -10.0, unit: 1/s}}, in: {{u: x.y}}}}
      d: {{use: blocks.Delay, with: {{samples: 3}}, in: {{u: k.y}}}}
      x: {{use: blocks.Integrator, with: {{initial: [1.0]}}, in: {{u: {delayed}}}}}
    """
    model = linearise(graph(blocks), inputs="k.y", outputs="x.y", at=at)
    expected = np.roots([1.0, -1.0, 0.0, 0.0, 10.0 * T])
    assert np.allclose(np.sort_complex(model.poles), np.sort_complex(expected), atol=1e-7)


def test_two_rates_are_lifted_to_their_common_period() -> None:
    blocks = """
      slow: {use: blocks.Gain, rate: 50 Hz, with: {gain: -10.0, unit: 1/s}, in: {u: x.y}}
      x: {use: blocks.Integrator, with: {initial: [1.0]}, in: {u: slow.y}}
    """
    model = linearise(graph(blocks), inputs=["slow.y", "x.y"], outputs="x.y", at=0.1)
    assert model.ticks == 2
    assert model.inputs == ("slow.y.value[0]", "x.y.value[0]@0", "x.y.value[0]@1")
    assert model.outputs == ("x.y.value[0]@0", "x.y.value[0]@1")
    # over two ticks u = -10 x is held: x+ = x - 10 (2 T) x
    assert np.allclose(model.a, [[1.0 - 20.0 * T]], atol=1e-8)
    # the slow block samples x only in the first of the two ticks
    assert np.allclose(model.b, [[2.0 * T, -20.0 * T, 0.0]], atol=1e-8)
    assert np.allclose(model.c, [[1.0], [1.0 - 10.0 * T]], atol=1e-8)
    assert np.allclose(model.d, [[0.0, 0.0, 0.0], [T, -10.0 * T, 0.0]], atol=1e-8)


def test_what_a_slow_block_holds_is_state_within_its_period() -> None:
    # With an offset the slow block runs after the first tick, which reads what it wrote before.
    blocks = """
      slow: {use: blocks.Gain, rate: 50 Hz, offset: 1, with: {gain: -10.0, unit: 1/s}, in: {u: x.y}}
      x: {use: blocks.Integrator, with: {initial: [1.0]}, in: {u: slow.y}}
    """
    model = linearise(graph(blocks), inputs="slow.y", outputs="x.y", at=0.1)
    assert model.states == ("x.x.value[0]", "slow.y.value[0]")
    # x1 = x + T u, u+ = -10 x1, x2 = x1 + T u+
    a = [[1.0 - 10.0 * T, T * (1.0 - 10.0 * T)], [-10.0, -10.0 * T]]
    assert np.allclose(model.a, a, atol=1e-7)


def test_an_opened_wire_gives_the_loops_own_transfer() -> None:
    closed = linearise(graph(MASS), inputs="pid.u", outputs="pid.u", at=0.1)
    opened = linearise(graph(MASS), inputs="pid.u", outputs="pid.u", at=0.1, opened=True)
    assert np.allclose(np.sort(np.abs(opened.poles)), [0.0, 2.0 / 3.0, 1.0, 1.0, 1.0], atol=1e-4)
    w = np.logspace(-1, 2, 20)
    loop, around = opened.response(w)[:, 0, 0], closed.response(w)[:, 0, 0]
    assert np.allclose(around, loop / (1.0 - loop), rtol=1e-5)


def test_a_limit_in_reach_is_uncertain_and_discrete_state_is_named() -> None:
    blocks = """
      k: {use: blocks.Gain, with: {gain: -50.0, unit: 1/s}, in: {u: x.y}}
      s: {use: blocks.Saturation, with: {lower: 0.0, upper: 5.0}, in: {u: k.y}}
      x: {use: blocks.Integrator, in: {u: s.y}}
    """
    model = linearise(graph(blocks), inputs="k.y", outputs="x.y", at=0.1)
    assert list(model.uncertain) == ["x.x.value[0]", "k.y.value[0]"]
    held = linearise(graph(MASS), inputs="pid.u", outputs="x.y", at=0.1).held
    assert [str(each) for each in held] == [
        "pid: discrete, stays as in the undisturbed run: x.started"
    ]


HIDDEN = '''
from aloft import Block, Input, Output
from aloft.blocks.general.vectors import Vector

class Counts(Block):
    """Adds up outside of its declared state."""
    u = Input(Vector)
    y = Output(Vector)
    total = 0.0

    @classmethod
    def example_parameters(cls):
        return {"n": 1}

    def step(self) -> None:
        self.total += 1.0
        self.y.value[:] = self.total + self.u.value
'''


def test_a_block_that_hides_state_is_named(tmp_path: Path) -> None:
    (tmp_path / "hides.py").write_text(
        HIDDEN.replace(
            "Block):", "Block):\n    class Params(VectorParameters):\n        pass\n", 1
        ).replace("import Vector", "import Vector, VectorParameters")
    )
    text = "rate: 100 Hz\nblocks:\n" + indented("""
      x: {use: blocks.Constant, with: {value: [1.0]}}
      c: {use: 'hides:Counts', in: {u: x.y}}
    """)
    loaded = aloft.load(text, path=tmp_path / "graph.yaml")
    with pytest.raises(aloft.AloftError, match="block 'c' does not repeat itself from a snapshot"):
        linearise(loaded, inputs="x.y", outputs="c.y", at=0.1)


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({"inputs": "pid.v", "at": 0.1}, "there is no signal 'pid.v'; there is pid.u"),
        ({"inputs": "pid", "at": 0.1}, "'pid' is no signal; write block.port.field"),
        ({"inputs": "pid.u[3]", "at": 0.1}, r"pid.u\[3\]: \[3\] is outside of 1 elements"),
        ({"inputs": "pid.u", "when": "x.y.value > high"}, "'high' is no value of x.y.value"),
        ({"inputs": "pid.u", "when": "x.y ~ 3"}, "is no condition; write block.port.field == value"),
        ({"inputs": "pid.u", "when": "x.w == 3"}, "there is no one signal 'x.w'"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_said(asked: dict, text: str) -> None:
    with pytest.raises(aloft.AloftError, match=text):
        linearise(graph(MASS), outputs="x.y", **asked)


def test_a_run_ends_before_the_instant() -> None:
    short = aloft.load(f"rate: 100 Hz\nduration: 0.5 s\nblocks:\n{indented(MASS)}")
    with pytest.raises(aloft.AloftError, match=r"the run ended at 0.5 s, before 2 s: the duration"):
        linearise(short, inputs="pid.u", outputs="x.y", at=2.0)
    with pytest.raises(aloft.AloftError, match=r"'x.y > 50' never held: the run ended at 0.5 s"):
        linearise(short, inputs="pid.u", outputs="x.y", when="x.y > 50")


def test_a_run_is_left_where_it_was() -> None:
    with graph(MASS).open() as run, graph(MASS).open() as other:
        linearise(run, inputs="pid.u", outputs="x.y", when="x.y > 0.1")
        other.step(run.tick)
        assert run["x.y.value"] > 0.1
        assert run.snapshot() == other.snapshot()


def test_the_cart_pole_has_the_poles_of_its_equations() -> None:
    """M q'' + D q' + K q = S f of a cart with a uniform pole, upright, by hand."""
    loaded = aloft.load(
        PROJECTS / "cart_pole" / "balance.yaml",
        {"robot.sensors.joint_velocity_noise": "0 rad/s", "robot.latency": "0 s"},
    )
    model = linearise(
        loaded, inputs="balance.command.torque[slide]", outputs="balance.command.torque[slide]",
        at=3.9, opened=True,
    )  # fmt: skip
    found = np.log(model.poles[np.abs(model.poles) > 0.1].astype(complex)) / model.period
    with loaded.open() as run:
        mj = run.block("robot").plant.model  # type: ignore[attr-defined]
        pole = int(mj.body("pole").id)
        m, com, inertia = mj.body_mass[pole], mj.body_ipos[pole][2], mj.body_inertia[pole][0]
        cart, damping, armature = (
            mj.body_mass[int(mj.body("cart").id)],
            mj.dof_damping,
            mj.dof_armature,
        )
    mass = np.array([[cart + m, m * com], [m * com, inertia + m * com**2]]) + np.diag(armature)
    stiffness = np.array([[0.0, 0.0], [0.0, -m * 9.81 * com]])
    inverse = np.linalg.inv(mass)
    rate = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ np.diag(damping)]]
    )
    expected = np.linalg.eigvals(rate)
    fast = sorted(expected.real)
    assert max(found.real) == pytest.approx(fast[-1], rel=5e-3)
    assert min(found.real) == pytest.approx(fast[0], rel=5e-3)


@pytest.mark.long
def test_the_period_makes_the_bytes_of_the_runtime_and_the_model_its_response() -> None:
    """A chirp of some mN m on the knees of the standing robot, in the model and in the simulation."""
    with aloft.load(GRAPHS / "push.yaml", QUIET).open() as run:
        run.step(750)
        bound = bound_graph(run)
        signals = {field.name: field for field in recorded_signals(bound)}
        knees = signal_coordinates(bound, signals, "joint_pd.command.torque[*_knee]")
        height = signal_coordinates(bound, signals, "estimator.base.position")
        model = linearise(
            run, inputs="joint_pd.command.torque[*_knee]", outputs="estimator.base.position"
        )
        assert not model.uncertain
        start, count = run.snapshot(), 40
        times = np.arange(count) * model.period
        chirp = 2e-3 * np.sin(2.0 * np.pi * (5.0 + 100.0 * times) * times)

        def simulated(torque: np.ndarray) -> np.ndarray:
            run.restore(start)
            seen = []
            for each in torque:
                period = Period(bound, [knees], [height])
                period.displacement[0][:] = each
                period.run()
                seen.append(period.observed[0][0].copy())
            return np.array(seen)

        undisturbed = simulated(np.zeros(count))
        ended = run.snapshot()
        run.restore(start)
        run.step(count)
        assert run.snapshot() == ended
        response = simulated(chirp) - undisturbed
        x, expected = np.zeros(len(model.states)), []
        for each in chirp:
            u = np.full(2, each)
            expected.append(model.c @ x + model.d @ u)
            x = model.a @ x + model.b @ u
    size = np.abs(response).max()
    assert size > 1e-7
    assert np.abs(response - np.array(expected)).max() < 0.05 * size
