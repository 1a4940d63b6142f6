"""The independent simulator `ring_reference.py` with relative wind and thrust at the tips."""

import numpy as np

from support.ring_reference import Sail
from support.ring_sail import reference


class PushedSail(Sail):
    """A sail whose thrust is that of the wind relative to the points of the tethers, and with forces on the
    tips. The spin axis is found as the normal of the circle of the roots.

    relative: whether the wind is relative. tip_force: [N], one per tether. direction: of the tip forces."""

    relative, tip_force, direction = False, 0.0, "tangential"

    @classmethod
    def of(cls, scene):
        """The simulator of a scene with [tip_thrust] that always acts, or relative wind, or both."""
        made = cls.__new__(cls)
        vars(made).update(vars(reference(scene)))
        made.relative = scene.solar_wind.relative
        if scene.tip_thrust is not None:
            force = np.asarray(scene.tip_thrust.force, float)
            made.tip_force = np.broadcast_to(force, made.p)
            made.direction = scene.tip_thrust.direction
        return made

    def members(self, group, q, v, *time):
        """Forces and energies as those of the sail in a wind that does not feel its motion, plus what the
        velocity of the tethers and the forces at the tips add."""
        found = super().members(group, q, v, *time)
        if self.relative:
            at, rate = q[group.index], v[group.index]
            slope = np.einsum("egk,ekx->egx", group.d, at)
            moving = np.einsum("egk,ekx->egx", group.s, rate)
            along = (slope * moving).sum(-1) / (slope**2).sum(-1)
            drag = -group.push[:, None, None] * (moving - along[..., None] * slope)
            nodal = np.einsum("eg,egk,egx->ekx", group.weight, group.s, drag)
            found.nodal = found.nodal + group.gather @ nodal.reshape(-1, 3)
        if group is self.groups[0]:
            found.nodal = found.nodal.copy()
            found.nodal[self.tips] += self.pushed(q)
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
