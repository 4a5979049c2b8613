"""A sensor that sees the robot's place from outside, and what takes the drift off an estimate with it."""

from __future__ import annotations

import math

import numpy as np

from ...mathematics.elementary import sincos
from ...mathematics.kernel import kernel
from ...mathematics.rotations import multiply, turn_about_vertical, wrap, yaw
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.context import Clock
from ...runtime.language.errors import BlockError
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.random_stream import RandomStream, StreamState
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, PoseMeasurement, RobotTruth

LINE = 256
"""Measurements that may be under way, and estimates that are remembered."""


class CaptureLine(StreamState):
    """The measurements under way, and the random stream."""

    number = Field(LINE, dtype="int64", text="of each measurement; zero: dropped")
    time = Field(LINE, unit="s", text="time of the measurement")
    position = Field((LINE, 3), unit="m", frame="world", text="base origin")
    heading = Field(LINE, unit="rad", frame="world", text="heading of the base")
    taken = Field(dtype="int64", text="number of measurements taken")


class MotionCapture(Block):
    """Place and heading of the base as a motion capture system measures them; the simulator gives the truth.

    One measurement is taken in every run of the block, so the block's ``rate`` is the system's. It appears ``latency`` later,
    rounded to whole runs, with white noise. A measurement that is dropped never appears: the one before it stays. The noise
    depends on ``seed`` and on the block's path.
    """

    class Params(Parameters):
        latency: float = parameter(
            0.01, unit="s", ge=0.0, le=0.2, text="from the exposure to the measurement"
        )
        dropout: float = parameter(0.0, ge=0.0, le=1.0, text="share of measurements that are lost")
        noise: float = parameter(
            0.0005, unit="m", ge=0.0, text="standard deviation of each coordinate"
        )
        heading_noise: float = parameter(
            math.radians(0.1), unit="rad", ge=0.0, text="standard deviation of the heading"
        )
        seed: int = parameter(0, ge=0, text="of the noise")

    params: Params
    truth = Input(RobotTruth, text="true place of the robot")
    pose = Output(PoseMeasurement, text="the last measurement that has come")
    line = State(CaptureLine, text="measurements under way")
    last = State(PoseMeasurement, text="the last measurement that has come")

    def save_state(self) -> None:
        """Keep where the stream is."""
        self._random.save(self.line)

    def load_state(self) -> None:
        """Take it back."""
        self._random.load(self.line)

    def setup(self) -> None:
        self._random = RandomStream(self, self.params.seed)
        self._late = round(self.params.latency / self.period)
        if self._late >= LINE:
            raise BlockError(
                f"the latency is {self._late} runs of the block, at most {LINE - 1} are possible; "
                "give the block a lower rate"
            )
        self._errors = np.zeros(5)

    def step(self) -> None:
        """Take a measurement, and give the one whose time has come; the numbers are NumPy's."""
        line, last, pose, errors = self.line, self.last, self.pose, self._errors
        here, number = int(line.taken) % LINE, int(line.taken) + 1
        self._random.generator.standard_normal(out=errors)
        lost = 0.5 * (1.0 + math.erf(errors[4] / math.sqrt(2.0))) < self.params.dropout
        line.number[here] = 0 if lost else number
        line.time[here] = self.time
        where = line.position[here]
        np.multiply(errors[:3], self.params.noise, out=where)
        np.add(where, self.truth.base_position, out=where)
        line.heading[here] = (
            yaw(self.truth.base_orientation) + self.params.heading_noise * errors[3]
        )
        line.taken[()] = number
        come = (number - 1 - self._late) % LINE
        if number > self._late and line.number[come] > 0:
            last.number[()], last.time[()] = line.number[come], line.time[come]
            last.position[:], last.heading[()] = line.position[come], line.heading[come]
        pose.number[()], pose.time[()] = last.number, last.time
        pose.position[:], pose.heading[()] = last.position, last.heading


class PoseHistory(Signal):
    """The last estimates, and how the estimator's world lies in that of the measurements."""

    position = Field((LINE, 2), unit="m", text="places of the base by the estimator")
    heading = Field(LINE, unit="rad", text="headings of the base by the estimator")
    last = Field(dtype="int64", text="number of the last measurement that was used")
    taken = Field(dtype="int64", text="tick in which it was taken")
    used = Field(dtype="int64", text="number of measurements used")
    offset = Field(2, unit="m", text="origin of the estimator's world in that of the measurements")
    turn = Field(unit="rad", text="its heading there")


class PoseCorrection(Block):
    """Takes the drift of place and heading off an estimate, with measurements that come late and seldom.

    The estimator's world lies at an offset t, turned by d about the vertical, in the measurements' world: p' = R_z(d) p + t. A measurement is
    compared with the estimate of its own time, and moves d and t by a share of what they differ by: one nth with the nth
    measurement, until that has fallen to ``gain``. So the estimator's fast motion is left as it is, and tilt and height are
    its own. Without measurements t and d stay. One that is older than 256 ticks is left out, as is one that is
    overtaken; a system that counts from the start again is used again.
    """

    class Params(Parameters):
        gain: float = parameter(
            0.05, gt=0.0, le=1.0, text="share of an error that a measurement corrects"
        )

    class Scratch(Signal):
        """Scratch memory of one step."""

        turn = Field(4, text="quaternion of the rotation")

    params: Params
    state = Input(BaseState, text="pose and velocity of the base by the estimator")
    pose = Input(PoseMeasurement, text="the last measurement")
    base = Output(BaseState, text="the same in the world of the measurements")
    history = State(PoseHistory, text="the last estimates, and the drift")

    @kernel
    @staticmethod
    def step(
        state: BaseState,
        pose: PoseMeasurement,
        base: BaseState,
        history: PoseHistory,
        params: Params,
        scratch: Scratch,
        clock: Clock,
    ) -> None:
        here = clock.tick % LINE
        history.position[here, :] = state.position[:2]
        history.heading[here] = yaw(state.orientation)
        taken = round(pose.time / clock.base_period)
        age = clock.tick - taken
        # A lower number that was taken later: the system has begun again. One taken before is late.
        again = pose.number < history.last and taken > history.taken
        if (pose.number > history.last or again) and 0 <= age < LINE:
            history.last, history.taken = pose.number, taken
            history.used += 1
            then = taken % LINE
            share = max(params.gain, 1.0 / history.used)
            error = pose.heading - history.heading[then] - history.turn
            x, y = history.position[then, 0], history.position[then, 1]
            # The estimate of that time keeps its place while the world turns about it.
            sine, cosine = sincos(history.turn)
            px = cosine * x - sine * y + history.offset[0]
            py = sine * x + cosine * y + history.offset[1]
            history.turn += share * wrap(error)
            sine, cosine = sincos(history.turn)
            history.offset[0] = px + share * (pose.position[0] - px) - (cosine * x - sine * y)
            history.offset[1] = py + share * (pose.position[1] - py) - (sine * x + cosine * y)
        turn_about_vertical(state.position, history.turn, base.position)
        base.position[0] += history.offset[0]
        base.position[1] += history.offset[1]
        turn_about_vertical(state.linear_velocity, history.turn, base.linear_velocity)
        base.angular_velocity[:] = state.angular_velocity
        turn = scratch.turn
        turn[0], turn[1] = 0.0, 0.0
        turn[2], turn[3] = sincos(0.5 * history.turn)
        multiply(turn, state.orientation, base.orientation)
