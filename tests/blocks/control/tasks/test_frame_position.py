"""A frame's position as a task: its rows, its input, and what the load report says of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.control.frames import Frame
from aloft.blocks.control.tasks import TaskError, TaskJacobian
from aloft.blocks.control.tasks.frame_position import FramePosition
from aloft.blocks.control.tasks.posture import Posture
from aloft.blocks.control.whole_body_controller import WholeBodyController
from aloft.blocks.signals import PointTarget
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

RANDOM = np.random.default_rng(7)
KNEE = {"task": "FramePosition", "name": "knee", "gains": {"frame": "right_knee"}}


def test_it_is_the_error_of_the_origin_with_the_first_rows_of_the_jacobian():
    frame = Frame(
        RANDOM.normal(size=3), np.eye(3), RANDOM.normal(size=6), RANDOM.normal(size=(6, 9)),
        RANDOM.normal(size=6),
    )  # fmt: skip
    goal, rate, acceleration = RANDOM.normal(size=(3, 3))
    target = SimpleNamespace(position=goal, velocity=rate, acceleration=acceleration)
    e, j = TaskError(*np.zeros((3, 3))), TaskJacobian(np.zeros((3, 9)), np.zeros(3))
    FramePosition.error(frame, target, e)
    FramePosition.jacobian(frame, j)
    assert (e.value == goal - frame.position).all()
    assert (e.rate == rate - frame.velocity[:3]).all() and (e.feedforward == acceleration).all()
    assert (j.matrix == frame.jacobian[:3]).all() and (j.drift == frame.drift[:3]).all()


def test_its_target_is_an_input_of_the_controller_called_after_the_entry():
    link = {**KNEE, "gains": {"frame": "right_shank"}}
    kind = WholeBodyController.specialize(
        WholeBodyController.Params.model_validate({"tasks": ["ContactPoints", link]}), "."
    )
    assert kind.__name__ == "WholeBodyController"
    assert set(kind.inputs) - set(WholeBodyController.inputs) == {"knee_target"}
    assert kind.inputs["knee_target"].signal is PointTarget
    again = WholeBodyController.Params.model_validate({"tasks": ["Posture", link]})
    assert WholeBodyController.specialize(again, ".") is kind
    assert WholeBodyController.specialize(WholeBodyController.Params(), ".") is WholeBodyController


def test_only_its_target_is_an_input_of_its_own():
    assert list(FramePosition.own_inputs()) == ["target"]
    assert not Posture.own_inputs()


def test_an_unknown_frame_and_two_inputs_of_one_name_are_reported():
    with pytest.raises(BlockError, match=r"bruce has no frame 'tail'; it has .*left_toe"):
        BlockBench(
            WholeBodyController, {"tasks": [{**KNEE, "gains": {"frame": "tail"}}]}, robot="bruce"
        )
    with pytest.raises(BlockError, match=r"cannot be called 'knee_target'; give the task a name"):
        BlockBench(WholeBodyController, {"tasks": [KNEE, KNEE]}, robot="bruce")
