"""A chain of elastic rods in relative coordinates, solved in O(n) ([MW]).

The coordinates are the rod vectors x_i from joint i-1 to joint i. If nothing holds the first joint, its
position stands before them. The mass matrix is M = Phi^T G Phi (Eq. 24): Phi sums over rods, and G,
tridiagonal, is the mass matrix in the joints' positions. Eq. 28-30 therefore read

    tension of every rod -> force on every joint -> G eta = force -> x'' = difference of eta,

where eta are the joints' accelerations. G is factored once, or at every instant of a chain that is paid
out (`elements/deployment.py`). Eq. 29 forms sums over all rods beyond a joint
(Q_F F), which cancel against the differences taken right after. Without both, `cumsum` is needed only where
a load depends on position, and forces summed over 10^5 rods cannot cost digits. Accelerations are relative
to a freely falling particle, as in `System.field`; a linear field acts on x as on positions.

Energies, dissipations and loads are those of the system, evaluated on the same truss elements.
"""

from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float, Instants, Scalar, VectorPerPoint
from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AbstractAxialEnergy, AxialDissipation
from esail_jax.elements.hinges import Hinges
from esail_jax.loads.fields import OrbitalField, UniformGravity
from esail_jax.numerics.vectors import dot
from esail_jax.point_fields import PointFields
from esail_jax.system import Power, System
from esail_jax.terms import Field, LinearField, find_term

Rods = Float[Array, "3 vector"]

UNROLL = 4
"""Joints per iteration of the two loops. At 16, or with the differences inside the loops, the compiler does
not fuse an iteration, which takes two to ten times as long (measured)."""


class RodState(NamedTuple):
    """State of a chain, or the time derivative of a state.

    x: coordinates [m]. v: their rates [m/s]. work: [J] since the start; None without loads and
    dissipations.
    """

    x: Rods
    v: Rods
    work: Power | None


class MassFactors(NamedTuple):
    """Factors of G = U D U^T over the joints that move ([MW] Eq. 26-27 without square roots). The
    elimination runs from the tip to the root; U has ones on its diagonal and `to_next` beside it.

    pivot_inverse: 1/p_i [1/kg]. to_next: e_i/p_{i+1}, the coupling to the next joint, 0 at the tip.
    to_previous: e_{i-1}/p_i, the coupling to the joint before; for the first joint that is the anchor, or
    nothing.
    """

    pivot_inverse: Float[Array, " joint"]
    to_next: Float[Array, " joint"]
    to_previous: Float[Array, " joint"]


class RodChain(eqx.Module):
    """A chain of rods: the right-hand side of x'' = a(t, x, x') for a system of one tether of rods.

    hinges: springs at the joints; None without flexural rigidity. mass: factors of G.
    """

    system: System
    hinges: Hinges | None
    mass: MassFactors

    @classmethod
    def of(cls, system: System, hinges: Hinges | None = None) -> "RodChain":
        """The chain of a system, with its mass matrix factored."""
        return cls(system, hinges, factor(*joint_masses(system), held=system.roots is not None))

    def at(self, time: Instants) -> "RodChain":
        """The chain at an instant [s]: with the part of it that is paid out."""
        if self.system.payout is None:
            return self
        return RodChain.of(self.system.at(time), self.hinges)

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "RodChain":
        """The chain between two switch times [s]."""
        if self.system.payout is None:
            return self
        return replace(self, system=self.system.in_segment(start, until))

    @property
    def lengths(self) -> Float[Array, " rod"]:
        """Undeformed lengths [m] of the rods: of what is paid out."""
        system = self.system
        if system.reels is None:
            return system.tethers.lengths
        return system.tethers.lengths * system.reels.stretching.share

    @property
    def free(self) -> bool:
        """Tells whether nothing holds the first joint."""
        return self.system.roots is None

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of all parts that were built."""
        if self.hinges is None:
            return self.system.terms
        return (*self.system.terms, "hinges")

    @property
    def has_work(self) -> bool:
        """Tells whether anything does work, which the state then includes."""
        return does_work(self.system)

    def rods(self, x: Rods) -> Float[Array, "3 rod"]:
        """The rod vectors among the coordinates."""
        return x[:, 1:] if self.free else x

    def joints(self, x: Rods) -> Float[Array, "3 joint"]:
        """Positions of all joints from coordinates, or velocities from their rates."""
        ends = jnp.cumsum(x, axis=1)
        return ends if self.free else jnp.pad(ends, ((0, 0), (1, 0)))

    def coordinates(self, state: RodState) -> tuple[Coordinates, Coordinates]:
        """Positions q and velocities v of the joints, in the layout of the system."""
        q, v = (self.joints(x)[None, :, :, None] for x in (state.x, state.v))
        return Coordinates(q, None), Coordinates(v, None)

    def state(self, q: Coordinates, v: Coordinates, work: Power | None) -> RodState:
        """The state with given positions q and velocities v of the joints."""
        x, rate = (jnp.diff(c.tether[0, :, :, 0], axis=1) for c in (q, v))
        if self.free:
            first = [c.tether[0, :, :1, 0] for c in (q, v)]
            x, rate = (jnp.concatenate(pair, axis=1) for pair in zip(first, (x, rate), strict=True))
        return RodState(x, rate, work if self.has_work else None)

    def __call__(self, time: Scalar, state: RodState) -> RodState:
        """Time derivative of the state (x, v, work)."""
        x, v, _ = state
        chain = self.at(time)
        stress, load, power = chain.point_terms(time, x, v)
        if self.hinges is not None:
            stress = stress + jax.grad(self.hinges.energy)(self.rods(x))
        acceleration = chain.accelerate(time, x, v, stress, load)
        if power is not None and chain.system.reels is not None:
            q, qdot, vdot = (
                Coordinates(self.joints(c)[None, :, :, None], None) for c in (x, v, acceleration)
            )
            power, _ = chain.system.of_winches(time, q, qdot, vdot, power)
        return RodState(v, acceleration, power)

    def accelerate(
        self,
        time: Scalar,
        x: Rods,
        v: Rods,
        stress: Float[Array, "3 rod"],
        load: Float[Array, "3 joint"] | None,
    ) -> Rods:
        """Accelerations x'' from the axial forces of the rods and the loads on the joints: Eq. 30.

        The first loop eliminates joint by joint from the tip to the root, the second substitutes backwards.
        In freely falling axes the anchor accelerates by -g, the value with which the second loop starts.
        """
        system, mass = self.system, self.mass
        gravity = find_term(system.fields, UniformGravity)
        force = jnp.diff(stress, axis=1, append=0.0)
        if self.free:
            force = jnp.concatenate([stress[:, :1], force], axis=1)
        if load is not None:
            force = force + (load if self.free else load[:, 1:])

        def eliminate(beyond, row):
            force, to_next = row
            here = force - to_next * beyond
            return here, here

        def substitute(before, row):
            reduced, pivot_inverse, to_previous = row
            here = pivot_inverse * reduced - to_previous * before
            return here, here

        rest = jnp.zeros(3)
        start = rest if gravity is None else -gravity.vector
        others = [field.acceleration(time, *map(self.joints, (x, v))) for field in nonlinear_fields(system)]
        if others and not self.free:
            start = start - sum(a[:, 0] for a in others)
        _, reduced = lax.scan(eliminate, rest, (force.T, mass.to_next), reverse=True, unroll=UNROLL)
        rows = (reduced, mass.pivot_inverse, mass.to_previous)
        eta = lax.scan(substitute, start, rows, unroll=UNROLL)[1].T
        acceleration = jnp.diff(eta, axis=1, prepend=start[:, None])
        for field in linear_fields(system):
            acceleration = acceleration + field.acceleration(time, x, v)
        for a in others:
            acceleration = acceleration + (jnp.diff(a, axis=1, prepend=0.0) if self.free else jnp.diff(a))
        return acceleration

    def point_terms(
        self, time: Scalar, x: Rods, v: Rods
    ) -> tuple[Float[Array, "3 rod"], Float[Array, "3 joint"] | None, Power | None]:
        """Axial force vector of every rod [N], force of the loads on every joint [N] (None without loads),
        and power [W] (None if no work is done)."""
        system, tethers = self.system, self.system.tethers
        length = tethers.lengths
        # Without forces on points all fields are constant along a rod: one point is exact.
        pushed = bool(system.loads) or system.reels is not None
        weights = tethers.weights if pushed else np.ones(1)

        def fields_of(c: Rods) -> PointFields:
            slope = (self.rods(c) / length)[:, None]
            if not pushed:
                return PointFields(None, slope)
            slope = jnp.broadcast_to(slope, (3, weights.size, slope.shape[2]))
            return PointFields(between(tethers.table(0), self.joints(c)), slope)

        fields, rates = fields_of(x), fields_of(v)
        total, dissipated_density, loads = system.point_forces(time, fields, rates)
        stress = jnp.tensordot(weights, total.r_x, (0, 1))
        if not self.has_work:
            return stress, None, None
        joint_force, external, dissipated = None, jnp.zeros(()), jnp.zeros(())
        if pushed:
            force = -total.r * length  # (xyz, point, rod)
            near, far = (
                jnp.tensordot(tethers.weights * shape, force, (0, 1)) for shape in tethers.table(0).T
            )
            joint_force = jnp.pad(near, ((0, 0), (0, 1))) + jnp.pad(far, ((0, 0), (1, 0)))
            if system.reels is None:
                external = (joint_force * self.joints(v)).sum()
        if system.reels is not None and system.loads:
            push = -dot(loads.r, system.reels.velocity(fields, rates))
            external = ((weights @ push) * length).sum()
        if system.fields:
            external = external + system.field_power(time, *self.coordinates(RodState(x, v, None)))
        if system.dissipations:
            dissipated = ((weights @ dissipated_density) * length).sum()
        return stress, joint_force, Power(external, dissipated)


def does_work(system: System) -> bool:
    """Tells whether loads, dissipations, reels, or fields without a potential do work on a chain."""
    reels = system.payout is not None
    return bool(system.loads or system.dissipations or nonlinear_fields(system)) or reels


def linear_fields(system: System) -> list[LinearField]:
    """The acceleration fields that are linear in position and velocity."""
    return [field for field in system.fields if isinstance(field, LinearField)]


def nonlinear_fields(system: System) -> list[Field]:
    """The acceleration fields that are neither uniform nor linear. They have no potential that is known."""
    return [field for field in system.fields if not isinstance(field, LinearField | UniformGravity)]


def between(shapes: np.ndarray, joints: Float[Array, "3 joint"]) -> VectorPerPoint:
    """Interpolates joint values to the Gauss points of every rod: (xyz, point, rod)."""
    ends = jnp.stack([joints[:, :-1], joints[:, 1:]])
    return jnp.moveaxis(jnp.tensordot(shapes, ends, 1), 1, 0)


def joint_masses(system: System) -> tuple[Float[Array, " joint"], Float[Array, " rod"]]:
    """Diagonal and off-diagonal of G ([MW] Eq. 25) over all joints, end masses included."""
    tethers = system.tethers
    mass = tethers.masses
    table = tethers.mass_table
    diagonal = table[0, 0] * jnp.pad(mass, (0, 1)) + table[1, 1] * jnp.pad(mass, (1, 0))
    diagonal = diagonal.at[-1].add(tethers.tip_mass[0])
    if tethers.base_mass is not None:
        diagonal = diagonal.at[0].add(tethers.base_mass[0])
    return diagonal, table[0, 1] * mass


def factor(diagonal: Float[Array, " joint"], beside: Float[Array, " rod"], held: bool) -> MassFactors:
    """Factors of G from its diagonal and off-diagonal. held: whether the first joint is fixed."""
    if held:
        diagonal, before = diagonal[1:], beside
    else:
        before = jnp.pad(beside, (1, 0))

    def eliminate(beyond, row):
        own, to_next = row
        pivot = own - to_next**2 / beyond
        return pivot, pivot

    tip = diagonal[-1]
    _, pivots = lax.scan(eliminate, tip, (diagonal[:-1], before[1:]), reverse=True)
    pivots = jnp.append(pivots, tip)
    to_previous = before / pivots
    return MassFactors(1.0 / pivots, jnp.append(to_previous[1:], 0.0), to_previous)


def error_scale(chain: RodChain, start: RodState) -> RodState:
    """Scales of a state for absolute errors.

    They are the rod's length for a rod vector [m]; that length times the rate at which rods turn for its
    rate [m/s]; and the kinetic energy of the total mass at such speeds for work [J].
    """
    chain = chain.at(jnp.zeros(()))
    tethers, length = chain.system.tethers, chain.lengths
    rate = jnp.maximum(turning_rate(chain, start), 1e-4 * fastest_rate(chain))
    if chain.free:
        length = jnp.concatenate([length.mean()[None], length])
    x = jnp.broadcast_to(length, start.x.shape)
    mass = tethers.masses.sum() + tethers.tip_mass.sum()
    energy = mass * (rate * length.sum()) ** 2
    work = None if start.work is None else jax.tree.map(lambda _: energy, start.work)
    return RodState(x, rate * x, work)


def turning_rate(chain: RodChain, start: RodState) -> Scalar:
    """Estimated rate [rad/s] at which rods turn: the largest of their initial rates, the rate of a fall
    over their own length under gravity, and twice that of the orbit. Payout is no turning: the rates along
    the rods of a chain that is paid out do not count."""
    system, length, moving = chain.system, chain.lengths, chain.rods(start.v)
    if system.payout is not None:
        rods = chain.rods(start.x)
        moving = moving - rods * (dot(moving, rods) / dot(rods, rods))
    speed = jnp.sqrt((moving**2).sum(0).max())
    rate = speed / length.min()
    gravity, orbital = (find_term(system.fields, kind) for kind in (UniformGravity, OrbitalField))
    if gravity is not None:
        fall = jnp.sqrt((gravity.vector**2).sum())
        rate = jnp.maximum(rate, jnp.sqrt(fall / length.min()))
    if orbital is not None:
        rate = jnp.maximum(rate, 2.0 * orbital.orbit.mean_motion)
    return rate


def energy_floor(chain: RodChain) -> Scalar:
    """Energy [J] below which a difference is rounding, from the chain's total stiffness and weight."""
    system, tethers = chain.system, chain.system.tethers
    axial = find_term(system.energies, AbstractAxialEnergy)
    floor = 1e-20 * (axial.stiffness * tethers.lengths).sum()
    gravity = find_term(system.fields, UniformGravity)
    if gravity is not None:
        mass = tethers.masses.sum() + tethers.tip_mass.sum()
        fall = jnp.abs(gravity.vector).sum() * tethers.lengths.sum()
        floor = floor + 1e-13 * mass * fall
    return floor


def fastest_rate(chain: RodChain) -> Scalar:
    """Upper bound [1/s] of the chain's frequencies and of its rates of damping.

    No mode of an assembled structure is faster than its fastest free element (Irons & Treharne). A rod has
    omega^2 = 12 EA/(m l); a joint's spring adds at most 12 c (1/l_i + 1/l_{i+1})^2 (1/m_i + 1/m_{i+1}).
    Lumped masses only lower the frequencies. Damping with time gamma has the rate gamma omega^2.
    """
    length, mass = chain.lengths, chain.system.tethers.masses
    axial = find_term(chain.system.energies, AbstractAxialEnergy)
    damping = find_term(chain.system.dissipations, AxialDissipation)
    squared = 12.0 * axial.stiffness / (mass * length)
    rate = jnp.sqrt(squared.max())
    if damping is not None:
        rate = jnp.maximum(rate, (damping.time * squared).max())
    if chain.hinges is not None:
        lever, light = 1.0 / length, 1.0 / mass
        if chain.hinges.direction is not None:
            lever, light = (jnp.pad(c, (1, 0)) for c in (lever, light))
        spring = chain.hinges.stiffness * (lever[:-1] + lever[1:]) ** 2 * (light[:-1] + light[1:])
        rate = jnp.sqrt(rate**2 + 12.0 * spring.max(initial=0.0))
    return rate
