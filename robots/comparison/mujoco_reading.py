"""Compares an import with MuJoCo's own compile of the file: bodies, joints, actuators, and dynamics at random states."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ..importing.build import SHARE as LIGHT_SHARE
from ..importing.build import split_share
from ..importing.inertials import mujoco_remarks
from ..importing.raw_model import Reference
from ..kinematics import inertia_tensor
from .differences import SAME, STATES, Differences, together

if TYPE_CHECKING:
    from .file_robot import FileRobot

SPLIT, LENT = 2e-5, 0.02
"""Shares by which dynamics may differ of robots with bodies that are several links, and of robots with links that have a
little of another one's mass."""
SLOW = 1e-3
"""Speed [rad/s, m/s] at which damping is found: that which grows with speed counts for nothing there."""
FAR = 1e9
"""A control without a range is set to this."""


def compare_with_mujoco(ours: FileRobot, reference: Reference) -> Differences:
    """Return the comparison. Where MuJoCo compiles the file in no way, it says so and holds nothing else."""
    found = Differences("MuJoCo")
    model = _floating(ours, reference, found)
    if model is None:
        found.why = reference.refused or "its base cannot float there"
        return found
    if reference.refused:
        found.name("MuJoCo refuses a body of the file, whose written numbers count")
    if ours.fixed_at:
        found.name("joints that the file holds or ties are fixed")
    _set_aside(ours, reference, model, found)
    state = _State(ours, model)
    share = _compare_links(ours, state, found)
    _compare_joints(ours, state, found)
    _compare_dynamics(ours, state, found, share)
    return found


def _floating(ours: FileRobot, reference: Reference, found: Differences) -> Any:
    """Return the compiled model, with the base let go where MuJoCo bolts it to the world; ``None`` without a model."""
    model, root = reference.model, ours.built.base
    if model is None or ours.built.base_joint != "floating" or root not in ours.model.bodies:
        return model
    if any(joint.kind == "free" for joint in ours.model.bodies[root].joints):
        return model
    found.name("the base floats, which MuJoCo bolts to the world")
    if ours.model.bodies[root].joints:
        return None
    body = reference.spec.body(root)
    added = body.add_freejoint()
    added.name = f"{root}/free"
    try:
        with mujoco_remarks([]):
            return reference.spec.compile()
    except (ValueError, RuntimeError):
        return None
    finally:
        reference.spec.delete(added)


def _set_aside(ours: FileRobot, reference: Reference, model: Any, found: Differences) -> None:
    """Take out of the reference what no description has and the notes name, and give bodies of which MuJoCo refuses
    the numbers those of the file."""
    import mujoco

    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_CONSTRAINT)
    model.opt.disableflags &= ~int(flags.mjDSBL_GRAVITY)
    model.opt.gravity = [0.0, 0.0, -GRAVITY]
    model.opt.density = model.opt.viscosity = 0.0
    model.actuator_delay[:], model.actuator_history[:, 0] = 0.0, 0
    for name in ("tendon_armature", "tendon_damping", "tendon_stiffness"):
        getattr(model, name)[:] = 0.0
    for name in reference.stand_ins:
        body, k = ours.model.bodies[name], model.body(name).id
        if body.inertial.mass > 0.0 or np.any(body.inertial.inertia):
            values, axes = np.linalg.eigh(body.inertial.inertia)
            axes = axes * np.sign(np.linalg.det(axes))
            model.body_mass[k], model.body_ipos[k] = body.inertial.mass, body.inertial.com
            model.body_inertia[k] = values
            mujoco.mju_mat2Quat(model.body_iquat[k], axes.ravel())
    if reference.stand_ins:
        mujoco.mj_setConst(model, mujoco.MjData(model))


class _State:
    """The reference at a state of the robot, and which of its coordinates are the robot's."""

    def __init__(self, ours: FileRobot, model: Any) -> None:
        import mujoco

        self.ours, self.model, self.data = ours, model, mujoco.MjData(model)
        self.root = model.body(ours.built.base).id if ours.built.base in ours.model.bodies else 0
        self.joints = [model.joint(joint["name"]).id for joint in ours.built.joints]
        kind = ours.built.base_joint
        self.base_joints = (
            [j for j in range(model.njnt) if model.jnt_bodyid[j] == self.root]
            if kind != "fixed"
            else []
        )
        self.velocities = [
            int(model.jnt_dofadr[j]) + k
            for j in (*self.base_joints, *self.joints)
            for k in range(6 if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_FREE) else 1)
        ]

    def place(self, base: Array, angles: Array, speeds: Array) -> None:
        """Put the robot in a state: seven numbers for a base, of which a planar one takes the first three, the joints'
        positions, and the robot's velocities."""
        import mujoco

        model, data = self.model, self.data
        data.qpos[:] = 0.0
        for j in range(model.njnt):
            start = int(model.jnt_qposadr[j])
            kind = mujoco.mjtJoint(int(model.jnt_type[j]))
            if kind == mujoco.mjtJoint.mjJNT_FREE:
                data.qpos[start : start + 7] = (
                    base if j in self.base_joints else [0, 0, 0, 1, 0, 0, 0]
                )
            elif kind == mujoco.mjtJoint.mjJNT_BALL:
                data.qpos[start] = 1.0
            elif j in self.base_joints:
                data.qpos[start] = base[self.base_joints.index(j)]
            else:
                data.qpos[start] = self.ours.fixed_at.get(model.joint(j).name, 0.0)
        for j, angle in zip(self.joints, angles.tolist(), strict=True):
            data.qpos[model.jnt_qposadr[j]] = angle
        data.qvel[:] = 0.0
        data.qvel[self.velocities] = speeds
        data.ctrl[:] = 0.0
        mujoco.mj_forward(model, data)

    def zero(self) -> None:
        """Put all joints of the robot at zero and its base where the file has it."""
        base = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        self.place(base, np.zeros(len(self.joints)), np.zeros(len(self.velocities)))

    def in_base(self, place: Array) -> Array:
        """Return a point of the world [m] in the base's frame."""
        turned: Array = self.data.xmat[self.root].reshape(3, 3).T @ (
            place - self.data.xpos[self.root]
        )
        return turned


def _origins(ours: FileRobot) -> dict[str, Array]:
    """Return the origin of every link [m, base frame] at the zero of all joints."""
    found = {ours.built.base: np.zeros(3)}
    for joint in ours.built.joints:
        found[joint["child"]] = found[joint["parent"]] + np.array(joint["origin"])
    return found


def _compare_links(ours: FileRobot, state: _State, found: Differences) -> float:
    """Compare mass, first moment and inertia of each link. Returns the share by which dynamics may differ."""
    state.zero()
    model, data, built = state.model, state.data, ours.built
    links, origins = {link["name"]: link for link in built.links}, _origins(ours)
    group = {name: name for name in links}

    def join(one: str, other: str) -> None:
        old, new = group[one], group[other]
        group.update({name: new for name, each in group.items() if each == old})

    moved = {joint["child"]: joint for joint in built.joints}
    share, pieces = SAME, set[str]()
    for body in ours.model.bodies.values():
        carried = [j for j in built.joints if j["name"] in {each.name for each in body.joints}]
        for joint in carried[:-1]:
            lent = LENT if split_share(body.inertial) == LIGHT_SHARE else SPLIT
            share = max(share, lent)
            pieces.add(joint["child"])
            join(joint["child"], carried[-1]["child"])
    if pieces:
        found.name(
            "a body with several joints is several links, all but one of a millionth of its mass"
        )
    theirs: dict[str, list[tuple[float, Array, Array]]] = {}
    aside = []
    for k in range(1, model.nbody):
        frame = built.frames.get(model.body(k).name)
        if frame is None:
            aside.append(model.body(k).name)
            continue
        turn = state.data.xmat[state.root].reshape(3, 3).T @ data.ximat[k].reshape(3, 3)
        own = turn @ np.diag(model.body_inertia[k]) @ turn.T
        com = state.in_base(data.xipos[k])
        theirs.setdefault(frame.link, []).append((float(model.body_mass[k]), com, own))
    if aside:
        found.name("bodies beside the robot are left out")
    for name in links:
        mass = sum(each[0] for each in theirs.get(name, []))
        if name not in pieces and mass < 1e-10 < links[name]["mass"]:
            share = LENT
            found.name("a link without mass has a little of what it carries")
            for child, joint in moved.items():
                if joint["parent"] == name:
                    join(name, child)
    whole = together([part for parts in theirs.values() for part in parts])
    size = float(np.abs(whole[2]).max())
    for root in dict.fromkeys(group.values()):
        members = [name for name, each in group.items() if each == root]
        if members == [built.base] and built.base_joint == "fixed":
            continue  # what is bolted to the world may have any mass
        mine = together([
            (links[n]["mass"], np.array(links[n]["com"]) + origins[n], inertia_tensor(links[n]["inertia"])) for n in members
        ])  # fmt: skip
        other = together([part for n in members for part in theirs.get(n, [])])
        called = f"link {root}" if len(members) == 1 else f"links {' and '.join(members)} together"
        if _is_made_up(ours, state, members, found):
            continue
        found.compare(f"mass of {called} [kg]", mine[0], other[0])
        found.compare(f"first moment of mass of {called} [kg m]", mine[1], other[1],
                      max(other[0], float(np.abs(other[1]).max())))  # fmt: skip
        least = float(np.abs(other[2]).max())
        found.compare(f"inertia of {called} [kg m^2]", mine[2], other[2], max(least, 1e-6 * size))
    return share


def _is_made_up(ours: FileRobot, state: _State, members: list[str], found: Differences) -> bool:
    """Check whether a link has an inertia that no file gives, a ball of water's; its reference is given it, too."""
    import mujoco

    made_up = [
        name for name, frame in ours.built.frames.items()
        if frame.link in members and name in ours.built.balls
    ]  # fmt: skip
    for name in made_up:
        found.name("a link without inertia is a ball of water's density")
        k = state.model.body(name).id
        link = next(
            each for each in ours.built.links if each["name"] == ours.built.frames[name].link
        )
        state.model.body_inertia[k] = np.full(3, link["inertia"][0])
        state.model.body_mass[k] = link["mass"]
        frame = ours.built.frames[name]
        state.model.body_ipos[k] = frame.rotation.T @ (np.array(link["com"]) - frame.position)
    if made_up:
        mujoco.mj_setConst(state.model, mujoco.MjData(state.model))
        state.zero()
    return bool(made_up)


def _compare_joints(ours: FileRobot, state: _State, found: Differences) -> None:
    """Compare anchors, axes, limits, damping, friction and the torque of actuators."""
    import mujoco

    state.zero()
    model, data, origins = state.model, state.data, _origins(ours)
    turn = data.xmat[state.root].reshape(3, 3).copy()
    anchors = [state.in_base(data.xanchor[j]) for j in state.joints]
    axes = [turn.T @ data.xaxis[j] for j in state.joints]
    reach = max([1.0, *(float(np.abs(anchor).max()) for anchor in anchors)])
    torques = _torques(state)
    for k, (j, joint) in enumerate(zip(state.joints, ours.built.joints, strict=True)):
        name, raw = joint["name"], ours.built.raw_joints[joint["name"]]
        found.compare(
            f"anchor of joint {name} [m, base]", origins[joint["child"]], anchors[k], reach
        )
        found.compare(f"axis of joint {name}", joint["axis"], axes[k])
        if model.jnt_limited[j] and joint["limits"] is not None:
            found.compare(f"range of joint {name}", joint["limits"], model.jnt_range[j])
        elif joint["limits"] is not None:
            found.name(
                "a joint of a URDF with one limit has zero as the other, where MuJoCo leaves both out"
            )
        elif model.jnt_limited[j]:
            found.name("a joint of a URDF without lower and upper limit turns freely")
        dof = int(model.jnt_dofadr[j])
        forces = []
        for speed in (-SLOW, SLOW):
            data.qvel[:] = 0.0
            data.qvel[dof] = speed
            mujoco.mj_fwdVelocity(model, data)
            forces.append(float(data.qfrc_passive[dof]))
        drag = (forces[0] - forces[1]) / (2.0 * SLOW)
        found.compare(
            f"damping of joint {name}", raw.damping, drag, max(raw.damping, drag, 1e-6), 1e-5
        )
        found.compare(
            f"friction loss of joint {name}", raw.friction, float(model.dof_frictionloss[dof])
        )
        if not ours.model.is_urdf and math.isfinite(raw.effort):
            found.compare(f"torque limit of joint {name}", raw.effort, torques[j])


def _torques(state: _State) -> dict[int, float]:
    """Return the largest torque [N m] that actuators give each joint while it is still at zero, found by asking."""
    import mujoco

    model, data = state.model, state.data
    # The range of a servo's control is where it goes, and says nothing of its torque.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    limited = np.array(model.actuator_ctrllimited, dtype=bool)
    for a in range(model.nactuator):
        first, count = int(model.actuator_ctrladr[a]), int(model.actuator_ctrlnum[a])
        if int(model.actuator_biastype[a]) != int(mujoco.mjtBias.mjBIAS_NONE):
            limited[first : first + count] = False
    given = []
    for sign in (1.0, -1.0):
        limits = model.actuator_ctrlrange[:, 1 if sign > 0 else 0]
        data.ctrl[:] = np.where(limited, limits, sign * FAR)
        data.act[:] = sign * FAR
        for a in range(model.nactuator):
            rows = slice(
                int(model.actuator_actadr[a]),
                int(model.actuator_actadr[a]) + int(model.actuator_actnum[a]),
            )
            if model.actuator_actnum[a]:
                control = data.ctrl[model.actuator_ctrladr[a]]
                bounds = (
                    model.actuator_actrange[a]
                    if model.actuator_actlimited[a]
                    else (-math.inf, math.inf)
                )
                data.act[rows] = min(max(control, bounds[0]), bounds[1])
        mujoco.mj_fwdActuation(model, data)
        given.append(data.actuator_force.copy())
    data.ctrl[:], data.act[:] = 0.0, 0.0
    found = {}
    for j in state.joints:
        best = []
        for sign in (1.0, -1.0):
            total = 0.0
            for a in range(model.nactuator):
                if int(model.actuator_trntype[a]) in (0, 1) and model.actuator_trnid[a][0] == j:
                    row = int(model.actuator_outadr[a])
                    ratio = float(model.actuator_gear[row][0])
                    total += max(sign * ratio * float(force[row]) for force in given)
            best.append(total)
        most = max(abs(each) for each in best)
        if model.jnt_actfrclimited[j]:
            most = min(most, float(np.abs(model.jnt_actfrcrange[j]).max()))
        found[j] = most
    return found


def _compare_dynamics(ours: FileRobot, state: _State, found: Differences, share: float) -> None:
    """Compare mass matrix and bias forces at random states.

    The velocities of this robot are ``A`` times MuJoCo's, so its mass matrix is A' M A, and its bias forces A' (h + M A' v)
    with the rate of A.
    """
    import mujoco
    import pinocchio as pin

    model, data, random = state.model, state.data, np.random.default_rng(0)
    robot, count = ours.dynamics, len(state.joints)
    at = state.velocities
    within = [
        raw.limits or (-math.pi, math.pi) for raw in (ours.built.raw_joints[j["name"]] for j in ours.built.joints)
    ]  # fmt: skip
    low, high = np.array(within).reshape(-1, 2).T
    memory = robot.createData()
    for _ in range(STATES):
        base = random.normal(size=7)
        base[3:] /= np.linalg.norm(base[3:])
        state.place(base, random.uniform(low, high), random.normal(size=len(at)))
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        turn = data.xmat[state.root].reshape(3, 3)
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacBody(model, data, linear, angular, state.root)
        rates = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacDot(model, data, *rates, data.xpos[state.root], state.root)
        v, angles = data.qvel, data.qpos[model.jnt_qposadr[state.joints]]
        robot.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        if ours.built.base_joint == "floating":
            rows = np.concatenate([turn.T @ linear, turn.T @ angular])
            own = rows @ v
            drift = np.concatenate([
                turn.T @ (rates[0] @ v) - np.cross(own[3:], own[:3]), turn.T @ (rates[1] @ v)
            ])  # fmt: skip
            w, x, y, z = data.xquat[state.root]
            q = np.concatenate([data.xpos[state.root], [x, y, z, w], angles])
        elif ours.built.base_joint == "planar":
            rows = np.array([linear[0], linear[2], angular[1]])
            own, drift = rows @ v, np.array([rates[0][0] @ v, rates[0][2] @ v, rates[1][1] @ v])
            pitch = math.atan2(turn[0, 2], turn[2, 2])
            q = np.concatenate(
                [[data.xpos[state.root][0], data.xpos[state.root][2], pitch], angles]
            )
        else:
            rows, own, drift, q = np.zeros((0, model.nv)), np.zeros(0), np.zeros(0), angles
            robot.gravity.linear = turn.T @ np.array([0.0, 0.0, -GRAVITY])
        conversion = np.zeros((robot.nv, len(at)))
        conversion[: len(rows)] = rows[:, at]
        conversion[len(rows) :, len(at) - count :] = np.eye(count)
        velocity = conversion @ v[at]
        mine = pin.crba(robot, memory, q)
        mine = np.triu(mine) + np.triu(mine, 1).T
        bias = pin.nonLinearEffects(robot, memory, q, velocity)
        rate = np.concatenate([drift, np.zeros(count)])
        found.compare(
            "mass matrix at a random state",
            conversion.T @ mine @ conversion,
            mass[np.ix_(at, at)],
            share=share,
        )
        found.compare(
            "bias forces at a random state",
            conversion.T @ (bias + mine @ rate),
            data.qfrc_bias[at],
            share=share,
        )
