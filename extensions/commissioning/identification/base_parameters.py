"""The base parameters of a robot: the combinations of masses, moments and inertias that its equations of motion hold.

The equations of motion are linear in the ten parameters of each link, its mass, first moments and inertia about the joint's
frame, and in the rotors' inertias:

    tau = Y(q, v, a) p + diag(a_j) R

Many of them act only together, such as the inertia of a first link and the mass that the second hangs at its end. Links
from the last to the first, and of each its moments and inertias before its mass, keep the columns of Y that do not depend on
those before; what depends on them is added to them. The masses of a floating base begin with its own. So a base parameter is
a link's own parameter and what further links add.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....mathematics.arrays import Array
from ....robots.pinocchio_model import build_pinocchio_model
from ....robots.robot_description import RobotDescription

NAMES = ("mass", "m x", "m y", "m z", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
"""The parameters of a link in Pinocchio's order; the inertia is about the joint's frame."""
UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)
WHOLE_MASS = "whole mass"
"""The one base parameter of a floating base that is a mass."""
ORDER = (1, 2, 3, 4, 5, 6, 7, 8, 9, 0)
SAMPLES = 60
"""Random states from which the dependent columns are found."""
DEPENDENT = 1e-7
"""The part of a column that is not explained by those before, at and below which it depends on them."""


@dataclass(frozen=True)
class Motion:
    """States of a robot: ``position``, ``velocity``, ``acceleration`` of the joints (n, n_joints); of a floating base
    ``rate`` [rad/s], ``turning`` [rad/s^2] and ``force``, the specific force [m/s^2], in its axes (n, 3)."""

    position: Array
    velocity: Array
    acceleration: Array
    rate: Array | None = None
    turning: Array | None = None
    force: Array | None = None


class LinkRegressor:
    """Maker of the equations of motion in the base parameters.

    Attributes:
        names, units: of the base parameters, ``Link2 m y + 0.2 Link3 mass``.
        links: the links whose parameters these are, the base's first if it floats.
        lumped: base parameters = this (n_base, 10 n_links) times the links' parameters.
        described: the links' parameters of the description (10 n_links).
        told_rotors: joints whose rotor acts apart from the links.
    """

    def __init__(self, robot: RobotDescription) -> None:
        import pinocchio as pin

        self._pin = pin
        built = build_pinocchio_model(robot)
        self.robot, self.model = robot, pin.Model(built.model)
        self.floating = robot.base_joint == "floating"
        self.first = 6 if self.floating else 0
        self.soles = built.sole_frames
        if self.floating:
            self.model.gravity.linear = np.zeros(3)  # the specific force stands for it
        self.data = self.model.createData()
        self.links = [*([robot.base] if self.floating else []), *(j.child for j in robot.joints)]
        self.described = np.concatenate(
            [self.model.inertias[k].toDynamicParameters() for k in range(1, self.model.njoints)]
        )
        self._find_base()

    def _find_base(self) -> None:
        rng, n = np.random.default_rng(0), len(self.robot.joints)
        low = [-3.0 if j.kind == "hinge" else -0.5 for j in self.robot.joints]
        motion = Motion(
            rng.uniform(low, np.negative(low), (SAMPLES, n)), rng.uniform(-3, 3, (SAMPLES, n)),
            rng.uniform(-9, 9, (SAMPLES, n)),
            *(rng.uniform(-9, 9, (SAMPLES, 3)) if self.floating else None for _ in range(3)),
        )  # fmt: skip
        whole = self._links_rows(motion)
        count = whole.shape[2] // 10
        order = [10 * k + p for k in range(count - 1, -1, -1) for p in ORDER if p]
        masses = [10 * k for k in range(count - 1, -1, -1)]
        # a floating base's own mass first: that of every other link acts at its joint
        order += masses[::-1] if self.floating else masses
        columns = whole.reshape(-1, whole.shape[2])[:, order]
        rotors = np.zeros((SAMPLES, whole.shape[1], n))
        for j in range(n):
            rotors[:, self.first + j, j] = motion.acceleration[:, j]
        columns = np.hstack([columns, rotors.reshape(-1, n)])
        sizes = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
        left = np.abs(np.diag(np.linalg.qr(columns / sizes, mode="r")))
        acts = np.linalg.norm(columns, axis=0) > 1e-9
        kept = acts & (left > DEPENDENT)
        links = len(order)
        self.told_rotors = [j for j in range(n) if kept[links + j]]
        own = [k for k in range(links) if kept[k]]
        rest = [k for k in range(links) if acts[k] and not kept[k]]
        shares = np.linalg.lstsq(columns[:, own], columns[:, rest], rcond=None)[0]
        shares[np.abs(shares) < 1e-7] = 0.0
        self.lumped = np.zeros((len(own), whole.shape[2]))
        self._own = [order[k] for k in own]
        self.lumped[range(len(own)), self._own] = 1.0
        self.lumped[:, [order[k] for k in rest]] = shares
        self.names = [self._name(row) for row in range(len(own))]
        self.units = [UNITS[k % 10] for k in self._own]

    def _name(self, row: int) -> str:
        own = self._own[row]
        if self.floating and own % 10 == 0:
            return WHOLE_MASS  # that of every link, and the only mass that acts on its own
        further = [k for k in np.flatnonzero(self.lumped[row]).tolist() if k != own]
        text = f"{self.links[own // 10]} {NAMES[own % 10]}"
        for k in further[:3]:
            share = self.lumped[row, k]
            size = "" if abs(abs(share) - 1.0) < 1e-9 else f"{abs(share):.4g} "
            text += f" {'-' if share < 0 else '+'} {size}{self.links[k // 10]} {NAMES[k % 10]}"
        return text + (" + ..." if len(further) > 3 else "")

    @property
    def whole_mass(self) -> int:
        """The index of the base parameter of a floating base that is the whole mass."""
        return self.names.index(WHOLE_MASS)

    @property
    def described_base(self) -> Array:
        """The base parameters of the description (n_base)."""
        return np.asarray(self.lumped @ self.described)

    def rows(self, motion: Motion) -> Array:
        """Return Y in the base parameters, (n, n_velocities, n_base)."""
        return self._links_rows(motion, self._own)

    def jacobians(self, position: Array) -> list[Array]:
        """Return the Jacobian of each foot at its sole's centre, in its link's axes, (6, n_velocities), for joint angles."""
        pin, model, data = self._pin, self.model, self.data
        q = np.zeros(model.nq)
        q[6], q[7:] = 1.0, position
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        return [pin.getFrameJacobian(model, data, f, pin.ReferenceFrame.LOCAL) for f in self.soles]

    def lifting(self, position: Array) -> Array:
        """Return what a unit of each axis of the base's specific force adds to the description's equations, (n, n_velocities, 3)."""
        pin, model, data, found = self._pin, self.model, self.data, []
        q = np.zeros(model.nq)
        q[6] = 1.0
        for angles in position:
            q[7:] = angles
            found.append(pin.crba(model, data, q)[:3].T.copy())
        return np.array(found)

    def _states(self, motion: Motion, k: int) -> tuple[Array, Array, Array]:
        joints = motion.position.shape[1]
        if not self.floating:
            return motion.position[k], motion.velocity[k], motion.acceleration[k]
        assert motion.rate is not None and motion.turning is not None and motion.force is not None
        q, v, a = np.zeros(7 + joints), np.zeros(6 + joints), np.zeros(6 + joints)
        q[6], q[7:] = 1.0, motion.position[k]
        v[3:6], v[6:] = motion.rate[k], motion.velocity[k]
        a[:3], a[3:6], a[6:] = motion.force[k], motion.turning[k], motion.acceleration[k]
        return q, v, a

    def _links_rows(self, motion: Motion, columns: list[int] | None = None) -> Array:
        pin, model, data = self._pin, self.model, self.data
        count = len(motion.position)
        width = 10 * (model.njoints - 1) if columns is None else len(columns)
        rows = np.zeros((count, model.nv, width))
        for k in range(count):
            made = pin.computeJointTorqueRegressor(model, data, *self._states(motion, k))
            rows[k] = made if columns is None else made[:, columns]
        return rows
