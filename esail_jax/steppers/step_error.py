"""How far fixed steps leave the truth: estimated from the run's own differences.

A method of second order oscillates too slowly: each step leaves c h^3 s''' of a signal s undone, c h^3
being the phase lost by an oscillation of 1 rad/s (`FixedStep.phase_error`). Undamped, these errors add up
as their magnitudes do; of an oscillation of amplitude A at omega their sum is that of the mean of |sin|,
2/pi of c (h omega)^3 A a step, which is put right. Where a tether is under pressure errors also grow, as a
buckling wave of wave number 1/l does over elements of length l,

    e_{n+1} = e_n exp(sigma h) + (pi/2) c |third difference of s|,    sigma = sqrt(max(-N, 0)/(rho A)) / l,

N the axial force, its mean over `KEEP` steps: what vibrates faster neither buckles nor grows. Shorter waves
grow faster, until elements fold; the wave number is measured (`experiments/stability`).

The signals are the tips and the elastic force at the roots in the hub's axes. Errors are given in parts of
the range over the run so far. What the estimate does not see: an error that stays as it is (of velocities,
0.17 h^2 d^2v/dt^2 at a spectral radius of 0.25), and chaos without pressure.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Bool, Float, PerTether, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AbstractAxialEnergy
from esail_jax.numerics.vectors import dot, norm
from esail_jax.steppers.fixed_step import KEEP
from esail_jax.system import System
from esail_jax.terms import PointFields, find_term

Signal = Float[Array, "3 time tether"]

EVERY = 5
"""Steps from one look at the axial forces to the next; of each `KEEP` steps there are four."""

MOST_GROWTH, MOST = 200.0, 1e100
"""Largest exponent of growth over an entry, and largest error kept: far beyond any range, but finite."""

AT_LEAST = 1e-4
"""Of its size is what a signal is said to range over: at rest only rounding would be left to compare."""


class Course(NamedTuple):
    """Of a signal: what its error may have come to, its least and its greatest values so far."""

    error: PerTether
    low: Float[Array, "3 tether"]
    high: Float[Array, "3 tether"]

    def relative(self) -> Scalar:
        """Largest error of a tether over the largest range of any, 1 at most."""
        size = jnp.maximum(jnp.abs(self.low), jnp.abs(self.high)).max()
        reach = jnp.maximum((self.high - self.low).max(), AT_LEAST * size)
        ratio = self.error.max() / jnp.where(reach > 0.0, reach, 1.0)
        return jnp.minimum(ratio, 1.0)


class StepErrors(NamedTuple):
    """Of the tips [m], and of the elastic force at the roots [N]; parts: both in parts of their ranges."""

    tip: Course
    force: Course
    parts: Float[Array, "2"]


def no_errors(tethers: int) -> StepErrors:
    """Before the first step."""
    none, far = jnp.zeros(tethers), jnp.full((3, tethers), jnp.inf)
    return StepErrors(*[Course(none, far, -far)] * 2, jnp.zeros(2))


def after_steps(
    errors: StepErrors,
    system: System,
    times: Float[Array, " time"],
    q: Coordinates,
    take: Array,
    phase_error: Scalar,
) -> StepErrors:
    """After the steps of an entry, of which `take` count: times [s] and q before the first and after
    each; phase_error: c."""
    errors, system, times, q, phase_error = lax.stop_gradient((errors, system, times, q, phase_error))
    steps = len(times) - 1
    growth = (times[1] - times[0]) * KEEP * growth_rates(system, q.tether)
    growth = jnp.where(jnp.arange(0, steps, KEEP)[:, None] < take, growth, 0.0)
    grown = jnp.minimum(jnp.cumsum(growth, 0), MOST_GROWTH)
    # Two differences fewer than steps, and none across what begins afresh.
    share = 0.5 * np.pi * phase_error * take / jnp.maximum(take - 2, 1)
    kept, counted = jnp.arange(steps + 1) <= take, jnp.arange(3, steps + 1) <= take

    def followed(course, signal):
        third = jnp.where(counted[:, None], norm(jnp.diff(signal, 3, axis=1)), 0.0)
        sums = jnp.pad(third, ((2, 0), (0, 0))).reshape(-1, KEEP, third.shape[-1]).sum(1)
        local = share * (jnp.exp(grown[-1] - grown) * sums).sum(0)
        error = jnp.minimum(course.error * jnp.exp(grown[-1]) + local, MOST)
        return Course(
            error,
            jnp.minimum(course.low, within(kept, signal, jnp.inf).min(1)),
            jnp.maximum(course.high, within(kept, signal, -jnp.inf).max(1)),
        )

    tips = jnp.moveaxis(q.tether[:, 0, :, -1], 0, 1)
    tip, force = followed(errors.tip, tips), followed(errors.force, root_forces(system, times, q))
    return StepErrors(tip, force, jnp.stack([tip.relative(), force.relative()]))


def within(kept: Bool[Array, " time"], signal: Signal, other: float) -> Signal:
    """The signal at the instants that are kept."""
    return jnp.where(kept[:, None], signal, other)


def root_forces(system: System, times: Float[Array, " time"], q: Coordinates) -> Signal:
    """Elastic force [N] on the section at the root, in the hub's axes; 0 of a released tether, which then
    pulls at nothing."""
    tethers = system.tethers
    axial = find_term(system.energies, AbstractAxialEnergy)
    axial = jax.tree.map(lambda x: x[: tethers.count] if x.ndim else x, axial)
    if tethers.coefs == 2:
        slope = q.tether[:, 1, :, 0]
    else:
        slope = (q.tether[:, 0, :, 1] - q.tether[:, 0, :, 0]) / tethers.lengths[: tethers.count]
    fields = PointFields(None, jnp.moveaxis(slope, 0, 1))
    force = axial.point_forces(times[0], fields, fields).r_x
    released = None if system.roots is None else system.roots.releases.released
    if released is not None:
        force = jnp.where(released, 0.0, force)
    axes = jax.vmap(system.rotation)(times, q)
    return (axes.transpose(1, 2, 0)[..., None] * force[:, None]).sum(0)


def growth_rates(
    system: System, nodal: Float[Array, "time coef 3 node tether"]
) -> Float[Array, "block tether"]:
    """sigma [1/s] of each tether, its largest of any element, in every `KEEP` steps."""
    tethers, axial = system.tethers, find_term(system.energies, AbstractAxialEnergy)
    fields = tethers.interpolate(jnp.moveaxis(nodal[EVERY::EVERY], 0, 2))
    force = axial.point_forces(jnp.zeros(()), fields, fields).r_x
    tension = jnp.tensordot(tethers.weights, dot(force, fields.r_x) / norm(fields.r_x), 1)
    tension = tension.reshape(-1, KEEP // EVERY, *tension.shape[1:]).mean(1)
    pressure = jnp.maximum(-tension, 0.0)
    rate = jnp.sqrt(pressure / (tethers.masses * tethers.lengths))
    return tethers.of_tethers(rate).max(1)
