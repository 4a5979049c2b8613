"""Small blocks for the wrong graphs, so that these depend on no block of ours."""

from collections.abc import Iterable
from typing import Literal

from pydantic import model_validator

from aloft.runtime.language.block import Block, Context, Input, Output, UnmetRequirement
from aloft.runtime.language.parameters import Parameters, live_parameter, parameter
from aloft.runtime.language.per_joint import PerJoint
from aloft.runtime.language.signals import Field, Signal


class Imu(Signal):
    rate = Field(3, unit="rad/s", frame="body")
    force = Field(3, unit="m/s^2", frame="body")


class Joints(Signal):
    position = Field("n_joints", unit="rad")
    velocity = Field("n_joints", unit="rad/s")


class Height(Signal):
    height = Field(unit="m", frame="world")


class HeightInMillimetres(Signal):
    height = Field(unit="mm", frame="world")


class Weight(Signal):
    height = Field(unit="N", frame="world")


class HeightInBody(Signal):
    height = Field(unit="m", frame="body")


class Heights(Signal):
    height = Field(2, unit="m", frame="world")


class Storey(Signal):
    height = Field(dtype="int64", unit="m", frame="world")


class Robot(Block):
    """A Moore block with sensors and simulation truth."""

    command = Input(Joints, text="joint targets")
    imu = Output(Imu, text="the sensor")
    joints = Output(Joints, text="the encoders")
    truth = Output(Height, truth=True, text="the real height")

    def emit(self) -> None: ...

    def update(self) -> None: ...


class Estimator(Block):
    """A height from a sensor."""

    imu = Input(Imu, text="the sensor")
    height = Output(Height, text="the estimate")

    def step(self) -> None: ...


class Controller(Block):
    """Joint targets from a height."""

    class Params(Parameters):
        class Limits(Parameters):
            low: float = 0.0
            high: float = 1.0

        gain: float = parameter(unit="N m/rad", ge=0.0, le=100.0, text="stiffness")
        mode: Literal["stiff", "soft"] = parameter("stiff", text="how it feels")
        shares: list[float] = parameter([0.5, 0.5], min_length=2, max_length=2, text="per leg")
        delay: float = parameter(0.0, unit="s", text="waiting time")
        limits: Limits = parameter(Limits(), text="range")

        @model_validator(mode="after")
        def _check(self) -> "Controller.Params":
            if self.mode == "soft" and self.gain > 50.0:
                raise ValueError("a soft controller has a gain of at most 50")
            return self

    params: Params
    height = Input(Height, text="where it is")
    joints = Input(Joints, text="how it stands")
    push = Input(Weight, default={"height": 0.0}, text="an outer force")
    command = Output(Joints, text="joint targets")

    def step(self) -> None: ...


class Judge(Block):
    """Reads truth, and may."""

    truth = Input(Height, reads_truth=True, text="the real height")

    def step(self) -> None: ...


class Samples(Signal):
    value = Field("n_samples", unit="m")


class Window(Block):
    """Needs a dimension that only a graph can give."""

    samples = Output(Samples, text="the last heights")

    def step(self) -> None: ...


class Source(Block):
    """One of each kind of height."""

    metres = Output(Height)
    millimetres = Output(HeightInMillimetres)
    weight = Output(Weight)
    body = Output(HeightInBody)
    pair = Output(Heights)
    storey = Output(Storey)

    def step(self) -> None: ...


class Relay(Block):
    """The input again."""

    height = Input(Height)
    again = Output(Height)

    def step(self) -> None: ...


class Motionless(Block):
    """Neither machine."""

    height = Input(Height)


class NotABlock:
    """No block at all."""


class Picky(Block):
    """Works with a robot of so many legs."""

    class Params(Parameters):
        legs: int = parameter(2, text="how many legs it wants")

    needs = ("robot",)
    params: Params
    height = Output(Height)

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        robot = context.robot
        assert isinstance(params, cls.Params) and robot is not None
        legs = len(robot.feet)
        if legs != params.legs:
            yield UnmetRequirement(
                f"{robot.name} has {legs} legs",
                parameter="legs",
                expected=f"{legs} legs",
                found=f"{params.legs} legs",
                fix=f"legs: {legs}",
            )

    def step(self) -> None: ...


class Clumsy(Block):
    """Fails when it is asked what it requires."""

    height = Output(Height)

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        raise ZeroDivisionError("division by zero")

    def step(self) -> None: ...


class Walker(Block):
    """Needs all that a robot can have."""

    needs = ("robot", "floating base", "feet", "imu", "switches")
    joints = Output(Joints)

    def step(self) -> None: ...


class Springs(Block):
    """A stiffness for every joint."""

    class Params(Parameters):
        stiffness: PerJoint = parameter(40.0, unit="N m/rad", ge=0.0, text="of every joint")

    needs = ("robot",)
    params: Params
    joints = Output(Joints)

    def step(self) -> None: ...


class LiveSprings(Block):
    """A stiffness for every joint, which may change."""

    class Params(Parameters):
        stiffness: PerJoint = live_parameter({"*": 40.0}, unit="N m/rad", text="of every joint")

    needs = ("robot",)
    params: Params
    joints = Output(Joints)

    def step(self) -> None: ...


class Hasty(Block):
    """A Moore block that does not wait for its input."""

    height = Input(Height)
    again = Output(Height)

    def emit(self) -> None:
        self.again.height[()] = self.height.height

    def update(self) -> None: ...
