"""A pendubot's logged swing-up, and the same controller on the same robot in the simulator.

::

    python -m aloft.lab.studies.swing_up

The log is of design A.0 in closed loop (``shared/data/double_pendulum/swing_up``): TVLQR along a nominal trajectory, LQR at the
top, friction compensated, speeds filtered, 400 Hz. The robot here has the published links (whose inertias are about the joint) and
rotors. Each row is one effect: how far the swing is from the measured one, and what happens at the top.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ... import load
from ...blocks.signals import JointCommand, JointState
from ...mathematics.arrays import Array
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from . import DATA

FOLDER = DATA / "double_pendulum" / "swing_up"
MASSES, LENGTH, COMS = (0.5593806151425046, 0.6043459469186889), 0.3, (0.3, 0.18377686083653508)
ABOUT_JOINT = (0.053470810264216295, 0.02392374528789766)
"""Published masses [kg], length of the first link and distances of the centres of mass [m], inertias [kg m^2]."""
ROTOR = 0.00276
"""Rotors behind their gears [kg m^2]."""
FRICTION, VISCOUS = (0.117, 0.124), (0.0173, 0.0085)
"""Friction of the joints [N m, N m s/rad], the best of 341 random ones of 0.07 to 0.16 and 0.001 to 0.025, by the swing with
latency; the compensated one is 0.146, 0.121 and 0.011, 0.004 at speed."""
COMPENSATED, DAMPING = np.array([0.09284, 0.07708]), np.array([0.01108, 0.0044])
"""Compensated friction: coulomb [N m] times arctan(100 v), and damping [N m s/rad]. The log's column of it is this."""
CAUGHT = 2.0
"""Value of the LQR's Riccati equation below which it takes over: the log's falls from 2.33 to 1.77 when it does, at 4.41 s."""
EVERY = 5
"""Rows of the nominal trajectory, 1 ms apart, from one gain to the next."""
TOPMOST = np.array([math.pi, 0.0, 0.0, 0.0])
CONTROLLER = "aloft.lab.studies.swing_up:Controller"
SHARE, LIMIT, TOP = 0.2, 5.0, 8.0
"""The speeds' filter, the torque's limit [N m], and the time from which on the top is looked at [s]."""
_GEARS = {"stiffness": 1000.0, "damping": 0.5}
_LOGGED: dict[str, dict[str, Any]] = {
    "no friction, no rotors": {"free": True},
    "friction and rotors": {},
    "latency 5 ms": {"latency": "5 ms"},
    "latency 8 ms": {"latency": "8 ms"},
    "latency 9 ms": {"latency": "9 ms"},
    "latency 10 ms": {"latency": "10 ms"},
    "latency 8 ms, encoders of 10 mrad": {"latency": "8 ms", "sensors": {"encoder_resolution": 0.01}},
    "latency 8 ms, gears of 1000 N m/rad": {"latency": "8 ms", "gears": _GEARS},
    "latency 8 ms, static friction x 2": {"latency": "8 ms", "joints": {"static_friction": 2.0}},
    "latency 8 ms, friction of the elbow x 1.35": {"latency": "8 ms", "elbow": 1.35},
    "latency 2 ms, gears of 1000 N m/rad": {"latency": "2 ms", "gears": _GEARS},
}  # fmt: skip
_STIFF: dict[str, dict[str, Any]] = {
    "friction and rotors": {},
    "latency 3 ms": {"latency": "3 ms"},
    "latency 4 ms": {"latency": "4 ms"},
    "latency 4 ms, static friction x 3": {"latency": "4 ms", "joints": {"static_friction": 3.0}},
    "latency 4 ms, encoders of 2 mrad": {"latency": "4 ms", "sensors": {"encoder_resolution": 0.002}},
    "latency 5 ms": {"latency": "5 ms"},
    "latency 8 ms": {"latency": "8 ms"},
    "latency 8 ms, speed noise": {"latency": "8 ms", "noise": 0.05},
    "latency 8 ms, static friction x 2": {"latency": "8 ms", "joints": {"static_friction": 2.0}},
    "latency 2 ms, gears of 1000 N m/rad": {"latency": "2 ms", "gears": _GEARS},
    "the same, play of 10 mrad": {"latency": "2 ms", "gears": {**_GEARS, "backlash": 0.01}},
}  # fmt: skip
EFFECTS = _LOGGED | {f"stiff: {name}": {"stiff": True, **each} for name, each in _STIFF.items()}


def moments() -> tuple[float, float]:
    """Return the links' inertias about their centres of mass [kg m^2], at least those of a thin rod's tenth."""
    found = [i - m * c**2 for i, m, c in zip(ABOUT_JOINT, MASSES, COMS, strict=True)]
    return max(found[0], 1e-4), max(found[1], 1e-4)


def write_robot(folder: Path, free: bool = False, elbow: float = 1.0) -> Path:
    """Write the pendubot's description, ``free`` of friction and rotors, or with ``elbow`` times the friction there."""
    first, second = moments()

    def link(name: str, mass: float, com: float, moment: float) -> str:
        return (
            f'<link name="{name}"><inertial><origin xyz="0 0 {-com}"/><mass value="{mass}"/>'
            f'<inertia ixx="{moment}" iyy="{moment}" izz="{0.1 * moment}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    def joint(name: str, parent: str, child: str, down: float) -> str:
        return (
            f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 {-down}"/>'
            '<axis xyz="1 0 0"/><limit effort="6" velocity="50"/></joint>'
        )

    (folder / "pendubot.urdf").write_text(
        '<robot name="pendubot">' + link("upper", MASSES[0], COMS[0], first)
        + link("lower", MASSES[1], COMS[1], second) + joint("shoulder", "world", "upper", 0.0)
        + joint("elbow", "upper", "lower", LENGTH) + "</robot>"
    )  # fmt: skip
    file = folder / "pendubot.yaml"
    file.write_text(
        "file: pendubot.urdf\nname: pendubot\ntext: design A.0, as published\nbase_joint: fixed\nprofiles:\n"
        + (
            "  free: {friction: 0, damping: 0, rotor_inertia: 0}\n"
            if free
            else f"  real: {{friction: {FRICTION[0]}, damping: {VISCOUS[0]}, rotor_inertia: {ROTOR}, "
            f"motors: {{elbow: {{friction: {elbow * FRICTION[1]}, damping: {VISCOUS[1]}}}}}}}\n"
        )
        + "sensors: {imu: false, switches: false}\n"
    )
    return file


def accelerations(state: Array, torque: float, known: Mapping[str, float]) -> Array:
    """Return the pendubot's accelerations (2,) by the parameters that its controller knows, without friction."""
    q1, q2, v1, v2 = state
    length, g = known["length1"], known["gravity"]
    lever = known["mass2"] * known["com2"]
    h, c, s = length * lever, math.cos(q2), math.sin(q2)
    one, two = known["inertia1"] + known["mass2"] * length**2, known["inertia2"]
    mass = np.array([[one + two + 2 * h * c, two + h * c], [two + h * c, two]])
    bias = np.array([-h * s * (2 * v1 * v2 + v2**2), h * s * v1**2])
    second = g * lever * math.sin(q1 + q2)
    first = g * (known["mass1"] * known["com1"] + known["mass2"] * length) * math.sin(q1)
    return np.linalg.solve(
        mass, np.array([torque, 0.0]) - bias - np.array([first + second, second])
    )


def nominal_trajectory() -> Any:
    """Return the rows of the nominal trajectory, by name."""
    return np.genfromtxt(FOLDER / "init_trajectory.csv", delimiter=",", names=True)


def weights_of(kind: str) -> tuple[Array, Array]:
    """Return the logged weights of states (4, 4) and of the shoulder's torque (1, 1) of ``tvlqr`` or ``lqr``."""
    states, effort = (np.loadtxt(FOLDER / f"{kind}_controller_{name}matrix.txt") for name in "QR")
    return states, effort[:1, :1]


@cache
def known_parameters() -> dict[str, float]:
    """Return the parameters of the robot that its controllers know."""
    text = (FOLDER / "tvlqr_controller_parameters.yml").read_text()
    return {name: float(value) for name, value in yaml.safe_load(text).items()}


def linear(state: Array, torque: float) -> tuple[Array, Array]:
    """Return the system (4, 4) and the torque's effect (4, 1) about a state, by the parameters that the controllers know."""
    known = known_parameters()
    system, pushed = np.zeros((4, 4)), np.zeros((4, 1))
    system[:2, 2:] = np.eye(2)
    for j, step in enumerate(1e-5 * np.eye(5)):
        ahead = accelerations(state + step[:4], torque + step[4], known)
        slope = (ahead - accelerations(state - step[:4], torque - step[4], known)) / 2e-5
        (pushed if j == 4 else system)[2:, j % 4] = slope
    return system, pushed


@cache
def value_at_the_top() -> Array:
    """Return the value function (4, 4) of the LQR at the top; its gains are the logged ones to 1e-8."""
    from scipy.linalg import solve_continuous_are

    return np.asarray(solve_continuous_are(*linear(TOPMOST, 0.0), *weights_of("lqr")))


@cache
def time_varying_gains(stiff: bool = False) -> tuple[Array, Array]:
    """Return times and gains (n, 4) of the LQR along the nominal trajectory as the log has it.

    At each time it is that of the nominal state's linear system over a hundred steps, with the logged weights at each step. With it
    the logged states give the logged torques to 0.05 N m of 1.0, half of them to 0.003. A ``stiff`` one, of a Riccati equation along
    the whole trajectory, gives them to 1.0: it is not the log's, and holds the arm to the trajectory in spite of what is tried.
    """
    weights, effort = weights_of("tvlqr")
    nominal, gains = nominal_trajectory(), []
    chosen = range(0, len(nominal), EVERY)
    step, horizon = (0.001 * EVERY, 1) if stiff else (0.001, 100)
    value, at_each = weights, step if stiff else 1.0
    for k in reversed(chosen):
        state = np.array([nominal[f"{kind}{j}"][k] for kind in ("pos", "vel") for j in (1, 2)])
        system, pushed = linear(state, float(nominal["tau1"][k]))
        onward, pushed = np.eye(4) + step * system, step * pushed
        value, gain = value if stiff else weights, weights
        for _ in range(horizon):
            gain = pushed.T @ value @ onward / (at_each * effort + pushed.T @ value @ pushed)
            value = at_each * weights + onward.T @ value @ (onward - pushed @ gain)
        gains.append(gain[0])
    return np.array(nominal["time"][chosen]), np.array(gains[::-1])


class Filtered(Signal):
    """Memory of the controller."""

    speed = Field("n_joints", unit="rad/s", text="speed behind the filter")
    caught = Field(unit="1", text="1 once the LQR has taken over")


class Controller(Block):
    """The logged controller: TVLQR until the LQR's value is low enough, then LQR; friction compensated."""

    class Params(Parameters):
        """What differs from the log's."""

        stiff: bool = parameter(False, text="hold the arm to the trajectory, as the log does not")
        noise: float = parameter(0.0, unit="rad/s", text="standard deviation of the speeds' noise")

    params: Params
    needs = ("robot",)
    joints = Input(JointState, text="measured")
    command = Output(JointCommand, text="torques")
    filtered = State(Filtered, text="speeds")

    def setup(self) -> None:
        """Read nominal trajectory and gains."""
        self.nominal = nominal_trajectory()
        self.times, self.gains = time_varying_gains(self.params.stiff)
        self.top = np.loadtxt(FOLDER / "lqr_controller_Kmatrix.txt")[0]
        self.rng = np.random.default_rng(0)

    def step(self) -> None:
        """One tick."""
        time, nominal = self.time, self.nominal
        measured = self.joints.velocity + self.params.noise * self.rng.standard_normal(2)
        self.filtered.speed[:] += SHARE * (measured - self.filtered.speed)
        state = np.concatenate([self.joints.position, self.filtered.speed])
        away = state - TOPMOST
        if away @ value_at_the_top() @ away < CAUGHT:
            self.filtered.caught[...] = 1.0
        if not self.filtered.caught:
            wanted = np.array([np.interp(time, nominal["time"], nominal[f"{kind}{j}"])
                               for kind in ("pos", "vel") for j in (1, 2)])  # fmt: skip
            gain = np.array([np.interp(time, self.times, column) for column in self.gains.T])
            torque = np.interp(time, nominal["time"], nominal["tau1"]) + gain @ (wanted - state)
        else:
            torque = -self.top @ away
        speed = self.filtered.speed
        friction = COMPENSATED * np.arctan(100.0 * speed) + DAMPING * speed
        self.command.mode[...] = 1
        asked = np.clip(np.array([torque, 0.0]), -LIMIT, LIMIT) + friction
        self.command.torque[:] = np.clip(asked, -LIMIT, LIMIT)


def graph_of(robot: Path, effect: Mapping[str, Any], duration: float = 20.0) -> dict[str, Any]:
    """Return the graph of the swing-up with an effect of ``EFFECTS``."""
    actuators = {part: effect[part] for part in ("gears", "joints") if part in effect}
    return {
        "rate": "400 Hz", "duration": f"{duration} s", "robot": str(robot),
        "blocks": {
            "robot": {
                "use": "hal.MujocoRobot",
                "with": {
                    "latency": effect.get("latency", "0 ms"),
                    "timestep": "0.25 ms", "start": {"stand": False}, "ground": {"scene": "none"}, "actuators": actuators,
                    "sensors": effect.get("sensors", {}),
                },
                "in": {"command": "controller.command"},
            },
            "controller": {
                "use": CONTROLLER, "with": {part: effect[part] for part in ("stiff", "noise") if part in effect},
                "in": {"joints": "robot.joints"},
            },
        },
    }  # fmt: skip


def measured() -> tuple[Array, Array, Array]:
    """Return times (n,), angles (n, 2) and commanded torques (n, 2) of the log."""
    log = np.genfromtxt(FOLDER / "trajectory.csv", delimiter=",", names=True)
    both = [
        np.stack([log[f"{name}{j}"] for j in (1, 2)], axis=1) for name in ("pos_meas", "tau_con")
    ]
    return np.asarray(log["time"]), both[0], both[1]


def torque_unexplained(stiff: bool = False) -> float:
    """Return what the controller's torques by the logged states leave of the logged ones, until the LQR takes over, rms [N m]."""
    log, nominal = (
        np.genfromtxt(FOLDER / "trajectory.csv", delimiter=",", names=True),
        nominal_trajectory(),
    )
    log = log[log["time"] < 4.4]
    names = [f"{kind}{j}" for kind in ("pos", "vel") for j in (1, 2)]
    away = [
        np.interp(log["time"], nominal["time"], nominal[n]) - log[f"{n[:3]}_filt{n[3]}"]
        for n in names
    ]
    times, gains = time_varying_gains(stiff)
    torque = np.interp(log["time"], nominal["time"], nominal["tau1"])
    for column, each in zip(gains.T, away, strict=True):
        torque = torque + np.interp(log["time"], times, column) * each
    asked = np.clip(np.clip(torque, -LIMIT, LIMIT) + log["tau_fric1"], -LIMIT, LIMIT)
    return float(np.sqrt(np.mean((asked - log["tau_con1"]) ** 2)))


def figures(time: Array, angles: Array, torque: Array) -> dict[str, Any]:
    """Return what a run is like: how far its swing is from the log's, and its sway and torque at the top."""
    at, logged, _ = measured()
    apart = np.stack([angles[:, j] - np.interp(time, at, logged[:, j]) for j in (0, 1)], axis=1)
    rise, whole = (np.sqrt((apart[time < end] ** 2).mean(axis=0)) for end in (4.4, 5.998))
    top = time > TOP
    shoulder = torque[top, 0]
    changes = float((np.diff(np.sign(shoulder)) != 0).sum()) / (float(time[-1]) - TOP)
    return {
        "rise": rise, "apart": whole, "sway": angles[top].std(axis=0),
        "lean": angles[top].mean(axis=0) - [math.pi, 0.0], "slow": _slow(time[top], angles[top, 0]),
        "torque": float(shoulder.std()), "saturated": float((np.abs(shoulder) > 0.95 * LIMIT).mean()),
        "changes": changes, "fell": float(np.abs(angles[top, 0] - math.pi).max() > 1.5),
    }  # fmt: skip


def _slow(time: Array, angle: Array) -> float:
    """Return the frequency below 3 Hz with the most power [Hz]; a drift has the lowest."""
    power = np.abs(np.fft.rfft((angle - angle.mean()) * np.hanning(len(angle)))) ** 2
    found = np.fft.rfftfreq(len(angle), (time[-1] - time[0]) / (len(time) - 1))
    return float(found[np.argmax(np.where((found > 0.2) & (found < 3.0), power, 0.0))])


def run_of(effect: Mapping[str, Any], duration: float) -> tuple[Array, Array, Array]:
    """Run the swing-up with an effect, and return times (n,), angles (n, 2) and commanded torques (n, 2)."""
    with tempfile.TemporaryDirectory() as folder:
        robot = write_robot(Path(folder), "free" in effect, effect.get("elbow", 1.0))
        result = load(graph_of(robot, effect, duration)).run()
    result.raise_if_failed()
    angles = np.asarray(result.signal("robot.joints.position"))
    return (
        np.arange(len(angles)) / 400.0,
        angles,
        np.asarray(result.signal("controller.command.torque")),
    )


def simulated(effect: Mapping[str, Any], duration: float = 20.0) -> dict[str, Any]:
    """Run the swing-up with an effect and return its figures."""
    return figures(*run_of(effect, duration))


def rows(picture: Path | None = None) -> Iterator[str]:
    """Give the lines of the table, and draw the swing with 8 ms of latency beside the log's into ``picture``."""
    yield "| case | from the log, to 4.4 s [rad rms] | to 6 s | top: std of the angles [rad] | their lean [rad] | most below 3 Hz at [Hz] | shoulder's torque, std [N m] | saturated | changes of sign a second |"
    yield "|---|---|---|---|---|---|---|---|---|"
    time, angles, torque = measured()
    cases = {"measured": figures(time, angles, torque)}
    cases |= {name: simulated(effect) for name, effect in EFFECTS.items()}
    if picture is not None:
        from ...plotting import Curve, Panel, save_panels

        own_time, own, _ = run_of(EFFECTS["latency 8 ms"], 20.0)
        panels = [
            Panel(f"joint {j + 1} [rad]", [Curve("measured", time, angles[:, j]), Curve("simulated", own_time, own[:, j])],
                  x_range=(0.0, 12.0))
            for j in (0, 1)
        ]  # fmt: skip
        save_panels(
            panels, "A pendubot's swing-up and the simulator's, with 8 ms of latency", picture
        )
    for name, found in cases.items():
        rise, apart = (
            "" if name == "measured" else ", ".join(f"{each:.3f}" for each in found[part])
            for part in ("rise", "apart")
        )
        if found["fell"]:
            yield f"| {name} | {rise} | falls | | | | | | |"
            continue
        sway = ", ".join(f"{each:.3f}" for each in found["sway"])
        lean = ", ".join(f"{each:.2f}" for each in found["lean"])
        yield f"| {name} | {rise} | {apart} | {sway} | {lean} | {found['slow']:.1f} | {found['torque']:.2f} | {found['saturated']:.2f} | {found['changes']:.1f} |"


def main() -> None:
    """Print the table."""
    print("\n".join(rows()))


if __name__ == "__main__":
    main()
