"""The independent simulator `ring_reference.py` with thrust at the tips."""

import numpy as np

from support.ring_reference import Sail
from support.ring_sail import reference


class PushedSail(Sail):
    """A sail with forces on the tips. The spin axis is found as the normal of the circle of the roots.

    tip_force: [N], one per tether. direction: of the tip forces."""

    tip_force, direction = 0.0, "tangential"

    @classmethod
    def of(cls, scene):
        """The simulator of a scene, with [tip_thrust] that always acts if it has one."""
        made = cls.__new__(cls)
        vars(made).update(vars(reference(scene)))
        if scene.tip_thrust is not None:
            force = np.asarray(scene.tip_thrust.force, float)
            made.tip_force = np.broadcast_to(force, made.p)
            made.direction = scene.tip_thrust.direction
        return made

    def members(self, group, q, v, time=0.0):
        """Forces, energies and powers as those of the sail, plus those of the forces at the tips."""
        found = super().members(group, q, v, time)
        if group is self.groups[0]:
            push = self.pushed(q)
            found.nodal = found.nodal.copy()
            found.nodal[self.tips] += push
            found.power = found.power + (push * v[self.tips]).sum()
        return found

    def pushed(self, q):
        """The forces on the tips."""
        roots, tips = q[self.roots], q[self.tips]
        circle = roots - roots.mean(0)
        axis = np.cross(circle[0], circle[1])
        axis /= np.linalg.norm(axis)
        chord = tips - roots
        out = chord - np.outer(chord @ axis, axis)
        out /= np.linalg.norm(out, axis=1)[:, None]
        units = {"axial": np.tile(axis, (self.p, 1)), "radial": out, "tangential": np.cross(axis, out)}
        return np.broadcast_to(self.tip_force, self.p)[:, None] * units[self.direction]
