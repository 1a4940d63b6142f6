"""What a run reports: the auxiliary variables of [PGV] Sec. 3 and the energies.

Every observable is a function of one instant, with its name, unit, symbol, axes and equation. Where
the printed formula is wrong the derived one is used; the entry says so with "derived".
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Rotation, Scalar, Vector, VectorPerPoint
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.dynamics.consistent import consistent_acceleration
from esail_jax.elements.axial import axial_strain
from esail_jax.environment.orbit import orbital_frame
from esail_jax.joints.roots import radial_directions
from esail_jax.numerics.angles import euler_angles, safe_angle, safe_length, smallest_eigenvector
from esail_jax.numerics.vectors import dot
from esail_jax.system import Power, System
from esail_jax.terms import PointFields

STRAIN_POINTS = 11
"""Points per element, ends included, at which the largest strain is looked for."""


class Instant(eqx.Module):
    """One saved instant, with what several observables share."""

    system: System
    time: Scalar
    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    lam: Multipliers
    work: Power
    start_energy: Scalar
    origin: Vector
    forces: Coordinates
    power: Power
    load: VectorPerPoint | None

    @property
    def p(self) -> int:
        return self.q.tether.shape[-1]

    @property
    def rotation(self) -> Rotation:
        """C_B^I."""
        return self.system.rotation(self.time, self.q)

    @property
    def centre(self) -> Vector:
        """Hub centre O_B, or the fixed centre of the turning frame [m]."""
        return jnp.zeros(3) if self.system.hub is None else self.system.hub.centre(self.q.hub)

    @property
    def orbital(self) -> Rotation:
        """C_O^I at the hub's current position."""
        return orbital_frame(self.origin + self.centre)

    @property
    def body_to_orbital(self) -> Rotation:
        return self.orbital.T @ self.rotation

    @property
    def tips(self) -> Float[Array, "3 tether"]:
        return self.q.tether[0, :, -1]

    @property
    def roots(self) -> Float[Array, "3 tether"]:
        return self.q.tether[0, :, 0]

    @property
    def root_slopes(self) -> Float[Array, "3 tether"]:
        """r_x at the roots; a truss has the direction of its first element."""
        nodal = self.q.tether
        if self.system.tethers.coefs == 2:
            return nodal[1, :, 0]
        return (nodal[0, :, 1] - nodal[0, :, 0]) / self.system.tethers.element_length

    @property
    def root_reactions(self) -> Float[Array, "3 tether"]:
        """Force of the hub on each tether [N]: what the root rows of M vdot - Q are short of."""
        return self.forces.tether[0, :, 0]

    @property
    def root_couples(self) -> Float[Array, "3 tether"]:
        """Couple of the hub on each clamped root [N m]: r_x x (conjugate of the clamp)."""
        if not self.system.clamped:
            return jnp.zeros((3, self.p))
        pull = jax.vjp(lambda q: self.system.constraints(self.time, q), self.q)[1]
        held = pull(jax.tree.map(jnp.negative, self.lam))[0].tether[1, :, 0]
        return jnp.cross(self.root_slopes, held, axis=0)

    def local_frame(self, vectors: Float[Array, "3 tether"]) -> Float[Array, "3 tether"]:
        """Components in the frame Z of each tether's root: X_B, outward, azimuthal ([PGV]
        Eq. 57-58)."""
        body = self.rotation.T @ vectors
        azimuth = 2.0 * np.pi * np.arange(self.p) / self.p
        outward = radial_directions(jnp.asarray(azimuth))
        sideways = jnp.stack([0 * outward[0], -outward[2], outward[1]])
        return jnp.stack([body[0], dot(outward, body), dot(sideways, body)])

    def thrust_nodal(self) -> Float[Array, "coef 3 node tether"]:
        """Generalized Coulomb forces ([PGV] Eq. 34)."""
        if self.load is None:
            return jnp.zeros_like(self.q.tether)
        return self.system.tethers.nodal_forces(PointFields(self.load, None))

    def thrusts(self) -> Float[Array, "3 tether"]:
        """F_c of each tether [N]."""
        return self.thrust_nodal()[0].sum(1)

    def thrust_moments(self) -> Float[Array, "3 tether"]:
        """Moment of the thrust about each root [N m]: nodal forces *and* slope forces."""
        nodal = self.thrust_nodal()
        arms = self.q.tether[0] - self.roots[:, None]
        moment = jnp.cross(arms, nodal[0], axis=0)
        if self.system.tethers.coefs == 2:
            moment = moment + jnp.cross(self.q.tether[1], nodal[1], axis=0)
        return moment.sum(1)

    def sail_axes(self) -> Rotation:
        """C_E^I: the mean plane of the tips ([PGV] Eq. 67-70); NaN below three tethers."""
        if self.p < 3:
            return jnp.full((3, 3), jnp.nan)
        offsets = self.tips - self.tips.mean(1, keepdims=True)
        normal = smallest_eigenvector(offsets @ offsets.T)
        normal = normal * jnp.where(normal @ self.rotation[:, 0] < 0.0, -1.0, 1.0)
        k = jnp.cross(normal, offsets[:, 0])
        k = k / jnp.linalg.norm(k)
        return jnp.stack([normal, jnp.cross(k, normal), k], axis=1)


def make_instant(
    system: System,
    origin: Vector,
    time: Scalar,
    q: Coordinates,
    v: Coordinates,
    work: Power,
    start_energy: Scalar,
) -> Instant:
    """An instant from a state, with accelerations and multipliers that fit it."""
    vdot, lam = consistent_acceleration(system, time, q, v)
    residual, power = system.residual(time, q, v, vdot, lam)
    load = None
    if system.loads:
        fields, rates = system.tethers.interpolate(q.tether), system.tethers.interpolate(v.tether)
        load = sum(term.force(time, fields, rates) for term in system.loads)
    return Instant(system, time, q, v, vdot, lam, work, start_energy, origin, residual.forces, power, load)


# ---- angles and energies ----------------------------------------------------------------------


def coning(local: Float[Array, "3 tether"]) -> Float[Array, " tether"]:
    """Elevation from the spin plane towards X_B; [PGV] Eq. 59 lacks the square root."""
    return safe_angle(local[0], safe_length(local[1], local[2]))


def lagging(local: Float[Array, "3 tether"]) -> Float[Array, " tether"]:
    """Angle in the spin plane from the root's radial direction, positive with the spin."""
    return safe_angle(local[2], local[1])


def kinetic_energy(system: System, v: Coordinates) -> Scalar:
    """T [J] of tethers, remote units and hub ([PGV] Eq. 21, 51)."""
    energy = 0.5 * (v.tether * system.tethers.inertia(v.tether)).sum()
    if system.hub is not None:
        energy = energy + 0.5 * (v.hub * (system.hub.mass_matrix @ v.hub)).sum()
    return energy


def elastic_energy(system: System, q: Coordinates) -> Scalar:
    """U [J] ([PGV] Eq. 23)."""
    fields = system.tethers.interpolate(q.tether)
    return sum(system.integrate(term.density(fields)) for term in system.energies)


def tether_distance(i: Instant) -> Scalar:
    """Smallest distance [m] from a remote unit to another tether (polyline through its nodes): two
    nearly straight tethers of one hub meet first, and part last, at the tip of the shorter."""
    if i.p < 2:
        return jnp.asarray(jnp.nan)
    starts, ends = i.q.tether[0, :, :-1], i.q.tether[0, :, 1:]
    segment = ends - starts
    offset = i.tips[:, :, None, None] - starts[:, None]
    share = (offset * segment[:, None]).sum(0) / (segment**2).sum(0)
    nearest = offset - jnp.clip(share, 0.0, 1.0) * segment[:, None]
    squared = (nearest**2).sum(0)
    own = jnp.eye(i.p, dtype=bool)[:, None, :]
    return jnp.sqrt(jnp.where(own, jnp.inf, squared).min())


def largest_strain(i: Instant) -> Float[Array, " tether"]:
    """Largest axial strain, in the scene's measure, over points that include the nodes."""
    tethers = i.system.tethers
    shapes = tethers.shape_table(np.linspace(0.0, 1.0, STRAIN_POINTS), 1)
    r_x = jnp.tensordot(shapes, tethers.element_vectors(i.q.tether), 1) / tethers.element_length
    strain = axial_strain(jnp.moveaxis(r_x, 1, 0), i.system.energies[0].strain)
    return strain.max((0, 1))


def arc_length(i: Instant) -> Float[Array, " tether"]:
    """Integral of |r_x| dx [m]."""
    tethers = i.system.tethers
    r_x = tethers.interpolate(i.q.tether).r_x
    stretch = jnp.sqrt(dot(r_x, r_x))
    return (tethers.weights[:, None, None] * stretch).sum((0, 1)) * tethers.element_length


def reaction_moments(i: Instant) -> Vector:
    """Moment about the hub centre of the root reactions, couples of clamped roots included."""
    arms = i.roots - i.centre[:, None]
    return (jnp.cross(arms, i.root_reactions, axis=0) + i.root_couples).sum(1)


def total_energy(i: Instant) -> Scalar:
    return kinetic_energy(i.system, i.v) + elastic_energy(i.system, i.q)


def transverse_angle(force: Vector) -> Scalar:
    """Angle of a force in O from Z_O: atan2(transverse, axial)."""
    return safe_angle(safe_length(force[0], force[1]), force[2])


# ---- the list ---------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Observable:
    """One entry: what stands in the run file's attributes, and the function of an instant."""

    name: str
    unit: str
    symbol: str
    axes: tuple[str, ...]
    equation: str
    function: Callable[[Instant], Array]
    needs_hub: bool = False


XYZ, TETHER = ("xyz",), ("tether",)

OBSERVABLES = (
    Observable("coning_angle", "rad", "gamma", TETHER, "[PGV] 56-59, derived",
               lambda i: coning(i.local_frame(i.tips - i.roots))),
    Observable("lagging_angle", "rad", "beta", TETHER, "[PGV] 56-59",
               lambda i: lagging(i.local_frame(i.tips - i.roots))),
    Observable("root_coning_angle", "rad", "gamma'", TETHER, "[PGV] 60-61",
               lambda i: coning(i.local_frame(i.root_slopes))),
    Observable("root_lagging_angle", "rad", "beta'", TETHER, "[PGV] 60-61",
               lambda i: lagging(i.local_frame(i.root_slopes))),
    Observable("tether_length", "m", "L", TETHER, "integral of |r_x|", arc_length),
    Observable("max_axial_strain", "-", "eps_max", TETHER, "[PGV] 24", largest_strain),
    Observable("angular_velocity_B", "rad/s", "omega^B", XYZ, "[PGV] 62-64, derived",
               lambda i: i.system.hub.angular_velocity(i.q.hub, i.v.hub), needs_hub=True),
    Observable("euler_hub", "rad", "psi, theta, phi", ("angle",), "[PGV] 65-66, derived",
               lambda i: euler_angles(i.body_to_orbital), needs_hub=True),
    Observable("euler_sail", "rad", "Psi, Theta, Phi", ("angle",), "[PGV] 67-71, derived",
               lambda i: euler_angles(i.orbital.T @ i.sail_axes())),
    Observable("sailing_angle", "rad", "alpha", (), "[PGV] Sec. 3.4",
               lambda i: transverse_angle(i.body_to_orbital[:, 0])),
    Observable("precession_angle", "rad", "delta", (), "[PGV] Sec. 3.4, derived",
               lambda i: safe_angle(*(i.orbital.T @ i.sail_axes()[:, 0])[jnp.array([1, 0])])),
    Observable("tip_position_I", "m", "r_u", ("tether", "xyz"), "[PGV] 69", lambda i: i.tips.T),
    Observable("hub_position_I", "m", "r_OB", XYZ, "[PGV] 43", lambda i: i.centre, needs_hub=True),
    Observable("rotation_IB", "-", "C_B^I", ("row", "col"), "[PGV] 41", lambda i: i.rotation),
    Observable("thrust_O", "N", "F_c", XYZ, "[PGV] 72-74, derived",
               lambda i: i.orbital.T @ i.thrusts().sum(1)),
    Observable("thrust_moment_O", "N m", "M_c", XYZ, "[PGV] 75-76, derived",
               lambda i: i.orbital.T @ i.thrust_moments().sum(1)),
    Observable("reaction_O", "N", "F_lambda", XYZ, "[PGV] 77",
               lambda i: i.orbital.T @ i.root_reactions.sum(1)),
    Observable("reaction_moment_O", "N m", "M_lambda", XYZ, "[PGV] 78",
               lambda i: i.orbital.T @ reaction_moments(i)),
    Observable("thrust_B", "N", "F_c,i", ("tether", "xyz"), "[PGV] 73",
               lambda i: (i.rotation.T @ i.thrusts()).T),
    Observable("thrust_moment_B", "N m", "M_c,i", ("tether", "xyz"), "[PGV] 75, derived",
               lambda i: (i.rotation.T @ i.thrust_moments()).T),
    Observable("reaction_B", "N", "lambda_i", ("tether", "xyz"), "[PGV] 53",
               lambda i: (i.rotation.T @ i.root_reactions).T),
    Observable("thrust_angle", "rad", "Gamma_c", (), "[PGV] after 74, derived",
               lambda i: transverse_angle(i.orbital.T @ i.thrusts().sum(1))),
    Observable("reaction_angle", "rad", "Gamma_lambda", (), "[PGV] after 77, derived",
               lambda i: transverse_angle(i.orbital.T @ i.root_reactions.sum(1))),
    Observable("kinetic_energy", "J", "E_k", (), "[PGV] 21, 51",
               lambda i: kinetic_energy(i.system, i.v)),
    Observable("elastic_energy", "J", "E_e", (), "[PGV] 23",
               lambda i: elastic_energy(i.system, i.q)),
    Observable("dissipated_power", "W", "2 P_d", (), "twice [PGV] 36",
               lambda i: i.power.dissipated),
    Observable("external_power", "W", "P_ext", (), "power of loads", lambda i: i.power.external),
    Observable("dissipated_energy", "J", "E_d", (), "integral of 2 P_d",
               lambda i: i.work.dissipated),
    Observable("external_work", "J", "W_ext", (), "integral of P_ext", lambda i: i.work.external),
    Observable("energy_balance_error", "J", "dE - W + E_d", (), "energy theorem",
               lambda i: total_energy(i) - i.start_energy - i.work.external + i.work.dissipated),
    Observable("smallest_tether_distance", "m", "d_min", (), "remote units to other tethers",
               tether_distance),
)  # fmt: skip


def listed(system: System) -> list[Observable]:
    """The observables of a system; those of the hub only if there is one."""
    return [entry for entry in OBSERVABLES if system.hub is not None or not entry.needs_hub]


def observe(instant: Instant) -> dict[str, Array]:
    """Every observable of an instant, by name."""
    return {entry.name: entry.function(instant) for entry in listed(instant.system)}
