"""Observables of a sail: the auxiliary variables of [PGV] Sec. 3 and the energies.

Every observable is a function of one instant, with name, unit, symbol, axes and equation. If the printed
formula is wrong, the observable uses a derived one, and its entry says "derived".
"""

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Rotation, Scalar, Vector
from esail_jax.elements.axial import AbstractAxialEnergy, axial_strain
from esail_jax.elements.thermal import ThermalEnergy
from esail_jax.environment.orbital_elements import orbital_elements
from esail_jax.equilibria.moving_frame import MovingFrame
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.numerics.angles import euler_angles, safe_angle, safe_length, where_defined
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import dot
from esail_jax.observables import reduced_models as reduced
from esail_jax.observables.entry import Observable, elastic_energy, kinetic_energy, thermal_energy
from esail_jax.observables.instant import Instant
from esail_jax.sensors import angular_velocity
from esail_jax.system import System
from esail_jax.terms import find_term

STRAIN_POINTS = 11
"""Number of points per element, including its ends, at which the strain is evaluated to find its
maximum."""


# ---- angles and lengths ----------------------------------------------------------------------


def coning(local: Float[Array, "3 tether"]) -> Float[Array, " tether"]:
    """The elevation from the spin plane towards X_B. In [PGV] Eq. 59 the square root is missing."""
    return safe_angle(local[0], safe_length(local[1], local[2]))


def lagging(local: Float[Array, "3 tether"]) -> Float[Array, " tether"]:
    """The angle in the spin plane from the root's radial direction, positive about X_B."""
    return safe_angle(local[2], local[1])


def tether_distance(i: Instant) -> Scalar:
    """The smallest distance [m] from a remote unit to another tether (polyline through its nodes).

    Two nearly straight tethers of one hub touch first, and separate last, at the tip of the shorter one."""
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
    """The largest axial strain, in the scene's strain measure, over points that include the
    nodes."""
    tethers = i.system.tethers
    shapes = tethers.shape_table(np.linspace(0.0, 1.0, STRAIN_POINTS), 1)
    r_x = jnp.tensordot(shapes, tethers.element_vectors(i.q.tether), 1) / tethers.lengths
    r_x = jnp.moveaxis(r_x, 1, 0)
    axial = find_term(i.system.energies, AbstractAxialEnergy)
    if i.system.reels is not None:
        r_x = r_x / i.system.reels.stretching.share
    strain = axial_strain(dot(r_x, r_x), axial.strain)
    return tethers.of_tethers(strain.max(0)).max(0)


def arc_length(i: Instant) -> Float[Array, " tether"]:
    """The length of the deformed tether [m], the integral of |r_x| dx."""
    tethers = i.system.tethers
    r_x = tethers.interpolate(i.q.tether).r_x
    stretch = jnp.sqrt(dot(r_x, r_x))
    return tethers.of_tethers(jnp.tensordot(tethers.weights, stretch, 1) * tethers.lengths).sum(0)


def reaction_moments(i: Instant) -> Vector:
    """The moment of the root reactions about the hub centre [N m], with the couples of clamped
    roots."""
    arms = i.roots - i.centre[:, None]
    return (jnp.cross(arms, i.root_reactions, axis=0) + i.root_couples).sum(1)


def voltage(i: Instant) -> Float[Array, " tether"]:
    """Voltage [V] that the sail's voltage law commands."""
    load = find_term(i.system.loads, CoulombThrust)
    return load.commanded(i.measured)


def electron_current(i: Instant) -> Float[Array, " tether"]:
    """Electron current [A] that every tether collects at its voltage."""
    position = i.measured.position
    return find_term(i.system.loads, CoulombThrust).collector.current(i.time, voltage(i), position)


def electric_power(i: Instant) -> Scalar:
    """Electric power [W] of all tethers, the sum of voltage times current."""
    position = i.measured.position
    return find_term(i.system.loads, CoulombThrust).collector.power(i.time, voltage(i), position)


def temperature(i: Instant) -> Float[Array, " tether"]:
    """Temperature [K] of every tether."""
    return find_term(i.system.energies, ThermalEnergy).temperature.at(i.time)


def external_power(i: Instant) -> Scalar:
    """Power [W] of loads and heating: that of loads and thermal stress, plus the rate of the thermal
    energy, in the frame I."""

    def energy(tau):
        return thermal_energy(i.system, i.time + tau, i.q.axpy(tau, i.v))

    power = i.power.external if i.shift is None else i.power.external + i.shift_power
    if find_term(i.system.energies, ThermalEnergy) is None:
        return power
    return power + jax.jvp(energy, (jnp.zeros(()),), (jnp.ones(()),))[1]


def relative_work(i: Instant) -> Scalar:
    """Work [J] of loads and heating: that of loads and thermal stress, and the thermal energy. It is zero
    at the start, as the stepper's integral begins at minus the thermal energy (`simulation/problem.py`).
    Once an orbit was rectified, the work is that relative to the origin of the coordinates."""
    thermal = thermal_energy(i.system, i.time, i.q)
    return i.work.external if thermal is None else i.work.external + thermal


def external_work(i: Instant) -> Scalar:
    """Work [J] of loads and heating in the frame I."""
    return relative_work(i) if i.shift is None else relative_work(i) + i.shift_energy


def kinetic(i: Instant) -> Scalar:
    """Kinetic energy [J] of the motion in the frame I."""
    energy = kinetic_energy(i.system, i.v, i.q)
    return energy if i.shift is None else energy + i.shift_energy


def energy_balance_error(i: Instant) -> Scalar:
    """Error [J] of the energy balance. The energy of a shift of the origin is part of both energy and work;
    it is left out, because it is much larger than the rest."""
    energy = kinetic_energy(i.system, i.v, i.q) + elastic_energy(i.system, i.time, i.q)
    if i.work.winch is not None:
        energy = energy - i.work.winch
    return energy - i.start_energy - relative_work(i) + i.work.dissipated


def transverse_angle(vector: Vector) -> Scalar:
    """The angle [rad] of a vector in O from Z_O: atan2(transverse, axial)."""
    return safe_angle(safe_length(vector[0], vector[1]), vector[2])


def angle_of_sum(orbital: Rotation, forces: Float[Array, "3 tether"]) -> Scalar:
    """The angle [rad] of a sum of forces from Z_O. It is NaN where the forces balance each other
    but for rounding, and where all are zero. orbital: the axes of O."""
    total = forces.sum(1)
    sizes = jnp.sqrt(jax.lax.stop_gradient(forces**2).sum(0)).sum()
    size = jnp.sqrt(jax.lax.stop_gradient(total**2).sum())
    return where_defined(transverse_angle(orbital.T @ total), size, sizes)


def precession(orbital: Rotation, normal: Vector) -> Scalar:
    """The angle [rad] of the normal of the sail about Z_O. It is NaN where the normal is parallel
    to Z_O but for rounding. orbital: the axes of O."""
    x, y, _ = orbital.T @ normal
    return where_defined(safe_angle(y, x), safe_length(x, y), 1.0)


def sail_spin(i: Instant) -> Scalar:
    """The rate [rad/s] at which the sail turns as a whole: L/I, with the angular momentum L about
    the centre of mass and the moment of inertia I of all masses about its axis, positive about X_B. It is
    zero without angular momentum."""
    q = i.system.centred(i.q)
    momentum = i.system.angular_momentum(q, i.v)
    size = safe_length(safe_length(momentum[0], momentum[1]), momentum[2])
    axis = momentum / jnp.where(size > 0.0, size, 1.0)
    turning = MovingFrame(axis, jnp.zeros(3)).turned(q)
    parts = jax.tree.map(lambda a, b: (a * b).sum(), turning, i.system.momenta(turning))
    inertia = sum(jax.tree.leaves(parts))
    sign = jnp.where(axis @ i.rotation[:, 0] < 0.0, -1.0, 1.0)
    return jnp.where(size > 0.0, sign * size / jnp.where(size > 0.0, inertia, 1.0), 0.0)


def hub_velocity(i: Instant) -> Vector:
    """The velocity of the centre of the hub [m/s] in the frame I."""
    velocity = i.system.hub.centre(i.v.hub)
    return velocity if i.shift is None else velocity + i.shift.velocity


def total_momentum(i: Instant) -> Vector:
    """The momentum of the sail [kg m/s] in the frame I."""
    momentum = i.system.momentum(i.v, i.q)
    return momentum if i.shift is None else momentum + i.mass * i.shift.velocity


def total_angular_momentum(i: Instant) -> Vector:
    """The angular momentum of the sail [kg m^2/s] about the origin of the frame I."""
    own, shift = i.system.angular_momentum(i.q, i.v), i.shift
    if shift is None:
        return own
    momentum, first_moment = i.system.momentum(i.v, i.q), i.system.momentum(i.q)
    carried = jnp.cross(first_moment + i.mass * shift.position, shift.velocity)
    return own + jnp.cross(shift.position, momentum) + carried


def hub_acceleration(i: Instant) -> Vector:
    """The acceleration of the hub's centre [m/s^2] less that of free fall, in B."""
    place, velocity = (x.reshape(3, 1) for x in (i.centre, i.system.hub.centre(i.v.hub)))
    acceleration = i.system.hub.centre(i.vdot.hub)
    for field in i.system.fields:
        acceleration = acceleration - field.acceleration(i.time, place, velocity)[:, 0]
    return i.rotation.T @ acceleration


def tip_directions(i: Instant) -> Float[Array, "tether 3"]:
    """The unit vectors from the hub's centre to the remote units, in B."""
    lines = matmul(i.rotation.T, i.tips - i.centre[:, None])
    return (lines / jnp.sqrt((lines**2).sum(0))).T


def spin_rates(i: Instant) -> Float[Array, "2"]:
    """The spin rates [rad/s] of the hub about X_B and of the sail as a whole."""
    return jnp.stack([angular_velocity(i.system, i.q, i.v)[0], sail_spin(i)])


# ---- the list ---------------------------------------------------------------------------------


XYZ, TETHER = ("xyz",), ("tether",)

OBSERVABLES = (
    Observable("coning_angle", "rad", "gamma", TETHER, "[PGV] 56-59, derived",
               lambda i: coning(i.local_frame(i.tips - i.roots))),
    Observable("lagging_angle", "rad", "beta", TETHER, "[PGV] 56-59",
               lambda i: i.sense * lagging(i.local_frame(i.tips - i.roots))),
    Observable("root_coning_angle", "rad", "gamma'", TETHER, "[PGV] 60-61",
               lambda i: coning(i.local_frame(i.root_slopes))),
    Observable("root_lagging_angle", "rad", "beta'", TETHER, "[PGV] 60-61",
               lambda i: i.sense * lagging(i.local_frame(i.root_slopes))),
    Observable("tether_length", "m", "L", TETHER, "integral of |r_x|", arc_length),
    Observable("max_axial_strain", "-", "eps_max", TETHER, "[PGV] 24", largest_strain),
    Observable("angular_velocity_B", "rad/s", "omega^B", XYZ, "[PGV] 62-64, derived",
               lambda i: i.system.hub.angular_velocity(i.q.hub, i.v.hub), needs="hub"),
    Observable("euler_hub", "rad", "psi, theta, phi", ("angle",), "[PGV] 65-66, derived",
               lambda i: euler_angles(i.body_to_orbital), needs="hub"),
    Observable("euler_sail", "rad", "Psi, Theta, Phi", ("angle",), "[PGV] 67-71, derived",
               lambda i: euler_angles(matmul(i.orbital.T, i.sail_axes()))),
    Observable("sailing_angle", "rad", "alpha", (), "[PGV] Sec. 3.4",
               lambda i: transverse_angle(i.body_to_orbital[:, 0])),
    Observable("precession_angle", "rad", "delta", (), "[PGV] Sec. 3.4, derived",
               lambda i: precession(i.orbital, i.sail_axes()[:, 0])),
    Observable("tip_position_I", "m", "r_u", ("tether", "xyz"), "[PGV] 69",
               lambda i: i.from_origin(i.tips).T),
    Observable("hub_position_I", "m", "r_OB", XYZ, "[PGV] 43", lambda i: i.from_origin(i.centre),
               needs="hub"),
    Observable("hub_velocity_I", "m/s", "v_OB", XYZ, "time derivative of r_OB", hub_velocity, needs="hub"),
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
               lambda i: matmul(i.rotation.T, i.thrusts()).T),
    Observable("thrust_moment_B", "N m", "M_c,i", ("tether", "xyz"), "[PGV] 75, derived",
               lambda i: matmul(i.rotation.T, i.thrust_moments()).T),
    Observable("reaction_B", "N", "lambda_i", ("tether", "xyz"), "[PGV] 53",
               lambda i: matmul(i.rotation.T, i.root_reactions).T),
    Observable("thrust_angle", "rad", "Gamma_c", (), "[PGV] after 74, derived",
               lambda i: angle_of_sum(i.orbital, i.thrusts())),
    Observable("reaction_angle", "rad", "Gamma_lambda", (), "[PGV] after 77, derived",
               lambda i: angle_of_sum(i.orbital, i.root_reactions)),
    Observable("kinetic_energy", "J", "E_k", (), "[PGV] 21, 51", kinetic),
    Observable("elastic_energy", "J", "E_e", (), "[PGV] 23",
               lambda i: elastic_energy(i.system, i.time, i.q)),
    Observable("dissipated_power", "W", "2 P_d", (), "twice [PGV] 36",
               lambda i: i.power.dissipated),
    Observable("external_power", "W", "P_ext", (), "power of loads and heating", external_power),
    Observable("dissipated_energy", "J", "E_d", (), "integral of 2 P_d",
               lambda i: i.work.dissipated),
    Observable("external_work", "J", "W_ext", (), "integral of P_ext", external_work),
    Observable("energy_balance_error", "J", "dE - W + E_d", (), "energy theorem",
               energy_balance_error),
    Observable("smallest_tether_distance", "m", "d_min", (), "remote units to other tethers",
               tether_distance),
    Observable("auxiliary_tension", "N", "T_aux", TETHER, "mean axial force of a segment",
               lambda i: i.system.ring.tension(i.q, i.v), needs="auxiliary_tethers"),
    Observable("temperature", "K", "T_i", TETHER, "`[thermal]`", temperature, needs="thermal"),
    Observable("deployed_length", "m", "l_i", TETHER, "`[deployment]`", lambda i: i.system.reels.now.length,
               needs="deployment"),
    Observable("payout_rate", "m/s", "l'_i", TETHER, "`[deployment]`", lambda i: i.system.reels.now.rate,
               needs="deployment"),
    Observable("winch_tension", "N", "|n_0|", TETHER, "force of the guide on the tether",
               lambda i: jnp.sqrt((i.root_reactions**2).sum(0)), needs="deployment"),
    Observable("winch_power", "W", "-l' F_w", TETHER, "Lagrange's equation of the length",
               lambda i: -i.system.reels.now.rate * i.winch_forces, needs="deployment"),
    Observable("winch_work", "J", "W_w", (), "integral of the sum of -l' F_w", lambda i: i.work.winch,
               needs="deployment"),
    Observable("voltage", "V", "V_i", TETHER, "voltage law", voltage, needs="solar_wind"),
    Observable("total_momentum_I", "kg m/s", "P", XYZ, "sum of M v, in the frame I", total_momentum,
               needs="hub"),
    Observable("angular_momentum_I", "kg m^2/s", "L", XYZ, "about the centre of mass",
               lambda i: i.system.angular_momentum(i.system.centred(i.q), i.v), needs="hub"),
    Observable("total_angular_momentum_I", "kg m^2/s", "H", XYZ, "about the origin of I",
               total_angular_momentum, needs="hub"),
    Observable("spin_rate", "rad/s", "omega", ("body",), "of the hub about X_B, and L/I of the sail",
               spin_rates, needs="hub"),
    Observable("electron_current", "A", "I_i", TETHER, "2 r_w e n_0 sqrt(2 e V/m_e) per length of a wire",
               electron_current, needs="tethers.wire_radius"),
    Observable("electric_power", "W", "P_el", (), "sum of V_i I_i", electric_power,
               needs="tethers.wire_radius"),
    Observable("heliocentric_position", "m", "R", XYZ, "Kepler orbit plus r_OB",
               lambda i: i.heliocentric[0], needs="orbit"),
    Observable("heliocentric_velocity", "m/s", "V", XYZ, "time derivative of R",
               lambda i: i.heliocentric[1], needs="orbit"),
    Observable("orbital_elements", "m, rad", "a, e, i, Omega, omega, nu", ("element",),
               "osculating Kepler elements of R and V", lambda i: orbital_elements(*i.heliocentric),
               needs="orbit"),
)  # fmt: skip

ON_REQUEST = (
    Observable("hub_acceleration_B", "m/s^2", "f^B", XYZ, "second derivative of r_OB, less free fall",
               hub_acceleration, needs="hub"),
    Observable("tip_direction_B", "-", "e_i", ("tether", "xyz"), "from the hub's centre to a remote unit",
               tip_directions),
    Observable("node_position_I", "m", "r_j", ("tether", "node", "xyz"), "[PGV] 4, nodes from root to tip",
               lambda i: i.from_origin(i.q.tether[0]).transpose(2, 1, 0)),
    Observable("flat_sail_thrust_O", "N", "F_flat", XYZ, "Huo et al. 2018, flat sail",
               reduced.flat_sail_thrust, needs="solar_wind"),
    Observable("flat_sail_thrust_moment_O", "N m", "M_flat", XYZ, "moment about the roots of a flat sail",
               reduced.flat_sail_moment, needs="solar_wind"),
    Observable("axisymmetric_thrust_O", "N", "F_axi", XYZ, "Bassetto et al. 2018, mean shape of the sail",
               reduced.shaped_sail_thrust, needs="solar_wind"),
    Observable("axisymmetric_thrust_moment_O", "N m", "M_axi", XYZ,
               "Bassetto et al. 2018, mean shape, about the roots", reduced.shaped_sail_moment,
               needs="solar_wind"),
)  # fmt: skip
"""Observables that are saved only where they are named: they are large, or are those of instruments or of
reduced models."""


def listed(system: System) -> list[Observable]:
    """The observables of a sail. Those that need a table or a key of the scene are left out without it."""
    return [entry for entry in OBSERVABLES if not entry.needs or entry.needs in system.parts]
