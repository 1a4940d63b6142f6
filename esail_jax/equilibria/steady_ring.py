"""Steady shape of spinning tethers whose tips are joined by auxiliary tethers, the initial state of a run.

The forces of tethers and ring balance the centrifugal force in axes that turn with the hub,

    M (Omega x (Omega x q)) = Q(q),

with the roots at their points of the hub. Tethers of unequal length, or segments of unequal length, pull
the tips sideways, so that the tethers are not radial and, because of their own mass, not quite straight.
Each tether stays in the plane through its root that touches its cone of the initial coning angle; no force
is balanced normal to that plane. Without coning this is the spin plane, and every force is balanced.

The equations are solved by Newton's method with the sparse solver of a run, in O(tethers * elements). A
small multiple of the mass matrix is added to the stiffness: a ring at the centre of a turning frame may
turn about the axis without any force, and that motion must not be amplified.
"""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import iteration_matrix
from esail_jax.array_types import Array, Bool, Float, Nodal, PerTether, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.elements.axial import AbstractAxialEnergy
from esail_jax.elements.ring import Ring
from esail_jax.joints.roots import FrameRoots
from esail_jax.numerics import structured
from esail_jax.numerics.bordered import Bordered, Vector
from esail_jax.numerics.known_solution import known_solution
from esail_jax.numerics.segments import END
from esail_jax.system import System
from esail_jax.terms import LinearField, find_term

MAX_ITERATIONS = 60
"""Largest number of Newton steps."""

FIRST_SHARE, LAST_SHARE, DECAY = 1.0, 1e-8, 0.1
"""Share of the mass matrix times Omega^2 that is added to the stiffness: in the first step, at the end, and
its change from one step to the next. The large first share shortens the first steps."""

STEP_TOLERANCE = 1e-11
"""The iteration ends when a step, relative to the largest coordinate, is at most this. One more step
follows, with the derivative of the solution."""

MAX_SLOPE_CHANGE = 0.2
"""Largest change of r_x at any point in one step."""

INWARDS = 1e-6
"""Least sag towards the axis, relative to the distance from the axis, that counts as such."""

LEAST_RATE = 1e-10
"""Least square of the rate that stands for Omega^2 in the share of the mass matrix, relative to that of the
slowest axial vibration: a sail that does not spin needs one."""


class CentrifugalField(LinearField):
    """Centrifugal acceleration about the x axis in axes that turn at a rate [rad/s]."""

    rate: Scalar

    name: ClassVar[str] = "centrifugal"

    @property
    def matrices(self) -> tuple[Float[Array, "3 3"], Float[Array, "3 3"]]:
        return self.rate**2 * np.diag([0.0, 1.0, 1.0]), jnp.zeros((3, 3))


class Planes(NamedTuple):
    """Right-handed unit vectors (3, tether) of every tether: along the cone, azimuthal, and normal to
    it."""

    along: Float[Array, "3 tether"]
    sideways: Float[Array, "3 tether"]
    normal: Float[Array, "3 tether"]


def planes_of(outward: Float[Array, "3 tether"], coning: Scalar) -> Planes:
    """The planes that touch the cones. outward: unit vectors of the azimuths; coning [rad]."""
    x_axis = jnp.zeros_like(outward).at[0].set(1.0)
    sideways = jnp.cross(x_axis, outward, axis=0)
    along = jnp.cos(coning) * outward + jnp.sin(coning) * x_axis
    return Planes(along, sideways, jnp.cross(along, sideways, axis=0))


class Ringed(NamedTuple):
    """Tethers with a ring in axes that turn with the hub, and what their steady shape depends on.

    planes: those in which the tethers stay; roots: positions of the roots [m]; spin: Omega [rad/s]."""

    frame: System
    planes: Planes
    roots: Float[Array, "3 tether"]
    spin: Scalar

    def coordinates(self, shape: "Shape") -> Coordinates:
        """The coordinates of a shape."""
        q = self.moved(shape)
        return q._replace(tether=q.tether.at[0].add(self.roots[:, None]))

    def moved(self, change: "Shape") -> Coordinates:
        """The change of the coordinates with a change of the shape."""
        tether = jnp.einsum("jxt,kjnt->kxnt", jnp.stack(self.planes), change.arms)
        return Coordinates(tether, None, change.ring)

    def shape(self, q: Coordinates, lam: Multipliers) -> "Shape":
        """The shape that has these coordinates and multipliers."""
        return self.change(q._replace(tether=q.tether.at[0].add(-self.roots[:, None])), lam)

    def change(self, dq: Coordinates, lam: Multipliers) -> "Shape":
        """The change of a shape with its coordinates and multipliers."""
        return Shape(jnp.einsum("jxt,kxnt->kjnt", jnp.stack(self.planes), dq.tether), dq.ring, lam)

    def unbalanced(self, shape: "Shape") -> Vector:
        """The forces within the planes, and the violations of the constraints."""
        forces, gaps = balance(self.frame, self.coordinates(shape), shape.lam)
        rows = iteration_matrix.to_vector(self.frame, forces, gaps)._replace(local=gaps.clamp)
        return rows._replace(blocks=within(rows.blocks, self.planes))

    def solved(self, shape: "Shape", rows: Vector, share: Scalar | float = LAST_SHARE) -> "Shape":
        """The change of the shape that changes `unbalanced` by these rows, with a share of the mass
        matrix."""
        softest = lax.stop_gradient(share * rate_squared(self.frame, self.spin))
        matrix = stiffness(self.frame, self.coordinates(shape), shape.lam, softest)
        matrix = constrained(matrix, self.planes, softest)
        rows = rows._replace(blocks=within(rows.blocks, self.planes))
        solution = structured.solve(matrix, structured.factor(matrix), rows)
        return self.change(*iteration_matrix.from_vector(self.frame, solution))


class Shape(NamedTuple):
    """A steady shape, in the planes of the tethers.

    arms: nodal vectors from the root, with the components of `Planes`; ring: own vectors of the ring;
    lam: multipliers."""

    arms: Float[Array, "coef plane node tether"]
    ring: Float[Array, "3 vector tether"] | None
    lam: Multipliers


def steady_ring(
    system: System,
    nodal: Nodal,
    outward: Float[Array, "3 tether"],
    radius: Scalar,
    spin: Scalar,
    coning: Scalar,
) -> tuple[Nodal, Float[Array, "3 vector tether"] | None, PerTether]:
    """Solves for the steady shape from the nodal vectors of tethers that are balanced without a ring.

    nodal: in the body frame B. outward: unit vectors of the azimuths in B. radius: that of the roots [m];
    spin: Omega [rad/s]; coning [rad].

    Returns nodal vectors of the tethers and own vectors of the ring in B, and the largest remaining force
    [N] of every tether and the segment that follows it. The result has derivatives of any order (implicit
    function theorem); the iterations carry none.
    """
    frame = at_rest(system, outward, radius, spin)
    ringed = Ringed(frame, planes_of(outward, coning), radius * outward, spin)
    fixed = lax.stop_gradient(ringed)
    start = Coordinates(nodal, None, hanging(system.ring, nodal[0, :, -1]))
    first = lax.stop_gradient(ringed.shape(start, frame.no_multipliers()))

    def iterate(carry):
        shape, _, share, count = carry
        change = fixed.solved(shape, jax.tree.map(jnp.negative, fixed.unbalanced(shape)), share)
        step = fixed.moved(change)
        steepest = jnp.abs(fixed.frame.tethers.interpolate(step.tether).r_x).max()
        ring = fixed.frame.ring.segments.interpolate(fixed.frame.ring.nodal(step)).r_x
        steepest = jnp.maximum(steepest, jnp.abs(ring).max())
        part = jnp.minimum(1.0, MAX_SLOPE_CHANGE / steepest)
        size = jnp.abs(step.tether[0]).max() / jnp.abs(fixed.coordinates(shape).tether[0]).max()
        parts = Shape(part, None if shape.ring is None else part, jax.tree.map(jnp.ones_like, shape.lam))
        shape = jax.tree.map(lambda x, y, part: x + part * y, shape, change, parts)
        return shape, size, jnp.maximum(DECAY * share, LAST_SHARE), count + 1

    def unfinished(carry):
        _, size, share, count = carry
        return ((size > STEP_TOLERANCE) | (share > LAST_SHARE)) & (count < MAX_ITERATIONS)

    begin = (first, jnp.asarray(jnp.inf), jnp.asarray(FIRST_SHARE), jnp.zeros((), int))
    shape, *_ = lax.while_loop(unfinished, iterate, begin)
    change = fixed.solved(shape, jax.tree.map(jnp.negative, fixed.unbalanced(shape)))
    shape = jax.tree.map(jnp.add, shape, change)
    q = fixed.coordinates(shape)
    forces, _ = balance(fixed.frame, q, shape.lam)
    blocks = within(iteration_matrix.to_blocks(fixed.frame, forces.tether), fixed.planes)
    left = jnp.abs(blocks.at[0, :END].set(0.0)).max((0, 1))
    if forces.ring is not None:
        left = jnp.maximum(left, jnp.abs(forces.ring).max((0, 1)))
    wrong = jnp.isnan(left) | bows_inwards(fixed.frame.ring, q)
    q = ringed.coordinates(known_solution(Ringed.unbalanced, Ringed.solved, ringed, shape))
    return q.tether, q.ring, jnp.where(wrong, jnp.inf, left)


def at_rest(system: System, outward: Float[Array, "3 tether"], radius: Scalar, spin: Scalar) -> System:
    """The tethers and the ring in axes that turn with the hub: without hub, loads and damping."""
    ring = eqx.tree_at(lambda ring: ring.dissipations, system.ring, ())
    normals = None
    if system.clamped:
        sideways = planes_of(outward, jnp.zeros(())).sideways
        normals = jnp.stack([jnp.zeros_like(sideways).at[0].set(1.0), sideways])
    roots = FrameRoots(jnp.eye(3), jnp.zeros(()), radius * outward, normals)
    return System(system.tethers, roots, None, system.energies, (), (), (CentrifugalField(spin),), ring)


def balance(frame: System, q: Coordinates, lam: Multipliers) -> tuple[Coordinates, Multipliers]:
    """The unbalanced forces [N] of a shape, and the violations of the constraints [m]."""
    nothing, zero = jax.tree.map(jnp.zeros_like, q), jnp.zeros(())
    return frame.residual(zero, q, nothing, nothing, lam)[0]


def stiffness(frame: System, q: Coordinates, lam: Multipliers, share: Scalar) -> Bordered:
    """Derivative of the unbalanced forces, plus `share` [1/s^2] times the mass matrix."""
    nothing, zero = jax.tree.map(jnp.zeros_like, q), jnp.zeros(())
    matrix = iteration_matrix.tangent(frame, zero, q, nothing, lam, 1.0 / share, zero)
    chain = jax.tree.map(lambda x: share * x, (matrix.diag, matrix.upper, matrix.lower, matrix.segments))
    return matrix._replace(**dict(zip(("diag", "upper", "lower", "segments"), chain, strict=True)))


def rate_squared(frame: System, spin: Scalar) -> Scalar:
    """Omega^2 [1/s^2], but at least what LEAST_RATE says."""
    axial = find_term(frame.energies, AbstractAxialEnergy).stiffness.max()
    tethers = frame.tethers
    masses = tethers.of_tethers(tethers.masses).sum(0) + tethers.tip_mass
    lengths = tethers.of_tethers(tethers.lengths).sum(0)
    return jnp.maximum(spin**2, LEAST_RATE * axial / (masses * lengths).max())


def projectors(planes: Planes) -> Float[Array, "3 3 tether"]:
    """1 - n n^T with the normals n of the planes."""
    return jnp.eye(3)[:, :, None] - planes.normal[:, None] * planes.normal[None]


def within(blocks: Float[Array, "node row tether"], planes: Planes) -> Float[Array, "node row tether"]:
    """The parts of nodal vectors within the planes. Those of the root node are not changed."""
    vectors = blocks.reshape(blocks.shape[0], -1, 3, blocks.shape[-1])
    inside = jnp.einsum("xyt,nkyt->nkxt", projectors(planes), vectors[1:])
    return jnp.concatenate([vectors[:1], inside]).reshape(blocks.shape)


def constrained(matrix: Bordered, planes: Planes, share: Scalar) -> Bordered:
    """The matrix on the planes of the tethers, with its largest entry for motions normal to them. The
    segments' own vectors are free."""
    size = matrix.diag.shape[1] // 3
    inside = projectors(planes)
    every = jnp.einsum("ab,xyt->axbyt", np.eye(size), inside).reshape(3 * size, 3 * size, -1)
    root = jnp.broadcast_to(jnp.eye(3 * size)[:, :, None], every.shape)
    count = matrix.diag.shape[0]
    node = jnp.concatenate([root[None], jnp.broadcast_to(every, (count - 1, *every.shape))])

    def both(left, blocks, right):
        return jnp.einsum("nabt,nbct,ncdt->nadt", left, blocks, right)

    normal = jnp.abs(matrix.diag).max((1, 2), keepdims=True) * (root - node)
    segments = matrix.segments
    rows = segments.diag.shape[1]
    first = jnp.broadcast_to(jnp.eye(rows)[:, :, None], (rows, rows, inside.shape[-1]))
    inner = jnp.broadcast_to(first, (segments.diag.shape[0], *first.shape))
    ends = inner.at[0, :END, :END].set(inside)
    ends = ends.at[-1, :END, :END].set(jnp.roll(inside, -1, axis=-1))
    return matrix._replace(
        diag=both(node, matrix.diag, node) + normal,
        upper=both(node[:-1], matrix.upper, node[1:]),
        lower=both(node[1:], matrix.lower, node[:-1]),
        segments=segments._replace(
            diag=both(ends, segments.diag, ends),
            upper=both(ends[:-1], segments.upper, ends[1:]),
            lower=both(ends[1:], segments.lower, ends[:-1]),
        ),
    )


def bows_inwards(ring: Ring, q: Coordinates) -> Bool[Array, " tether"]:
    """Tells which segments bow towards the axis: a balance of forces, but an unstable one."""
    nodes = ring.nodal(q)[0]
    first, last = nodes[:, :1], nodes[:, -1:]
    x = jnp.arange(nodes.shape[1])[:, None] / (nodes.shape[1] - 1.0)
    middle = (first + last).at[0].set(0.0)
    size = jnp.linalg.norm(middle, axis=0)
    outwards = ((nodes - first - x * (last - first)) * middle).sum(0) / size
    return (outwards < -INWARDS * size).any(0)


def hanging(ring: Ring, tips: Float[Array, "3 tether"]) -> Float[Array, "3 vector tether"] | None:
    """Own vectors of segments between the tips: straight, or, where a segment is longer than the distance
    of its tips, a parabola of about its length that bows away from the axis."""
    if not ring.own_vectors:
        return None
    n, k = ring.segments.elements, ring.segments.coefs
    chord = jnp.roll(tips, -1, axis=-1) - tips
    distance = jnp.linalg.norm(chord, axis=0)
    total = ring.segments.of_tethers(ring.segments.lengths).sum(0)
    sag = jnp.sqrt(3.0 / 8.0 * distance * jnp.maximum(total - distance, 0.0))
    middle = (tips + 0.5 * chord).at[0].set(0.0)
    bow = sag * middle / jnp.linalg.norm(middle, axis=0)
    x = jnp.arange(n + 1.0)[:, None] / n
    position = tips[:, None] + x * chord[:, None] + 4.0 * x * (1.0 - x) * bow[:, None]
    slope = (chord[:, None] + 4.0 * (1.0 - 2.0 * x) * bow[:, None]) / n
    vectors = jnp.stack([position, slope][:k], axis=2)
    return ring.own_of(vectors.reshape(3, -1, vectors.shape[-1]))
