"""Thrust and moment of a sail by the closed formulas of mission analysis.

Mission analysts replace the tethers by rigid ones, of an equal voltage and evenly spread over the azimuths.
The formulas are those of a flat sail (Huo, Mengali & Quarta, J. Guid. Control Dyn. 41 (2018) 734) and of a
sail of given shape whose tethers lie in planes through the spin axis (Bassetto, Mengali & Quarta, Acta
Astronaut. 146 (2018) 134). A run reports them on request (`save=`), so that their errors are known.
"""

from typing import NamedTuple

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, PerTether, Vector, VectorPerPoint
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.numerics.vectors import dot
from esail_jax.observables.instant import Instant
from esail_jax.terms import find_term

REDUCED = ("flat_sail_thrust_O", "flat_sail_thrust_moment_O", "axisymmetric_thrust_O",
           "axisymmetric_thrust_moment_O")  # fmt: skip
"""Names of the observables of this module."""


class Profile(NamedTuple):
    """Tethers in planes through the spin axis, at points (point, element) along them.

    axial, radial: components of the unit tangent along the spin axis n and away from it. height, distance:
    coordinates [m] from the root along the same axes. push: sigma/u dx [N s/m], thrust per wind speed that
    belongs to a point.
    """

    axial: Float[Array, "point element"]
    radial: Float[Array, "point element"]
    height: Float[Array, "point element"]
    distance: Float[Array, "point element"]
    push: Float[Array, "point element"]


def flat_thrust(push: PerTether, wind: Vector, normal: Vector) -> Vector:
    """The thrust [N] of a flat sail, F = (1/2) sum_i (sigma_i L_i / u) [u + (u . n) n] (Huo et al. 2018).

    push: sigma_i L_i / u [N s/m]. wind: u [m/s]. normal: n, unit normal of the sail's plane."""
    return 0.5 * push.sum() * (wind + (wind @ normal) * normal)


def flat_moment(
    push: PerTether, length: PerTether, wind: Vector, radial: Float[Array, "3 tether"]
) -> Vector:
    """The moment [N m] of the thrust of a flat sail about its roots, M = sum_i (sigma_i L_i^2 / 2u) e_i x
    u: zero for equal tethers of equal voltage.

    radial: e_i, unit vectors along the tethers. The other arguments are those of `flat_thrust`, length:
    L_i [m]."""
    return (jnp.cross(radial, wind[:, None], axis=0) * (0.5 * push * length)).sum(1)


def axisymmetric_thrust(shape: Profile, wind: Vector, normal: Vector) -> Vector:
    """The thrust [N] of a sail of given shape (Bassetto et al. 2018).

    The mean over the azimuth of u - (u . t) t, with the tangent t = c e_r + s n, gives

    F = int (sigma/u) [(1 - c^2/2) u + (c^2/2 - s^2) (u . n) n] dx"""
    half = 0.5 * shape.radial**2
    along = (shape.push * (1.0 - half)).sum()
    axial = (shape.push * (half - shape.axial**2)).sum()
    return along * wind + axial * (wind @ normal) * normal


def axisymmetric_moment(shape: Profile, wind: Vector, normal: Vector) -> Vector:
    """The moment [N m] of the thrust of a sail of given shape about its roots (Bassetto et al. 2018).

    With points rho e_r + z n from the root, the mean over the azimuth of r x (u - (u . t) t) gives

    M = int (sigma/u) [z - c (z c - rho s)/2] dx  n x u"""
    lever = shape.height - 0.5 * shape.radial * (shape.height * shape.radial - shape.distance * shape.axial)
    return (shape.push * lever).sum() * jnp.cross(normal, wind)


class Reduced(NamedTuple):
    """What the formulas read of an instant. push: sigma_i / u [N s/m^2] of every tether; wind: u at the hub
    [m/s]; normal: X_B; radial: directions from the spin axis through the roots."""

    push: PerTether
    wind: Vector
    normal: Vector
    radial: Float[Array, "3 tether"]


def reduced(i: Instant) -> Reduced:
    """What the formulas read of an instant of a sail in the wind."""
    load, measured = find_term(i.system.loads, CoulombThrust), i.measured
    wind = load.wind.at_sail(i.time, measured.position)
    push = wind.thrust_per_speed(load.commanded(measured))
    return Reduced(push, wind.velocity(i.centre), measured.spin_axis, measured.radial_directions)


def lengths(i: Instant) -> PerTether:
    """Undeformed lengths L_i [m]."""
    return i.system.tethers.of_tethers(i.system.tethers.lengths).sum(0)


def profile(i: Instant, given: Reduced) -> Profile:
    """The tethers of an instant, each turned about the spin axis into a plane through it: the azimuthal
    part of the tangents does not count."""
    tethers, normal = i.system.tethers, given.normal
    fields = tethers.interpolate(i.q.tether)
    roots = tethers.repeat_per_element(i.roots)
    arms, e = fields.r - roots[:, None], tethers.repeat_per_element(given.radial)

    def split(vectors: VectorPerPoint) -> tuple[Array, Array]:
        axial = jnp.tensordot(normal, vectors, 1)
        across = vectors - normal[:, None, None] * axial
        return axial, across

    height, out = split(arms)
    distance = jnp.sqrt(dot(out, out))
    axial, across = split(fields.r_x)
    # Near the root the direction of a point is not defined by its position: that of the root is as good.
    direction = jnp.where(distance > 1e-6, out / jnp.maximum(distance, 1e-6), e[:, None])
    radial = dot(across, direction)
    size = jnp.sqrt(axial**2 + radial**2)
    push = jnp.asarray(tethers.weights)[:, None] * tethers.lengths * tethers.repeat_per_element(given.push)
    return Profile(axial / size, radial / size, height, distance, push)


def flat_sail_thrust(i: Instant) -> Vector:
    """Thrust [N] by the flat-sail formula, in O."""
    g = reduced(i)
    return i.orbital.T @ flat_thrust(g.push * lengths(i), g.wind, g.normal)


def flat_sail_moment(i: Instant) -> Vector:
    """Moment [N m] of the flat sail's thrust about its roots, in O."""
    g, length = reduced(i), lengths(i)
    return i.orbital.T @ flat_moment(g.push * length, length, g.wind, g.radial)


def shaped_sail_thrust(i: Instant) -> Vector:
    """Thrust [N] by the formula for the sail's own mean shape, in O."""
    g = reduced(i)
    return i.orbital.T @ axisymmetric_thrust(profile(i, g), g.wind, g.normal)


def shaped_sail_moment(i: Instant) -> Vector:
    """Moment [N m] about the roots by the formula for the sail's own mean shape, in O."""
    g = reduced(i)
    return i.orbital.T @ axisymmetric_moment(profile(i, g), g.wind, g.normal)
