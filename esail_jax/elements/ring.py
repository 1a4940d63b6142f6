"""Auxiliary tethers: segments that join the tips of neighbouring tethers into a ring.

Segment i is a chain of elements between the tips of the tethers i and i + 1, the last segment between those
of the last tether and the first. Its ends are the tips, so that their positions are no coordinates of the
segment. Its own coordinates are the other nodal vectors, with slopes in metres (l r_x), in the order of the
nodes: for trusses r_1 ... r_{n-1}, for cables l r_x,0, r_1, l r_x,1, ... l r_x,n. A ring of single trusses
has none.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Maybe, Nodal, PerTether, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AbstractAxialEnergy
from esail_jax.elements.tether import TetherBatch
from esail_jax.numerics.vectors import dot, norm, total_of
from esail_jax.point_fields import PointFields
from esail_jax.terms import Dissipation, Term, find_term, inner_terms_of

Tips = Float[Array, "3 *state tether"]
OwnVectors = Maybe[Float[Array, "3 *state vector tether"]]


class RingForces(NamedTuple):
    """Generalized forces of the ring: on the tips, on its own vectors, and the dissipated power [W]."""

    tips: Tips
    own: OwnVectors
    dissipated: Float[Array, "*state"]


class Ring(eqx.Module):
    """The auxiliary tethers of a sail, with the energies and dissipations that act in them.

    segments: as many as there are tethers, without point masses at their ends
    """

    segments: TetherBatch
    energies: tuple[Term, ...]
    dissipations: tuple[Dissipation, ...]

    @property
    def loads(self) -> tuple[()]:
        """No load acts on auxiliary tethers: they are not charged."""
        return ()

    @property
    def inner_terms(self) -> tuple[Term, ...]:
        """Energies and dissipations, summed as far as possible."""
        return inner_terms_of(self.energies, self.dissipations)

    @property
    def own_vectors(self) -> int:
        """Number of own vectors of a segment."""
        return self.segments.coefs * (self.segments.elements + 1) - 2

    # ---- coordinates ---------------------------------------------------------------------------

    def joined(self, tips: Tips, own: OwnVectors) -> Float[Array, "3 *state every tether"]:
        """All vectors of the segments in the order of the nodes: the ends are the tips."""
        first, last = (x[..., None, :] for x in (tips, jnp.roll(tips, -1, axis=-1)))
        if own is None:
            return jnp.concatenate([first, last], axis=-2)
        split = self.own_vectors + 1 - self.segments.coefs
        return jnp.concatenate([first, own[..., :split, :], last, own[..., split:, :]], axis=-2)

    def nodal(self, x: Coordinates) -> Nodal:
        """Nodal vectors of the segments. The map is linear: velocities give velocities."""
        vectors = self.joined(x.tether[0, ..., -1, :], x.ring)
        return self.to_nodal(vectors)

    def to_nodal(self, vectors: Float[Array, "3 *state every tether"]) -> Nodal:
        """Nodal vectors from all vectors in the order of the nodes, with slopes divided by l."""
        k = self.segments.coefs
        shape = (*vectors.shape[:-2], self.segments.elements + 1, k, vectors.shape[-1])
        nodal = jnp.moveaxis(vectors.reshape(shape), -2, 0)
        return nodal if k == 1 else jnp.stack([nodal[0], nodal[1] / self.segments.element_length])

    def gathered(self, nodal: Nodal) -> tuple[Tips, OwnVectors]:
        """Forces on the tips and on the own vectors from nodal forces: the transpose of `nodal`."""
        k = self.segments.coefs
        if k == 2:
            nodal = jnp.stack([nodal[0], nodal[1] / self.segments.element_length])
        moved = jnp.moveaxis(nodal, 0, -2)
        vectors = moved.reshape(*moved.shape[:-3], -1, moved.shape[-1])
        tips = vectors[..., 0, :] + jnp.roll(vectors[..., -k, :], 1, axis=-1)
        if not self.own_vectors:
            return tips, None
        return tips, self.own_of(vectors)

    def own_of_nodal(self, nodal: Nodal) -> OwnVectors:
        """The own vectors among nodal vectors, with slopes in metres: the inverse of `nodal`."""
        if not self.own_vectors:
            return None
        if self.segments.coefs == 2:
            nodal = jnp.stack([nodal[0], nodal[1] * self.segments.element_length])
        vectors = jnp.moveaxis(nodal, 0, -2)
        return self.own_of(vectors.reshape(*vectors.shape[:-3], -1, vectors.shape[-1]))

    def own_of(self, vectors: Float[Array, "3 *state every tether"]) -> Array:
        """The own vectors among all vectors in the order of the nodes."""
        if self.segments.coefs == 1:
            return vectors[..., 1:-1, :]
        return jnp.concatenate([vectors[..., 1:-2, :], vectors[..., -1:, :]], axis=-2)

    def to_blocks(self, own: OwnVectors) -> Float[Array, "node row tether"] | None:
        """Own vectors as one block per node, with zeros in the rows of the ends."""
        if own is None:
            return None
        vectors = self.joined(jnp.zeros_like(own[:, 0]), own)
        return jnp.moveaxis(vectors, 0, 1).reshape(self.segments.elements + 1, -1, own.shape[-1])

    def from_blocks(self, blocks: Float[Array, "node row tether"] | None) -> OwnVectors:
        """Own vectors from the blocks of all nodes."""
        if blocks is None:
            return None
        return self.own_of(jnp.moveaxis(blocks.reshape(-1, 3, blocks.shape[-1]), 1, 0))

    def uniform(self, vector: Float[Array, "3"]) -> OwnVectors:
        """Own vectors of a uniform field: `vector` as the positions and zero slopes."""
        if not self.own_vectors:
            return None
        segments = self.segments
        nodal = segments.uniform(vector).at[0, :, np.array([0, -1])].set(0.0)
        return self.gathered(nodal)[1]

    # ---- forces ----------------------------------------------------------------------------------

    def forces(self, q: Coordinates, v: Coordinates, inertial: Coordinates) -> RingForces:
        """M vdot - Q of the segments, for one or several states."""
        segments = self.segments
        fields, rates = segments.interpolate_motion(self.nodal(q), self.nodal(v))
        total = self.point_forces(fields, rates)
        dissipated = jnp.zeros(q.tether.shape[2:-2])
        if self.dissipations:
            density = 2.0 * total_of(term.density(fields, rates) for term in self.dissipations)
            dissipated = self.integrate(density)
        tips, own = self.gathered(segments.nodal_forces(total, self.nodal(inertial)))
        return RingForces(tips, own, dissipated)

    def point_forces(self, fields: PointFields, rates: PointFields) -> PointFields:
        """Forces at every quadrature point: the sum of all terms, conjugate to the fields."""
        parts = [term.point_forces(jnp.zeros(()), fields, rates) for term in self.inner_terms]
        return jax.tree.map(lambda *x: sum(x[1:], x[0]), *parts)

    def inertia(self, acceleration: Coordinates) -> tuple[Tips, OwnVectors]:
        """Inertia forces M `acceleration` on the tips and on the own vectors."""
        return self.gathered(self.segments.inertia(self.nodal(acceleration)))

    def elastic_energy(self, q: Coordinates) -> Scalar:
        """Elastic energy U [J] of all segments."""
        fields = self.segments.interpolate(self.nodal(q))
        return self.integrate(find_term(self.energies, AbstractAxialEnergy).density(fields))

    def tension(self, q: Coordinates, v: Coordinates) -> PerTether:
        """Axial force [N] of every segment, its mean over the undeformed length, with the dissipative part.
        It is negative in compression."""
        segments = self.segments
        fields, rates = segments.interpolate_motion(self.nodal(q), self.nodal(v))
        stress = self.point_forces(fields, rates).r_x
        force = jnp.tensordot(segments.weights, dot(stress, fields.r_x) / norm(fields.r_x), 1)
        return segments.of_tethers(force).mean(0)

    def integrate(self, density: Float[Array, "point *state element"]) -> Float[Array, "*state"]:
        """Integral over all segments of a quantity per undeformed length."""
        weights = self.segments.weights.reshape(-1, *(1,) * (density.ndim - 1))
        return ((weights * density).sum(0) * self.segments.lengths).sum(-1)
