"""The whole-body controller's program in TSID (C++), as another whole-body controller sees it.

TSID's wheels need another version of Pinocchio than aloft, so they are installed into a folder of
their own, which then comes first where Python looks for modules::

    pip install --only-binary :all: --target FOLDER tsid==1.7.1 pin==3.4.0 cmeel-urdfdom==4.0.1 "cmeel-tinyxml2<11"
    aloft bench tick --tsid FOLDER

What is the same: the model, the tasks with their gains and targets, soft contacts, pyramids of friction,
weights of forces and joint accelerations. What differs, because TSID's formulation has no place for it:

* A task has one weight, not one for each axis: in the thrust it is the mean of the three.
* Torques have bounds for each joint, the box around what the motors allow together; the motors' own limits,
  through the transmission and by speed, are left out.
* The inertia that couples two joints that share rotors is left out; its diagonal is there.
* The base's acceleration has no weight, unless ``exact`` adds it as a task of its own.

In the states in which none of these matters (``same_program``) both solve the same program, and their torques
are compared there.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ....blocks.control.dynamics import LEAST_OFFSET, LEAST_SCALE, Dynamics
from ....blocks.control.tasks.contact_points import ContactPoints
from ....blocks.control.tasks.posture import chosen_joints
from ....blocks.control.tasks.task import PHASE_KINDS
from ....blocks.control.whole_body_controller import WholeBodyController
from ....blocks.signals import Phase
from ....mathematics.arrays import Array
from ....mathematics.compiling.compile_calls import compile_calls
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.whole_body_qp import NO_LIMITS, SOLVED, WholeBodySolution
from ....mathematics.whole_body_reduction import reduce_program, reduction_memory
from ....mathematics.whole_body_solution import active_set_program, solve_with_pyramids
from ....robots.pinocchio_model import build_pinocchio_model
from ....runtime.language.errors import AloftError
from .controller import RecordedController

INSTALL = (
    "pip install --only-binary :all: --target FOLDER tsid==1.7.1 pin==3.4.0 cmeel-urdfdom==4.0.1 "
    "'cmeel-tinyxml2<11'"
)
"""Command that installs TSID."""


def import_tsid(folder: Path) -> ModuleType:
    """Import TSID from a folder with its wheels; from then on Pinocchio is the one from there as
    well.

    Raises:
        AloftError: TSID is not there, or another Pinocchio has been imported before.
    """
    import importlib

    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    site = folder.resolve() / "cmeel.prefix" / "lib" / version / "site-packages"
    if not (site / "tsid").is_dir():
        raise AloftError(f"there is no TSID for {version} in {folder}; to get it: {INSTALL}")
    known = sys.modules.get("pinocchio")
    if known is not None and site not in Path(str(known.__file__)).parents:
        raise AloftError("another version of Pinocchio is in use in this process already")
    if str(site) not in sys.path:
        sys.path.insert(0, str(site))
    importlib.import_module("pinocchio")
    return importlib.import_module("tsid.tsid_pywrap")


class TsidProgram:
    """TSID beside a whole-body controller: it has the same inputs and gives torques.

    There is a formulation for each kind of phase and each set of points in stance, made when it is first
    needed, so TSID never has to change one.

    Args:
        tsid: the module.
        block: the controller.
        dynamics: the block whose state the terms are of; that of the controller's own joints may be earlier.
        exact: weigh the base's acceleration too.
        mass, com_offset: as in ``MassEstimate``; by default the description's.
    """

    def __init__(
        self,
        tsid: ModuleType,
        block: WholeBodyController,
        dynamics: Dynamics,
        *,
        exact: bool = False,
        mass: float = 0.0,
        com_offset: Array | None = None,
    ) -> None:
        import pinocchio as pin

        self._tsid, self._pin, self._block, self._exact = tsid, pin, block, exact
        self._state = dynamics
        built = build_pinocchio_model(block.robot)
        model, self.coupling = built.model, built.rotor_coupling
        factor = mass / block.robot.total_mass if mass > 0.0 else 1.0
        for k in range(1, len(model.inertias)):
            one = model.inertias[k]
            lever = one.lever + (0.0 if k > 1 or com_offset is None else com_offset)
            model.inertias[k] = pin.Inertia(factor * one.mass, lever, factor * one.inertia)
        model.addFrame(pin.Frame("base", 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
        kind = tsid.RootJointType.FLOATING_BASE_SYSTEM
        self.robot = tsid.RobotWrapper(model, kind, False)
        self._q, self._v = np.zeros(model.nq), np.zeros(model.nv)
        p, motors = block.params, block.robot.motors
        reach = np.abs(np.linalg.inv(block.robot.torque_to_motor)) @ motors.peak_torque
        self._bounds = p.torque_margin * reach
        self._solver = tsid.SolverHQuadProgFast("qp")
        self._formulations: dict[tuple[str, bytes], _Formulation] = {}
        self.torque, self.acceleration = np.zeros(model.nv - 6), np.zeros(model.nv)

    @property
    def kind(self) -> str:
        """The kind of phase whose gains hold at present."""
        phase = int(self._block.phase.phase)
        return PHASE_KINDS[(phase >= Phase.THRUST) + (phase > Phase.THRUST)]

    def solve(self) -> bool:
        """Write torques and accelerations of the present state; returns whether it was solved."""
        block, base, q, v = self._block, self._state.base, self._q, self._v
        q[:3], q[3:7], q[7:] = base.position, base.orientation, self._state.joints.position
        v[:] = block.terms.velocity
        key = self.kind, block.phase.stance.tobytes()
        if key not in self._formulations:
            self._formulations[key] = self._formulation(key[0])
        known = self._formulations[key]
        for show in known.show:
            show()
        found = self._solver.solve(known.program.computeProblemData(0.0, q, v))
        if found.status != 0:
            return False
        self.torque[:] = known.program.getActuatorForces(found)
        self.acceleration[:] = known.program.getAccelerations(found)
        return True

    def _formulation(self, kind: str) -> _Formulation:
        """Return the formulation for the present points in stance, with the gains of a kind of
        phase."""
        block, robot = self._block, self.robot
        known = _Formulation(self._tsid, robot, self._q, self._v)
        p, stance = block.params, block.phase.stance
        gains = getattr(p, kind)
        most = 8.0 * block._weight if p.force_max is None else p.force_max
        for k, point in enumerate(block.robot.contacts):
            if stance[k]:
                known.contact(
                    point.name, p.friction, p.force_min, most, p.force_weight,
                    gains.stance_weight, gains.stance_damping,
                )  # fmt: skip
            else:
                self._swing(known, k, point.name, gains, kind)
        self._body(known, gains)
        for chosen in block._chosen:
            if chosen.kind.__name__ == "Posture":
                self._posture(known, chosen.params(kind, gains))
        known.joints("regularise", np.ones(self.torque.shape[0]), p.acceleration_weight, 0.0, 0.0)
        if self._exact:
            self._regularise_base(known, p.acceleration_weight)
        known.limit(self._bounds)
        return known

    def _body(self, known: _Formulation, gains: Any) -> None:
        """Set the references of the centre of mass, the torso and the angular momentum."""
        block, target, pin = self._block, self._block.target, self._pin
        task, sample = known.com(gains.linear_weight, gains.linear_stiffness, gains.linear_damping)

        def show_com() -> None:
            sample.value(target.com)
            sample.derivative(target.com_velocity)
            sample.second_derivative(target.com_acceleration)
            task.setReference(sample)

        turn, attitude = known.frame(
            "base", np.array([0.0, 0, 0, 1, 1, 1]), float(np.mean(gains.torso_weight)),
            np.hstack((np.zeros(3), gains.torso_stiffness)),
            np.hstack((np.zeros(3), gains.torso_damping)), local=True,
        )  # fmt: skip
        place, spin, change = np.zeros(12), np.zeros(6), np.zeros(6)

        def show_torso() -> None:
            place[3:] = pin.Quaternion(target.orientation).matrix().T.reshape(-1)
            spin[3:] = block.terms.base_rotation @ target.angular_velocity
            change[3:] = block.terms.base_rotation @ target.angular_acceleration
            attitude.value(place)
            attitude.derivative(spin)
            attitude.second_derivative(gains.torso_feedforward * change)
            turn.setReference(attitude)

        momentum, wanted = known.momentum(gains.angular_weight, gains.angular_damping)

        def show_momentum() -> None:
            wanted.value(target.angular_momentum)
            wanted.derivative(target.angular_momentum_rate)
            momentum.setReference(wanted)

        known.show += [show_com, show_torso]
        if gains.track_angular_momentum:
            known.show.append(show_momentum)

    def _swing(self, known: _Formulation, point: int, name: str, gains: Any, kind: str) -> None:
        """Send a point without load to the ground; in the thrust damp it across its foot."""
        terms, stance = self._block.terms, self._block.phase.stance
        across = kind == "thrust"
        mask = np.array([0.0, 1, 0, 0, 0, 0] if across else [1.0, 1, 1, 0, 0, 0])
        stiffness = np.array([0.0, 0, 0 if across else gains.swing_stiffness, 0, 0, 0])
        task, sample = known.frame(
            name, mask, gains.swing_weight, stiffness, np.full(6, gains.swing_damping), local=across
        )
        place = self._pin.SE3ToXYZQUAT(self._pin.SE3.Identity())
        place = np.hstack((np.zeros(3), np.eye(3).reshape(-1)))

        def show() -> None:
            place[:3] = terms.contact_position[point]
            place[2] = terms.contact_position[stance, 2].mean()
            sample.value(place)
            task.setReference(sample)

        known.show.append(show)
        foot = int(self._block.robot.foot_of_contact()[point])
        for task_of in self._block._tasks["thrust"]:
            ankles = getattr(task_of, "ankles", None)
            if across and ankles is not None and ankles.place[foot] >= 0:
                mask = np.zeros(self.torque.shape[0])
                mask[int(ankles.place[foot]) - 6] = 1.0
                self._follow(
                    known, f"{name} ankle", mask, gains.rolling_weight, gains.rolling_stiffness,
                    gains.rolling_damping,
                )  # fmt: skip

    def _posture(self, known: _Formulation, gains: Any) -> None:
        if not isinstance(gains.posture_weight, float | int) or gains.posture_weight == 0.0:
            return
        mask = np.zeros(self.torque.shape[0])
        mask[chosen_joints(self._block.robot, gains)] = 1.0
        self._follow(
            known, "posture", mask, float(gains.posture_weight), gains.posture_stiffness,
            gains.posture_damping,
        )  # fmt: skip

    def _follow(
        self, known: _Formulation, name: str, mask: Array, weight: float, stiffness: float,
        damping: float,
    ) -> None:  # fmt: skip
        """Make some joints follow the plan."""
        task, sample = known.joints(name, mask, weight, stiffness, damping)
        target = self._block.target

        def show() -> None:
            sample.value(target.joint_position)
            sample.derivative(target.joint_velocity)
            sample.second_derivative(target.joint_acceleration)
            task.setReference(sample)

        known.show.append(show)

    def _regularise_base(self, known: _Formulation, weight: float) -> None:
        """Drive the base's acceleration in its own frame to zero; TSID counts the classical one,
        which has the angular times the linear velocity besides."""
        task, sample = known.frame(
            "base", np.ones(6), weight, np.zeros(6), np.zeros(6), local=True, name="regularise base"
        )
        terms, wanted = self._block.terms, np.zeros(6)
        sample.value(np.hstack((np.zeros(3), np.eye(3).reshape(-1))))

        def show() -> None:
            v = terms.velocity
            wanted[:3] = terms.base_rotation @ np.cross(v[3:6], v[:3])
            sample.second_derivative(wanted)
            task.setReference(sample)

        known.show.append(show)


class _Formulation:
    """A program of TSID, and what tells it the targets of a tick."""

    def __init__(self, tsid: ModuleType, robot: Any, q: Array, v: Array) -> None:
        self._tsid, self._robot = tsid, robot
        self.program = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
        self.program.computeProblemData(0.0, q, v)
        self.show: list[Callable[[], None]] = []
        self._kept: list[Any] = []  # TSID does not keep its tasks alive

    def contact(
        self, name: str, friction: float, least: float, most: float, force_weight: float,
        weight: float, damping: float,
    ) -> None:  # fmt: skip
        """Add a point in stance, whose acceleration is weighted."""
        up = np.array([0.0, 0.0, 1.0])
        point = self._tsid.ContactPoint(name, self._robot, name, up, friction, least, most)
        point.setKp(np.zeros(3))
        point.setKd(np.full(3, damping))
        point.useLocalFrame(False)
        # By itself TSID weighs the force along the normal by a millionth of that along the ground.
        point.setRegularizationTaskWeightVector(np.ones(3))
        self.program.addRigidContact(point, force_weight, weight, True)
        self._kept.append(point)

    def com(self, weight: Any, stiffness: Any, damping: Any) -> tuple[Any, Any]:
        """Add a task of the centre of mass."""
        task = self._tsid.TaskComEquality("com", self._robot)
        task.setKp(np.array(stiffness))
        task.setKd(np.array(damping))
        return self._add(task, float(np.mean(weight)), self._tsid.TrajectorySample(3))

    def momentum(self, weight: Any, damping: Any) -> tuple[Any, Any]:
        """Add a task of the angular momentum, which is damped until it has a reference."""
        task = self._tsid.TaskAMEquality("momentum", self._robot)
        task.setKp(np.array(damping))
        task.setKd(np.zeros(3))
        sample = self._tsid.TrajectorySample(3)
        task.setReference(sample)
        return self._add(task, float(np.mean(weight)), sample)

    def frame(
        self, frame: str, mask: Array, weight: float, stiffness: Array, damping: Array, *,
        local: bool, name: str = "",
    ) -> tuple[Any, Any]:  # fmt: skip
        """Add a task of a frame's position or orientation."""
        task = self._tsid.TaskSE3Equality(name or f"frame {frame}", self._robot, frame)
        task.setKp(stiffness)
        task.setKd(damping)
        task.setMask(mask)
        task.useLocalFrame(local)
        return self._add(task, weight, self._tsid.TrajectorySample(12, 6))

    def joints(
        self, name: str, mask: Array, weight: float, stiffness: float, damping: float
    ) -> tuple[Any, Any]:
        """Add a task of some joints' angles."""
        task = self._tsid.TaskJointPosture(name, self._robot)
        task.setKp(np.full(len(mask), stiffness))
        task.setKd(np.full(len(mask), damping))
        task.setMask(mask)
        sample = self._tsid.TrajectorySample(len(mask))
        task.setReference(sample)
        return self._add(task, weight, sample)

    def limit(self, bounds: Array) -> None:
        """Add bounds of the joints' torques."""
        task = self._tsid.TaskActuationBounds("bounds", self._robot)
        task.setBounds(-bounds, bounds)
        self.program.addActuationTask(task, 1.0, 0, 0.0)
        self._kept.append(task)

    def _add(self, task: Any, weight: float, sample: Any) -> tuple[Any, Any]:
        self.program.addMotionTask(task, weight, 1, 0.0)
        self._kept.append(task)
        return task, sample


class TsidController(WholeBodyController):
    """The whole-body controller with TSID in the place of its tasks and its method, where ``program`` is
    set; until then with its own."""

    program: TsidProgram | None = None

    def use(self, program: TsidProgram) -> None:
        """Solve by TSID from now on."""
        self.program = program
        self.kernel_calls, self.event = (), np.ones(1, np.int64)

    def on_event(self) -> None:
        """See ``WholeBodyController``."""
        if self.program is None:
            super().on_event()
            return
        command = self.command
        if not self.phase.stance.any():
            command.torque.fill(0.0)
            command.acceleration.fill(0.0)
            command.force.fill(0.0)
            command.solved[()] = True
            return
        command.solved[()] = self.program.solve()
        command.torque[...] = self.program.torque
        command.acceleration[...] = self.program.acceleration


EVERY = 40
"""One in so many ticks is compared."""
TORQUE_ERROR = 1e-5
"""Largest accepted difference of the torques [N m]."""


class TsidCheck:
    """Compares torques in the states of a recorded jump in which the two programs are the same one.

    For that TSID's model gets the mass and the centre of mass of the moment, and a weight of the base's
    acceleration; the own method's model loses the inertia of coupled rotors, and its limits on torque. What is
    left of the differences is one weight for each task, so the thrust is left out.

    Attributes:
        errors: the largest difference of a torque in every state that was compared [N m].
    """

    def __init__(self, tsid: ModuleType, own: RecordedController) -> None:
        block, dynamics = own.bound.blocks["wbc"], own.bound.blocks["dynamics"]
        assert isinstance(block, WholeBodyController) and isinstance(dynamics, Dynamics)
        assert any(type(task) is ContactPoints for task in block._tasks["stand"])
        self._tsid, self._block, self._dynamics = tsid, block, dynamics
        n, contacts = len(block.command.acceleration), len(block.command.force)
        self._mass = np.zeros((n, n))
        self._found = WholeBodySolution(
            np.zeros(n - 6), np.zeros(n), np.zeros((contacts, 3)), np.zeros(1, np.int64)
        )
        program = block._program._replace(
            terms=block._model._replace(mass_matrix=self._mass),
            motors=block._motors._replace(kind=NO_LIMITS),
        )
        reduction = reduction_memory(n, contacts)
        self._calls = [
            KernelCall(reduce_program, program, reduction, self._found),
            KernelCall(
                solve_with_pyramids,
                program,
                reduction,
                active_set_program(n, contacts),
                self._found,
            ),
        ]
        compile_calls(self._calls)
        self.errors: list[float] = []

    def compare(self, tick: int) -> None:
        """Compare the present state, if it is one of those.

        Raises:
            AssertionError: the torques differ by more than ``TORQUE_ERROR``.
        """
        block, weighed = self._block, self._dynamics.mass
        if tick % EVERY or not block.phase.stance.any() or block.phase.stepping.any():
            return
        described = block.robot.total_mass
        program = TsidProgram(
            self._tsid, block, self._dynamics, exact=True,
            mass=round(float(weighed.mass) / described / LEAST_SCALE) * LEAST_SCALE * described,
            com_offset=np.rint(weighed.com_offset / LEAST_OFFSET) * LEAST_OFFSET,
        )  # fmt: skip
        if program.kind == "thrust":
            return
        self._mass[...] = block._model.mass_matrix - program.coupling
        for call in self._calls:
            call.run()
        if int(self._found.code[0]) != SOLVED or not program.solve():
            raise AssertionError(f"tick {tick}: TSID or the own method found no solution")
        apart = float(np.abs(program.torque - self._found.torque).max())
        if apart > TORQUE_ERROR:
            raise AssertionError(f"tick {tick}: TSID's torque is {apart:.2g} N m from the own one")
        self.errors.append(apart)
