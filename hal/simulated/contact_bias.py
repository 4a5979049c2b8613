"""The bias acceleration of contact points, which MuJoCo's contacts leave out.

A point that stands obeys J q'' + J' q' = 0. MuJoCo asks of a contact J q'' = a - R f, with the reference
a = -b v for friction, and has no J' q'. So a sole stands below moving legs only while it slides, however high the friction is,
at the speed v = J' q' / b [m/s] with b = 2 / (0.99 T), T being the contact's time constant [s]: on soft ground G1's
at 60 to 90 mm/s when a thrust ends, with horizontal forces of a thirtieth of the load. Between the two parts of a physics step
J' q' is taken from the references of all contacts of a sphere with the ground, so that they keep their meaning.

For a sphere with the centre c that touches at p the velocity of the contact is that of its material there, v_c + w x (p - c),
and p - c does not change as it rolls. So its bias is that of the centre plus (J'_w q') x (p - c).

It is a call of Python in every physics step.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...mathematics.arrays import Array, Indices

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

DIMENSION = 3
"""Of a contact with friction and without moments."""
TURNING, MOVING = slice(0, 3), slice(3, 6)
"""Of MuJoCo's spatial vectors, about the centre of mass of a whole robot."""


class ContactBias:
    """Takes the bias acceleration from the references of the ground's contacts with spheres.

    ``begin_step`` takes the place of ``mj_step1``. It has no state.
    """

    def __init__(self, model: MjModel, data: MjData) -> None:
        import mujoco

        self._data, self._begin = data, partial(mujoco.mj_step1, model, data)
        self._body = model.geom_bodyid
        self._root = model.body_rootid[self._body]
        self._ground = self._body == 0
        self._ball = (model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE) & ~self._ground
        self._moved_by = np.zeros((model.ngeom, model.nv))
        for geom in np.flatnonzero(self._ball).tolist():
            body = int(self._body[geom])
            while body:
                first, count = model.body_dofadr[body], model.body_dofnum[body]
                self._moved_by[geom, first : first + count] = 1.0
                body = int(model.body_parentid[body])

    def begin_step(self) -> None:
        """Make the first part of a physics step."""
        self._begin()
        self.correct()

    def correct(self) -> None:
        """Correct the references of the present contacts."""
        data, contacts = self._data, self._data.contact
        geoms, rows = contacts.geom, contacts.efc_address
        if not len(rows):
            return
        into = self._ground[geoms[:, 0]] & self._ball[geoms[:, 1]]  # so the normal leads into it
        out = self._ball[geoms[:, 0]] & self._ground[geoms[:, 1]]
        chosen = np.flatnonzero((into | out) & (rows >= 0) & (contacts.dim == DIMENSION))
        if not len(chosen):
            return
        balls = np.where(into, geoms[:, 1], geoms[:, 0])[chosen]
        bias = self.bias(balls, contacts.pos[chosen])
        frames = contacts.frame[chosen].reshape(-1, 3, 3)
        along = np.add.reduce(frames * bias[:, None, :], axis=-1)
        places = rows[chosen][:, None] + np.arange(DIMENSION)
        data.efc_aref[places] -= np.where(into, 1.0, -1.0)[chosen][:, None] * along

    def bias(self, balls: Indices, places: Array) -> Array:
        """Return the bias accelerations (n, 3) [m/s^2, world] of the contacts of the geoms ``balls`` (n,), which touch
        at ``places`` (n, 3) [m, world]."""
        data = self._data
        rates = data.cdof_dot * data.qvel[:, None]
        spatial = np.add.reduce(self._moved_by[balls][:, :, None] * rates, axis=1)
        velocity = data.cvel[self._body[balls]]
        centres = data.geom_xpos[balls]
        arms = centres - data.subtree_com[self._root[balls]]
        turning, spinning = spatial[:, TURNING], velocity[:, TURNING]
        moving = velocity[:, MOVING] + np.cross(spinning, arms)
        still = np.cross(turning, arms + (places - centres))
        return np.asarray(spatial[:, MOVING] + still + np.cross(spinning, moving))
