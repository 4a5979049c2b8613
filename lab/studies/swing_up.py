"""A pendubot's logged swing-up, and the same controller on the same robot in the simulator.

::

    python -m aloft.lab.studies.swing_up

The log is of design A.0 in closed loop (``shared/data/double_pendulum/swing_up``): TVLQR along a nominal trajectory, LQR at the
top from its end on, friction compensated, speeds filtered, 400 Hz. The robot here has the published links (whose inertias are about
the joint), friction and rotors. Each row is one effect: how far the swing is from the measured one, and what happens at the top.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

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
ROTOR, FRICTION = 0.00276, 0.134
"""Rotors behind their gears [kg m^2]; friction of both joints [N m]."""
COMPENSATED, DAMPING = np.array([0.09284, 0.07708]), np.array([0.01108, 0.0044])
"""Compensated friction: coulomb [N m] times arctan(100 v), and damping [N m s/rad]. The log's column of it is this."""
CAUGHT = 4.407
"""Time at which the LQR takes over [s]: the log's torques are its from then on, to 1e-6."""
CONTROLLER = "aloft.lab.studies.swing_up:Controller"
SHARE, LIMIT, TOP = 0.2, 5.0, 8.0
"""The speeds' filter, the torque's limit [N m], and the time from which on the top is looked at [s]."""
EFFECTS: dict[str, dict[str, Any]] = {
    "no friction, no rotors": {"free": True},
    "friction and rotors": {},
    "latency 3 ms": {"latency": "3 ms"},
    "latency 4 ms": {"latency": "4 ms"},
    "latency 4 ms, static friction x 3": {"latency": "4 ms", "joints": {"static_friction": 3.0}},
    "latency 4 ms, encoders of 2 mrad": {"latency": "4 ms", "sensors": {"encoder_resolution": 0.002}},
    "latency 5 ms": {"latency": "5 ms"},
    "latency 8 ms": {"latency": "8 ms"},
    "latency 8 ms, speed noise": {"latency": "8 ms", "noise": 0.05},
    "latency 8 ms, static friction x 2": {"latency": "8 ms", "joints": {"static_friction": 2.0}},
    "latency 8 ms, encoders of 10 mrad": {"latency": "8 ms", "sensors": {"encoder_resolution": 0.01}},
    "latency 8 ms, friction of the elbow x 1.35": {"latency": "8 ms", "elbow": 0.18},
    "latency 2 ms, gears of 1000 N m/rad": {"latency": "2 ms", "gears": {"stiffness": 1000.0, "damping": 0.5}},
    "the same, play of 10 mrad": {
        "latency": "2 ms", "gears": {"stiffness": 1000.0, "damping": 0.5, "backlash": 0.01}
    },
}  # fmt: skip


def moments() -> tuple[float, float]:
    """Return the links' inertias about their centres of mass [kg m^2], at least those of a thin rod's tenth."""
    found = [i - m * c**2 for i, m, c in zip(ABOUT_JOINT, MASSES, COMS, strict=True)]
    return max(found[0], 1e-4), max(found[1], 1e-4)


def write_robot(folder: Path, free: bool = False, elbow: float = FRICTION) -> Path:
    """Write the pendubot's description, ``free`` of friction and rotors, or with another friction of its ``elbow`` [N m]."""
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
            else f"  real: {{friction: {FRICTION}, damping: 0.001, rotor_inertia: {ROTOR}, motors: {{elbow: {{friction: {elbow}}}}}}}\n"
        )
        + "sensors: {imu: false, switches: false}\n"
    )
    return file


def accelerations(state: Array, torque: float) -> Array:
    """Return the pendubot's accelerations (2,) by the published parameters, without friction, as its controller knows it."""
    q1, q2, v1, v2 = state
    m1, m2 = MASSES
    h, g = m2 * LENGTH * COMS[1], 9.81
    c, s = math.cos(q2), math.sin(q2)
    one, two = ABOUT_JOINT[0] + m2 * LENGTH**2, ABOUT_JOINT[1]
    mass = np.array([[one + two + 2 * h * c, two + h * c], [two + h * c, two]])
    bias = np.array([-h * s * (2 * v1 * v2 + v2**2), h * s * v1**2])
    second = g * m2 * COMS[1] * math.sin(q1 + q2)
    gravity = np.array([g * (m1 * COMS[0] + m2 * LENGTH) * math.sin(q1) + second, second])
    return np.linalg.solve(mass, np.array([torque, 0.0]) - bias - gravity)


def time_varying_gains(nominal: Any) -> tuple[Array, Array]:
    """Return times and gains (n, 4) of the LQR along the nominal trajectory, by the logged weights."""
    weights, last, effort = (
        np.loadtxt(FOLDER / f"tvlqr_controller_{name}matrix.txt") for name in ("Q", "Qf", "R")
    )
    step = float(nominal["time"][1] - nominal["time"][0])
    value, gains, times = last, [], []
    for k in range(len(nominal) - 1, -1, -1):
        state = np.array([nominal[f"{kind}{j}"][k] for kind in ("pos", "vel") for j in (1, 2)])
        torque = float(nominal["tau1"][k])
        a, b = np.zeros((4, 4)), np.zeros((4, 1))
        a[:2, 2:] = np.eye(2)
        for j in range(4):
            moved = 1e-5 * np.eye(4)[j]
            a[2:, j] = (
                accelerations(state + moved, torque) - accelerations(state - moved, torque)
            ) / 2e-5
        b[2:, 0] = (
            accelerations(state, torque + 1e-4) - accelerations(state, torque - 1e-4)
        ) / 2e-4
        onward, pushed = np.eye(4) + step * a + 0.5 * step**2 * a @ a, step * b
        gain = (pushed.T @ value @ onward) / (effort[0, 0] * step + pushed.T @ value @ pushed)
        value = weights * step + onward.T @ value @ (onward - pushed @ gain)
        gains.append(gain[0])
        times.append(float(nominal["time"][k]))
    return np.array(times[::-1]), np.array(gains[::-1])


class Filtered(Signal):
    """Memory of the controller."""

    speed = Field("n_joints", unit="rad/s", text="speed behind the filter")


class Controller(Block):
    """The logged controller: TVLQR up to the end of the nominal trajectory, up to the instant at which the log has LQR; friction compensated."""

    class Params(Parameters):
        """Its one parameter."""

        noise: float = parameter(0.0, unit="rad/s", text="standard deviation of the speeds' noise")

    params: Params
    needs = ("robot",)
    joints = Input(JointState, text="measured")
    command = Output(JointCommand, text="torques")
    filtered = State(Filtered, text="speeds")

    def setup(self) -> None:
        """Read nominal trajectory and gains."""
        self.nominal = np.genfromtxt(FOLDER / "init_trajectory.csv", delimiter=",", names=True)
        self.times, self.gains = time_varying_gains(self.nominal)
        self.top = np.loadtxt(FOLDER / "lqr_controller_Kmatrix.txt")[0]
        self.rng = np.random.default_rng(0)

    def step(self) -> None:
        """One tick."""
        time, nominal = self.time, self.nominal
        measured = self.joints.velocity + self.params.noise * self.rng.standard_normal(2)
        self.filtered.speed[:] += SHARE * (measured - self.filtered.speed)
        state = np.concatenate([self.joints.position, self.filtered.speed])
        if time < CAUGHT:
            wanted = np.array([np.interp(time, nominal["time"], nominal[f"{kind}{j}"])
                               for kind in ("pos", "vel") for j in (1, 2)])  # fmt: skip
            gain = self.gains[min(int(np.searchsorted(self.times, time)), len(self.times) - 1)]
            torque = np.interp(time, nominal["time"], nominal["tau1"]) + gain @ (wanted - state)
        else:
            torque = -self.top @ (state - np.array([math.pi, 0.0, 0.0, 0.0]))
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
                "use": CONTROLLER, "with": {"noise": effect.get("noise", 0.0)},
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


def figures(time: Array, angles: Array, torque: Array) -> dict[str, Any]:
    """Return what a run is like: how far its swing is from the log's, and its sway and torque at the top."""
    at, logged, _ = measured()
    end = time < 5.998
    apart = [angles[end, j] - np.interp(time[end], at, logged[:, j]) for j in (0, 1)]
    top = time > TOP
    shoulder = torque[top, 0]
    changes = float((np.diff(np.sign(shoulder)) != 0).sum()) / (float(time[-1]) - TOP)
    return {
        "apart": np.sqrt((np.array(apart) ** 2).mean(axis=1)), "sway": angles[top].std(axis=0),
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
        robot = write_robot(Path(folder), "free" in effect, effect.get("elbow", FRICTION))
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
    yield "| case | swing: from the log [rad rms] | top: std of the angles [rad] | their lean [rad] | most below 3 Hz at [Hz] | shoulder's torque, std [N m] | saturated | changes of sign a second |"
    yield "|---|---|---|---|---|---|---|---|"
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
        apart = "" if name == "measured" else ", ".join(f"{each:.3f}" for each in found["apart"])
        if found["fell"]:
            yield f"| {name} | {apart} | falls | | | | | |"
            continue
        sway = ", ".join(f"{each:.3f}" for each in found["sway"])
        lean = ", ".join(f"{each:.2f}" for each in found["lean"])
        yield f"| {name} | {apart} | {sway} | {lean} | {found['slow']:.1f} | {found['torque']:.2f} | {found['saturated']:.2f} | {found['changes']:.1f} |"


def main() -> None:
    """Print the table."""
    print("\n".join(rows()))


if __name__ == "__main__":
    main()
