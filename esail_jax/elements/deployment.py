"""Tethers that are paid out and reeled in: their length as a function of time, and what follows from it.

Of the length L of a tether the part l(t) is deployed. The rest is wound up on a reel at the root: a point
mass rho (L - l) there. xi in [0, 1] runs from root to tip, and elements share it equally, so that **mesh
points move through the material**: the material point at xi keeps its distance (1 - xi) l from the tip.
With lambda = l/L, u = 1 - xi, and slopes by x = xi L, which does not change with time, the strain is that
of r_s = r_x/lambda, and a material point has the velocity

    V = v + l' u r_s,

where v is the rate at a fixed mesh point, which is what a state holds. Lagrange's equations of deployed and
stored material are, per unit of x, with c = l'/l and forces conjugate to (r, r_x):

    inertia       rho lambda dv/dt
    convection    rho u (2 l' v_x + l'' r_x)       and    -(rho l'^2/lambda) u^2 r_x
    elasticity    that of the energy lambda W(r_s)
    damping       that of lambda R with the rate of r_s, (v_x - c r_x)/lambda
    loads         -lambda f(r, r_s, V)

The boundary term of the weak form is the flux of momentum at the guide, so that no flux term remains.
Material on the drum is unstrained, and leaves it without a loss."""

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import (
    Array,
    Float,
    Instants,
    Nodal,
    PerElement,
    PerPoint,
    PerTether,
    Scalar,
    VectorPerPoint,
)
from esail_jax.elements.tether import TetherBatch
from esail_jax.elements.thermal import ThermalEnergy
from esail_jax.measurements import Measurements
from esail_jax.numerics.lines_in_time import LinesInTime
from esail_jax.numerics.quadrature import gauss_legendre
from esail_jax.numerics.vectors import dot, total_of
from esail_jax.point_fields import Invariants, PointFields
from esail_jax.terms import ControlledLoad, Dissipation, Energy, Load, Term

PerInstant = Float[Array, "*state tether"]
"""One number per tether, at one or several instants."""


class Deployed(NamedTuple):
    """The deployed lengths at one or several instants.

    length: l [m]; rate: l' [m/s]; acceleration: l'' [m/s^2]."""

    length: PerInstant
    rate: PerInstant
    acceleration: PerInstant


class AbstractPayout(eqx.Module):
    """The deployed length of every tether. total: the length L [m]."""

    total: eqx.AbstractVar[PerTether]

    unknown: ClassVar[bool] = False
    """Tells whether the lengths are unknowns, which a state holds (`elements/winch.py`)."""

    @abstractmethod
    def at_start(self) -> Deployed:
        """The lengths at t = 0."""

    @abstractmethod
    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "AbstractPayout":
        """The lengths as a segment of a run sees them: without a kink."""


class ScheduledPayout(AbstractPayout):
    """Lengths that are given functions of time."""

    @abstractmethod
    def at(self, time: Instants) -> Deployed:
        """The lengths at one or several instants [s]: one number, or (*state, 1)."""

    def at_start(self) -> Deployed:
        return self.at(jnp.zeros(()))


class ExponentialPayout(ScheduledPayout):
    """l = l_0 exp(growth t).

    start: l_0 [m]; growth [1/s]."""

    total: PerTether
    start: PerTether
    growth: PerTether

    def at(self, time: Instants) -> Deployed:
        length = self.start * jnp.exp(self.growth * time)
        return Deployed(length, self.growth * length, self.growth**2 * length)

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "ExponentialPayout":
        return self


class RateTable(ScheduledPayout):
    """A rate that is linear between instants, and constant before the first and after the last.

    rates: l' [m/s]. length: l [m] at the knots, (instant, tether). l'' jumps at a knot: a run is divided
    there, and in a segment the rate is the straight line of that segment."""

    total: PerTether
    rates: LinesInTime
    length: Float[Array, "instant tether"]

    @classmethod
    def undivided(
        cls,
        total: PerTether,
        start: PerTether,
        time: Float[Array, " instant"],
        rate: Float[Array, "instant tether"],
    ) -> "RateTable":
        """The table of a run that has no segments yet. start: length [m] at t = 0."""
        whole = jnp.cumsum(0.5 * (rate[1:] + rate[:-1]) * jnp.diff(time)[:, None], axis=0)
        whole = jnp.concatenate([jnp.zeros_like(rate[:1]), whole])
        since_first = cls(total, LinesInTime.undivided(time, rate), whole)
        until_start = since_first.at_start().length
        return eqx.tree_at(lambda x: x.length, since_first, since_first.length + (start - until_start))

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "RateTable":
        return eqx.tree_at(lambda x: x.rates, self, self.rates.in_segment(start, until))

    def at(self, time: Instants) -> Deployed:
        a, b, since, duration = self.rates.line(time)
        rate = self.rates.table
        slope = (rate[b] - rate[a]) / duration
        length = self.length[a] + since * (rate[a] + 0.5 * slope * since)
        return Deployed(length, rate[a] + slope * since, slope)


# ---- what the lengths change --------------------------------------------------------------------


def density_of(tethers: TetherBatch) -> PerTether:
    """rho [kg/m] of every tether; that of the rods of a chain, which are of the same material."""
    return tethers.line_density[0] if tethers.kind == "rod" else tethers.line_density


def stored_mass(tethers: TetherBatch, payout: AbstractPayout, now: Deployed) -> PerInstant:
    """The mass rho (L - l) [kg] of what is wound up. tethers: at their full length."""
    return density_of(tethers) * (payout.total - now.length)


def deployed_tethers(tethers: TetherBatch, payout: AbstractPayout, now: Deployed) -> TetherBatch:
    """The tethers with the masses of an instant: of the deployed part per unit of x, and of the reel at the
    root."""
    share = now.length / payout.total
    base = stored_mass(tethers, payout, now)
    if tethers.base_mass is not None:
        base = base + tethers.base_mass
    masses = tethers.masses * tethers.repeat_per_element(share)
    return eqx.tree_at(
        lambda batch: (batch.line_density, batch.masses, batch.base_mass),
        tethers,
        (tethers.line_density * share, masses, base),
        is_leaf=lambda x: x is None,
    )


class Stretching(NamedTuple):
    """What terms of a deployed tether need, one number per element.

    share: lambda = l/L; rate: l' [m/s]; relative_rate: c = l'/l [1/s]; acceleration: l'' [m/s^2]; distance:
    u = 1 - xi of every point, (point, element)."""

    share: PerElement
    rate: PerElement
    relative_rate: PerElement
    acceleration: PerElement
    distance: Float[Array | np.ndarray, "point element"]

    @classmethod
    def of(cls, tethers: TetherBatch, payout: AbstractPayout, now: Deployed) -> "Stretching":
        """Those of an instant."""
        each = tethers.repeat_per_element
        return cls(
            share=each(now.length / payout.total),
            rate=each(now.rate),
            relative_rate=each(now.rate / now.length),
            acceleration=each(now.acceleration),
            distance=distances(tethers),
        )

    def along(self, field: VectorPerPoint) -> VectorPerPoint:
        """u times a field."""
        u = self.distance.reshape(self.distance.shape[0], *(1,) * (field.ndim - 3), -1)
        return jnp.asarray(u) * field


def distances(tethers: TetherBatch) -> Float[Array | np.ndarray, "point element"]:
    """u = 1 - xi of every Gauss point of every element of all tethers."""
    points = gauss_legendre(len(tethers.weights))[0]
    if tethers.kind == "rod":
        ends = jnp.cumsum(tethers.lengths)
        return 1.0 - (ends - (1.0 - points[:, None]) * tethers.lengths) / ends[-1]
    element = np.repeat(np.arange(tethers.elements), tethers.count)
    return 1.0 - (element + points[:, None]) / tethers.elements


def scaled(invariants: Invariants, share: PerElement) -> Invariants:
    """The invariants of r_s = r_x/lambda and r_ss = r_xx/lambda^2, from those of r_x and r_xx."""
    bent = invariants.normal_squared
    return Invariants(invariants.stretch_squared / share**2, None if bent is None else bent / share**4)


class DeployedEnergy(Energy):
    """The energy lambda W(r_s) per unit of x of an energy W per undeformed length."""

    inner: Energy
    share: PerElement

    name: ClassVar[str] = "deployed energy"

    @property
    def depends_on(self) -> tuple[str, ...]:
        return self.inner.depends_on

    def deformation(self, invariants: Invariants) -> PerPoint:
        return self.inner.deformation(scaled(invariants, self.share))

    def energy_density(self, e: PerPoint) -> PerPoint:
        return self.share * self.inner.energy_density(e)


class DeployedDissipation(Dissipation):
    """The dissipation lambda R per unit of x, with the rate of the strain of r_s in which mesh points do
    not move: without the term -c r_x a taut tether that is paid out would have a false stress."""

    inner: Dissipation
    share: PerElement
    relative_rate: PerElement

    name: ClassVar[str] = "deployed dissipation"

    @property
    def depends_on(self) -> tuple[str, ...]:
        return self.inner.depends_on

    def deformation(self, invariants: Invariants) -> PerPoint:
        return self.inner.deformation(scaled(invariants, self.share))

    def rayleigh_density(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        return self.share * self.inner.rayleigh_density(e, rate)

    def density_of_invariants(self, invariants: Invariants, rate: Invariants) -> PerPoint:
        now, moving = scaled(invariants, self.share), scaled(rate, self.share)
        c = self.relative_rate
        stretch = moving.stretch_squared - 2.0 * c * now.stretch_squared
        bent = None if now.normal_squared is None else moving.normal_squared - 4.0 * c * now.normal_squared
        return self.share * self.inner.density_of_invariants(now, Invariants(stretch, bent))


class DeployedMaterial(Term):
    """Energies and dissipations of the deployed part: their forces at r_s and r_ss, with rates of the
    strain of r_s in which mesh points do not move, conjugate to r_x and r_xx. They are those of
    `DeployedEnergy` and `DeployedDissipation`, with fewer operations at a point."""

    inner: Term
    stretching: Stretching

    name: ClassVar[str] = "deployed material"

    @property
    def depends_on(self) -> tuple[str, ...]:
        return self.inner.depends_on

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        s, back = self.stretching, 1.0 / self.stretching.share
        r_x = back * fields.r_x
        moving = back * rates.r_x - s.relative_rate * r_x
        bent = bending = None
        if fields.r_xx is not None:
            bent = back**2 * fields.r_xx
            bending = back**2 * rates.r_xx - 2.0 * s.relative_rate * bent
        forces = self.inner.point_forces(
            time, PointFields(fields.r, r_x, bent), PointFields(rates.r, moving, bending)
        )
        return forces if forces.r_xx is None else forces._replace(r_xx=back * forces.r_xx)


class DeployedLoad(Load):
    """A load on the deployed part, -lambda f(r, r_s, V) per unit of x."""

    inner: Load
    stretching: Stretching

    name: ClassVar[str] = "deployed load"

    @property
    def depends_on(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.inner.depends_on, "r", "r_x")))

    def force(self, time: Instants, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        share = self.stretching.share
        material = fields._replace(r_x=fields.r_x / share)
        velocity = rates.r + self.stretching.rate * self.stretching.along(material.r_x)
        # Only the velocity of the point is that of the material; no load depends on other rates.
        return share * self.inner.force(time, material, rates._replace(r=velocity))


class DeployedControlledLoad(DeployedLoad, ControlledLoad):
    """A load with a number per tether that a control law commands, on the deployed part."""

    inner: ControlledLoad
    stretching: Stretching

    @property
    def constant(self) -> bool:
        return self.inner.constant

    @property
    def law_name(self) -> str:
        return self.inner.law_name

    @property
    def command(self) -> PerElement | None:
        return self.inner.command

    def commanded(self, measurements: Measurements) -> PerTether:
        return self.inner.commanded(measurements)

    def with_command(self, command: Float[Array, "*state element"]) -> "DeployedControlledLoad":
        return DeployedControlledLoad(self.inner.with_command(command), self.stretching)


class Convection(Term):
    """The inertia forces of material that moves through the mesh. density: rho [kg/m] of every element;
    turning: da/dv [1/s] of acceleration fields, which act on all of the velocity V; None without any."""

    density: PerElement
    stretching: Stretching
    turning: Float[Array, "3 3"] | None = None

    name: ClassVar[str] = "convection"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x",)

    @property
    def acts_on(self) -> tuple[str, ...]:
        return ("r", "r_x")

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        s, rho = self.stretching, self.density
        moving = 2.0 * s.rate * rates.r_x + s.acceleration * fields.r_x
        if self.turning is not None:
            moving = moving - s.rate * jnp.tensordot(self.turning, fields.r_x, 1)
        moving = rho * s.along(moving)
        pull = rho * s.rate**2 / s.share * s.along(s.along(fields.r_x))
        return PointFields(moving, -pull)


def deployed_load(load: Load, stretching: Stretching) -> DeployedLoad:
    """The load on the deployed part."""
    if isinstance(load, ControlledLoad):
        return DeployedControlledLoad(load, stretching)
    return DeployedLoad(load, stretching)


class Reels(eqx.Module):
    """The reels of a sail at one or several instants: what they pay out, and the tethers at their full
    length.

    payout: the lengths as functions of time; now: those of the instant; stretching: the same for terms;
    tethers, energies, dissipations: as they are per undeformed length."""

    payout: AbstractPayout
    now: Deployed
    stretching: Stretching
    tethers: TetherBatch
    energies: tuple[Energy, ...]
    dissipations: tuple[Dissipation, ...]

    @classmethod
    def of(
        cls,
        tethers: TetherBatch,
        payout: AbstractPayout,
        now: Deployed,
        energies: tuple[Energy, ...],
        dissipations: tuple[Dissipation, ...],
    ) -> "Reels":
        """Those of an instant."""
        stretching = Stretching.of(tethers, payout, now)
        return cls(payout, now, stretching, tethers, energies, dissipations)

    @property
    def whole(self) -> PerElement:
        """L [m] of the tether of every element."""
        return self.tethers.repeat_per_element(self.payout.total)

    @property
    def density(self) -> PerElement:
        """rho [kg/m] of every element."""
        return self.tethers.repeat_per_element(density_of(self.tethers))

    def heating(
        self, term: ThermalEnergy, time: Instants, fields: PointFields, rates: PointFields
    ) -> PerPoint:
        """The power [W/m] of the thermal stress per unit of x, less what the thermal energy changes by as
        more of the tether is deployed."""
        s, part = self.stretching, term.thermal_part(time)
        material = PointFields(None, fields.r_x / s.share)
        moving = PointFields(None, (rates.r_x - s.relative_rate * fields.r_x) / s.share)
        stress = part.point_forces(time, material, moving).r_x
        power = dot(stress, moving.r_x) + s.relative_rate * term.thermal_energy(time, material)
        return s.share * power

    def velocity(self, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        """V = v + l' u r_s [m/s] of the material."""
        s = self.stretching
        return rates.r + s.rate / s.share * s.along(fields.r_x)

    def drift(self, q: Nodal) -> Nodal:
        """The momenta of the motion through the mesh, conjugate to the coordinates: those of rho l' u
        r_x."""
        s = self.stretching
        density = self.density
        fields = self.tethers.interpolate(q)
        return self.tethers.nodal_forces(PointFields(density * s.rate * s.along(fields.r_x), None))

    def elastic_energy(self, q: Nodal) -> Scalar:
        """U [J] of the deployed part."""
        return self.elastic_energy_of(self.now.length, self.tethers.interpolate(q)).sum()

    def elastic_energy_of(self, length: PerInstant, fields: PointFields) -> PerInstant:
        """U [J] of every tether of which this length [m] is deployed."""
        share = self.tethers.repeat_per_element(length / self.payout.total)
        terms = [DeployedEnergy(term, share) for term in self.energies]
        return self.per_tether(total_of(term.density(fields) for term in terms))

    def energy_of_motion(self, q: Nodal, v: Nodal) -> Scalar:
        """The kinetic energy [J] beside v . M v/2 of the motion through the mesh."""
        s, batch = self.stretching, self.tethers
        slope = s.along(batch.interpolate(q).r_x)
        density = 0.5 * self.density * s.rate**2 / s.share * dot(slope, slope)
        return (v * self.drift(q)).sum() + self.per_tether(density).sum()

    def dissipation(self, rate: PerInstant, fields: PointFields, rates: PointFields) -> PerInstant:
        """R [W] of every tether at the rates l' [m/s]."""
        each = self.tethers.repeat_per_element
        length = jnp.broadcast_to(self.now.length, rate.shape)
        share, relative = each(length / self.payout.total), each(rate / length)
        terms = [DeployedDissipation(term, share, relative) for term in self.dissipations]
        return self.per_tether(total_of(term.density(fields, rates) for term in terms))

    def per_tether(self, density: Float[Array, "point *state element"]) -> PerInstant:
        """The integral over every tether of a quantity per unit of x."""
        batch = self.tethers
        weights = batch.weights.reshape(-1, *(1,) * (density.ndim - 1))
        return batch.of_tethers((weights * density).sum(0) * batch.lengths).sum(-2)

    def winch_forces(self, q: Nodal, v: Nodal, vdot: Nodal, pushed: VectorPerPoint) -> PerInstant:
        """The force F_w [N] of every winch, which holds the length: Lagrange's equation of l,

            F_w = -(d/dt dT/dl' - d(T - U)/dl) - dR/dl' + Q_l,
            d/dt dT/dl' - dT/dl = int_0^1 rho [u (V_t . r_xi + V . v_xi) - V . V/2 + c u V . r_xi] dxi
                                  + rho |v(0)|^2/2,
            V_t = dv/dt + (l''/l - c^2) u r_xi + c u v_xi,

        with the virtual work Q_l of loads and fields per unit of l, that of a displacement u r_s of the
        material. pushed: their force [N/m] per unit of x."""
        now, s, batch = self.now, self.stretching, self.tethers
        fields, rates = batch.interpolate_motion(q, v)
        acceleration = batch.interpolate(vdot).r
        along, moving = (s.along(self.whole * x) for x in (fields.r_x, rates.r_x))
        c = s.relative_rate
        velocity = rates.r + c * along
        change = acceleration + (s.acceleration / (s.share * self.whole) - c**2) * along + c * moving
        bracket = dot(change, along) + dot(velocity, moving) - 0.5 * dot(velocity, velocity)
        bracket = self.density / self.whole * (bracket + c * dot(velocity, along))
        root = v[0, ..., 0, :]
        force = -self.per_tether(bracket) - 0.5 * density_of(batch) * dot(root, root)
        # Several states may share an instant: each has the derivatives of its own energy.
        length, rate = (jnp.broadcast_to(x, force.shape) for x in (now.length, now.rate))
        if self.energies:
            force = force - jax.grad(lambda x: self.elastic_energy_of(x, fields).sum())(length)
        if self.dissipations:
            force = force - jax.grad(lambda x: self.dissipation(x, fields, rates).sum())(rate)
        return force + self.per_tether(dot(pushed, s.along(fields.r_x)) / s.share)
