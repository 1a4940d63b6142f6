"""All tethers of a sail as one batch of chains of elements: interpolation, mass, assembly.

Nodal vectors are stored as (coef, xyz, node, tether): coef 0 is the position, coef 1 the slope r_x of a
cable. An axis of several states of motion may stand between xyz and node. Arrays of elements have one axis
for all elements of all tethers in place of the last two. Every operation is one small matrix product over
all elements and states. Products with the shape functions are written as sums over the coefficients or
points of an element. Such short sums are faster than a matrix library, which needs the vectors in another
order, and they accept one state or a batch of sails in lockstep without change.
"""

from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Nodal, PerElement, PerMember, PerTether
from esail_jax.elements import ancf_cable, truss
from esail_jax.numerics.lockstep import per_member_table
from esail_jax.numerics.quadrature import gauss_legendre
from esail_jax.numerics.vectors import stacked
from esail_jax.point_fields import PointFields

Element = Literal["cable", "truss", "rod"]
KINDS = {"cable": ancf_cable, "truss": truss, "rod": truss}
"""Module of the shape functions of every kind of element. A rod is a truss element whose length, mass and
stiffness are its own ([MW])."""

POINTS = {"cable": 5, "truss": 2, "rod": 2}
"""Gauss points per element. Five integrate the Green-Lagrange energy of a cubic element exactly (degree 8).
Two integrate any energy and the mass of a linear element exactly."""

SAME_AXES = np.eye(3)
"""Inertia of a unit point mass: the force is along the acceleration."""


class TetherBatch(eqx.Module):
    """Tethers as chains of elements, which are equal within a tether; those of kind "rod" may differ.

    element_length: l [m] and line_density: rho A [kg/m], one number per tether, or per element for rods.
    tip_mass: m_u [kg] per tether, the remote unit as a point mass at the last node. base_mass: [kg] of a
    point mass at the first node of a chain that nothing holds; None without such a mass. elements: number
    of elements of a tether. fields_used: the fields of `PointFields` that are interpolated.

    lengths [m] and masses [kg] of all elements are computed once. If they were computed where they are
    used, their repetition would be part of every loop over the points.
    """

    element_length: PerMember
    line_density: PerMember
    tip_mass: PerTether
    elements: int = eqx.field(static=True)
    kind: Element = eqx.field(static=True)
    fields_used: tuple[str, ...] = eqx.field(static=True)
    base_mass: PerTether | None
    lengths: PerElement
    masses: PerElement

    def __init__(
        self,
        element_length: PerMember,
        line_density: PerMember,
        tip_mass: PerTether,
        elements: int,
        kind: Element,
        fields_used: tuple[str, ...],
        base_mass: PerTether | None = None,
    ):
        self.element_length, self.line_density = element_length, line_density
        self.tip_mass, self.base_mass = tip_mass, base_mass
        self.elements, self.kind, self.fields_used = elements, kind, fields_used
        self.lengths = per_element(element_length, elements)
        self.masses = per_element(line_density * element_length, elements)

    @property
    def count(self) -> int:
        """Number of tethers."""
        return self.tip_mass.shape[0]

    @property
    def coefs(self) -> int:
        """Number of nodal vectors per node."""
        return KINDS[self.kind].COEFS_PER_NODE

    @property
    def weights(self) -> np.ndarray:
        """Gauss weights on the unit interval."""
        return gauss_legendre(POINTS[self.kind])[1]

    def table(self, derivative: int) -> np.ndarray:
        """Shape functions (point, coef of element) at the Gauss points."""
        return self.shape_table(gauss_legendre(POINTS[self.kind])[0], derivative)

    def shape_table(self, xi: np.ndarray, derivative: int) -> np.ndarray:
        """Shape functions, or a derivative of them with respect to xi, at given points of an element."""
        return KINDS[self.kind].shape_functions(xi, derivative)

    @property
    def derivatives(self) -> list[int]:
        """Orders of differentiation of the fields in use: 0 for r, 1 for r_x, 2 for r_xx."""
        return [PointFields._fields.index(name) for name in self.fields_used]

    @property
    def mass_table(self) -> np.ndarray:
        """Integrals of s_a s_b over the unit interval, (coef, coef); exact ([PGV] Eq. 22)."""
        shapes = self.table(0)
        return np.einsum("q,qa,qb->ab", self.weights, shapes, shapes)

    def scale_slopes(self, nodal: Float[Array, "coef 3 *batch tether"]) -> Array:
        """Nodal vectors with slopes in metres, l r_x. The map is its own transpose."""
        if self.coefs == 1:
            return nodal
        slope = nodal[1] * self.element_length
        return jnp.stack([nodal[0], slope])

    def element_vectors(self, nodal: Nodal) -> Float[Array, "coef2 3 *state element"]:
        """Vectors (r_i, l r_x,i, r_j, l r_x,j) of every element from nodal vectors."""
        p = nodal.shape[-1]
        flat = nodal.reshape(*nodal.shape[:-2], -1)
        ends = [flat[k, ..., here] for here in (slice(-p), slice(p, None)) for k in range(self.coefs)]
        return jnp.stack(self.with_slopes_scaled(ends))

    def assemble(self, elementwise: Float[Array, "coef2 3 *state element"]) -> Nodal:
        """Nodal forces from element forces: the transpose of `element_vectors` ([PGV] Eq. 9)."""
        k, p = self.coefs, self.count
        scaled = self.with_slopes_scaled(list(elementwise))
        before, after = ([(0, 0)] * (elementwise.ndim - 2) + [pad] for pad in ((0, p), (p, 0)))
        flat = jnp.stack([jnp.pad(scaled[c], before) + jnp.pad(scaled[c + k], after) for c in range(k)])
        return flat.reshape(*flat.shape[:-1], self.elements + 1, p)

    def with_slopes_scaled(self, vectors: list[Array]) -> list[Array]:
        """Vectors of every element, (xyz, *state, element) each, with slopes multiplied by l.

        The factor turns slopes into metres. It also turns forces conjugate to slopes in metres into those
        conjugate to slopes.
        """
        return [x * self.lengths if c % self.coefs else x for c, x in enumerate(vectors)]

    def repeat_per_element(self, x: Float[Array, "*state tether"]) -> Float[Array, "*state element"]:
        """One number per element from one per tether."""
        return jnp.tile(x, self.elements)

    def of_tethers(self, x: Float[Array, "*batch element"]) -> Float[Array, "*batch elem tether"]:
        """Splits the axis of all elements into (elem, tether)."""
        return x.reshape(*x.shape[:-1], self.elements, self.count)

    def interpolate(self, nodal: Nodal) -> PointFields:
        """The fields in use at every Gauss point, (xyz, point, *state, element) each."""
        vectors = self.element_vectors(nodal)
        fields = {}
        for name, d in zip(self.fields_used, self.derivatives, strict=True):
            value = at_points(self.table(d), vectors)
            fields[name] = value * self.lengths ** -float(d) if d else value
        return PointFields(fields.get("r"), fields["r_x"], fields.get("r_xx"))

    def interpolate_motion(self, q: Nodal, v: Nodal) -> tuple[PointFields, PointFields]:
        """The fields and their rates. They are computed as one batch: the compiler would otherwise compute
        a field with a single use inside that use, again for every component."""
        both = jax.vmap(self.interpolate)(jnp.stack([q, v]))
        fields, rates = (jax.tree.map(lambda x, i=i: x[i], both) for i in (0, 1))
        return fields, rates

    def nodal_forces(self, conjugates: PointFields, acceleration: Nodal | None = None) -> Nodal:
        """Nodal forces: the integral of S^T f + S_x^T n + S_xx^T m dx over all tethers, plus M
        `acceleration`.

        conjugates: f [N/m], n [N], m [N m] at the Gauss points.
        """
        scaled = {d: x * self.lengths ** (1 - d) for d, x in enumerate(conjugates) if x is not None}
        # Stacked into memory; otherwise they are computed again for every coefficient.
        values = stacked([x[None] for x in scaled.values()])
        tables = [(self.weights[:, None] * self.table(d)).T for d in scaled]
        parts = [integrate_shapes(table, value) for table, value in zip(tables, values, strict=True)]
        if acceleration is not None:
            parts.append(self.element_inertia(acceleration))
        forces = self.assemble(sum(parts[1:], parts[0]))
        return forces if acceleration is None else self.add_point_masses(forces, acceleration)

    def element_inertia(self, acceleration: Nodal) -> Float[Array, "coef2 3 *state element"]:
        """Inertia forces M `acceleration` of every element, before assembly."""
        vectors = self.element_vectors(acceleration) * self.masses
        return integrate_shapes(self.mass_table, jnp.swapaxes(vectors, 0, 1))

    def add_point_masses(self, forces: Nodal, acceleration: Nodal) -> Nodal:
        """`forces` plus the inertia forces of the point masses at the ends."""
        forces = forces.at[0, ..., -1, :].add(self.tip_mass * acceleration[0, ..., -1, :])
        if self.base_mass is not None:
            forces = forces.at[0, ..., 0, :].add(self.base_mass * acceleration[0, ..., 0, :])
        return forces

    def inertia(self, acceleration: Nodal) -> Nodal:
        """Inertia forces M `acceleration` ([PGV] Eq. 22), remote units included."""
        return self.add_point_masses(self.assemble(self.element_inertia(acceleration)), acceleration)

    def uniform(self, vector: Float[Array, "3"]) -> Nodal:
        """Nodal vectors of a uniform field: `vector` as the positions and zero slopes."""
        shape = (self.coefs, 3, self.elements + 1, self.count)
        return jnp.zeros(shape).at[0].set(vector[:, None, None])

    def mass_elements(
        self, axes: Float[Array | np.ndarray, "3 3"] = SAME_AXES
    ) -> Float[Array, "row col elem tether"]:
        """Element mass matrices (3 coef2, 3 coef2, elem, tether), with rows ordered (coef, xyz).

        elem has length 1 if all elements of a tether are equal. axes: factor of the mass of a point.
        """
        mass = jnp.kron(self.mass_table, axes)
        return mass[:, :, None, None] * jnp.atleast_2d(self.line_density * self.element_length)

    def point_masses(
        self, axes: Float[Array | np.ndarray, "3 3"] = SAME_AXES
    ) -> tuple[Float[Array, "row row tether"], Float[Array, "row row tether"] | None]:
        """Diagonal blocks of the point masses at the last and at the first node (None without one)."""
        position = jnp.kron(np.diag([1.0, 0.0][: self.coefs]), axes)[:, :, None]
        return self.tip_mass * position, None if self.base_mass is None else self.base_mass * position

    def tangent_elements(
        self, jacobian: dict[tuple[str, str], Array]
    ) -> Float[Array, "row col elem tether"]:
        """Element matrices from derivatives at the Gauss points.

        jacobian: for every (row, column) pair of fields, the derivative of the conjugate of `row` along
        each axis of `column`, (direction, component, point, element). Rows and columns of the result are
        ordered (coef, xyz), with slopes in metres.
        """
        order = PointFields._fields.index
        tables, values = [], []
        for (row, column), block in jacobian.items():
            scale = self.lengths ** (1 - order(row) - order(column))
            pair = (self.table(order(row)), self.table(order(column)))
            tables.append(np.einsum("q,qa,qb->abq", self.weights, *pair))
            values.append(jnp.moveaxis(block * scale, 2, 0))
        # Axes: a, b, direction, component, element.
        matrices = contract_first_axis(np.concatenate(tables, axis=2), stacked(values))
        coefs, axes = matrices.shape[0], matrices.shape[2]
        rows_first = matrices.transpose(0, 3, 1, 2, 4)
        return self.of_tethers(rows_first.reshape(coefs * axes, coefs * axes, -1))

    def blocks(self, elementwise: Float[Array, "row col elem tether"]) -> tuple[Array, Array, Array]:
        """Node blocks of a block-tridiagonal matrix from element matrices: diagonal (node, row, col,
        tether), upper and lower (elem, row, col, tether). Slope rows and columns are in metres."""
        matrices = jnp.moveaxis(elementwise, 2, 0)
        m = matrices.shape[1] // 2
        none = jnp.zeros_like(matrices[:1, :m, :m])
        diagonal = jnp.concatenate([matrices[:, :m, :m], none]) + jnp.concatenate(
            [none, matrices[:, m:, m:]]
        )
        return diagonal, matrices[:, :m, m:], matrices[:, m:, :m]


def per_element(numbers: PerMember, elements: int) -> Float[Array, " element"]:
    """One number per element of all tethers, from one per tether or from one per element of each."""
    return jnp.broadcast_to(numbers, (elements, numbers.shape[-1])).reshape(-1)


def at_points(
    table: Float[np.ndarray, "point coef2"], vectors: Float[Array, "coef2 3 *batch"]
) -> Float[Array, "3 point *batch"]:
    """Values at points: the sum of shape functions times element vectors."""
    weights = table.T.reshape(table.shape[1], 1, table.shape[0], *(1,) * (vectors.ndim - 2))
    return (weights * vectors[:, :, None]).sum(0)


def integrate_shapes(
    table: Float[np.ndarray, "coef2 point"], values: Float[Array, "3 point *batch"]
) -> Float[Array, "coef2 3 *batch"]:
    """Integrals of shape functions times values at points: the transpose of `at_points`."""
    weights = table.reshape(table.shape[0], 1, table.shape[1], *(1,) * (values.ndim - 2))
    return (weights * values).sum(2)


def contract_first_axis(table: np.ndarray, values: Float[Array, "first *batch"]) -> Array:
    """Product over the last axis of the table and the first axis of the values, as one matrix product."""
    flat = per_member_table(table.reshape(-1, table.shape[-1]), values) @ values.reshape(
        values.shape[0], -1
    )
    return flat.reshape(*table.shape[:-1], *values.shape[1:])
