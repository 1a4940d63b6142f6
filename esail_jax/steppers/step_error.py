"""Estimate of the accumulated error of methods with fixed steps, from third differences of the run.

A method of second order oscillates too slowly: each step has the error c h^3 s''' of a signal s, where c
h^3 is the phase error of an oscillation at 1 rad/s (`FixedStep.phase_error`). Without damping the
magnitudes of these errors accumulate. For an oscillation A sin(omega t) the mean of their magnitude is 2/pi
of its amplitude c (h omega)^3 A; the factor pi/2 below corrects for that. In a tether under compression
errors also grow, like a buckling wave with the wave number 1/l over elements of length l,

    e_{n+1} = e_n exp(sigma h) + (pi/2) c |third difference of s|,    sigma = sqrt(max(-N, 0)/(rho A)) / l,

where N is the axial force, averaged over a block of steps: faster vibrations cause no buckling. Shorter
waves grow faster, until elements fold; the wave number was measured (`experiments/stability`).

The signals are the tips and the elastic force at the roots in the hub's axes. Errors are relative to the
range of the signal over the run so far. The estimate does not include errors that do not accumulate (that
of velocities is 0.17 h^2 d^2v/dt^2 at a spectral radius of 0.25), and chaos without compression."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Bool, Float, PerTether, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.vectors import dot, norm
from esail_jax.point_fields import PointFields
from esail_jax.system import System

Signal = Float[Array, "3 time tether"]

TENSION_STRIDE = 5
"""Number of steps between two evaluations of the axial forces: four in a block of 20 steps."""

GROWTH_CAP, ERROR_CAP = 200.0, 1e100
"""Largest exponent of growth over a block, and largest error: far beyond any range, but finite."""

LEAST_RANGE = 1e-4
"""A signal's range is taken to be at least this fraction of its magnitude. Otherwise a signal at rest would
be compared with rounding errors."""


class RunningError(NamedTuple):
    """Running estimate of a signal's error, and the signal's minimum and maximum so far."""

    error: PerTether
    low: Float[Array, "3 tether"]
    high: Float[Array, "3 tether"]

    def relative(self) -> Scalar:
        """The largest error of any tether over the largest range of any tether, at most 1."""
        size = jnp.maximum(jnp.abs(self.low), jnp.abs(self.high)).max()
        reach = jnp.maximum((self.high - self.low).max(), LEAST_RANGE * size)
        ratio = self.error.max() / jnp.where(reach > 0.0, reach, 1.0)
        return jnp.minimum(ratio, 1.0)


class StepErrors(NamedTuple):
    """Estimated errors of the tips [m] and of the elastic force at the roots [N].

    relative: both, relative to the ranges of the signals."""

    tip: RunningError
    force: RunningError
    relative: Float[Array, "2"]

    @classmethod
    def initial(cls, tethers: int) -> "StepErrors":
        """The estimates before the first step."""
        none, far = jnp.zeros(tethers), jnp.full((3, tethers), jnp.inf)
        first = RunningError(none, far, -far)
        return cls(first, first, jnp.zeros(2))


def updated(
    errors: StepErrors,
    system: System,
    time: Scalar,
    h: Scalar,
    start: Coordinates,
    ends: Coordinates,
    count: Array,
    phase_error: Scalar,
) -> StepErrors:
    """The estimates after a block of steps of length h [s] that begins at `time` [s].

    start, ends: q at the beginning of the block and after each step (first axis), of which `count` were
    taken; phase_error: c. Neighbouring blocks share no third difference: two differences fewer than steps
    remain, and their sum is scaled up accordingly."""
    given = (errors, system, time, h, start, ends, phase_error)
    errors, system, time, h, start, ends, phase_error = lax.stop_gradient(given)
    steps = len(jax.tree.leaves(ends)[0])
    number = jnp.arange(steps + 1)
    times = time + h * number
    growth = jnp.minimum(h * count * growth_rates(system, times[1:], ends, count), GROWTH_CAP)
    share = 0.5 * np.pi * phase_error * count / jnp.maximum(count - 2, 1)
    kept, counted = number <= count, jnp.arange(3, steps + 1) <= count

    def continued(before, signal):
        third = jnp.where(counted[:, None], norm(jnp.diff(signal, 3, axis=1)), 0.0)
        error = jnp.minimum(before.error * jnp.exp(growth) + share * third.sum(0), ERROR_CAP)
        return RunningError(
            error,
            jnp.minimum(before.low, within(kept, signal, jnp.inf).min(1)),
            jnp.maximum(before.high, within(kept, signal, -jnp.inf).max(1)),
        )

    def along(x):
        return jax.tree.map(
            lambda a, b: jnp.concatenate([x(a)[None], jax.vmap(x)(b)]), start.tether, ends.tether
        )

    tips = jnp.moveaxis(along(lambda nodal: nodal[0, :, -1]), 0, 1)
    slopes = along(lambda nodal: root_slopes(system, nodal))
    hubs = None if start.hub is None else jnp.concatenate([start.hub[None], ends.hub])
    tip = continued(errors.tip, tips)
    reels = None if start.reel is None else jnp.concatenate([start.reel[None], ends.reel])
    force = continued(errors.force, root_forces(system, times, slopes, hubs, reels))
    return StepErrors(tip, force, jnp.stack([tip.relative(), force.relative()]))


def within(kept: Bool[Array, " time"], signal: Signal, other: float) -> Signal:
    """The signal where `kept` is true, and the other value elsewhere."""
    return jnp.where(kept[:, None], signal, other)


def root_slopes(system: System, nodal: Float[Array, "coef 3 node tether"]) -> Float[Array, "3 tether"]:
    """r_x at the roots. A truss has the direction of its first element."""
    tethers = system.tethers
    if tethers.coefs == 2:
        return nodal[1, :, 0]
    return (nodal[0, :, 1] - nodal[0, :, 0]) / tethers.lengths[: tethers.count]


def root_forces(
    system: System,
    times: Float[Array, " time"],
    slopes: Float[Array, "time 3 tether"],
    hubs: Float[Array, "time 4 3"] | None,
    reels: Float[Array, "time tether"] | None,
) -> Signal:
    """The elastic force [N] on the section at the root, in the hub's axes; 0 if released. reels: deployed
    lengths [m] that are unknowns."""
    tethers = system.tethers
    axial = system.axial_energy(times, reels)
    axial = jax.tree.map(lambda x: x[..., : tethers.count] if x.ndim else x, axial)
    fields = PointFields(None, jnp.moveaxis(slopes, 0, 1))
    force = axial.point_forces(times[0], fields, fields).r_x
    released = None if system.roots is None else system.roots.releases.released
    if released is not None:
        force = jnp.where(released, 0.0, force)
    nowhere = jnp.zeros((tethers.coefs, 3, tethers.elements + 1, tethers.count))
    axes = jax.vmap(lambda time, hub: system.rotation(time, Coordinates(nowhere, hub)))(times, hubs)
    return (axes.transpose(1, 2, 0)[..., None] * force[:, None]).sum(0)


def growth_rates(
    system: System,
    times: Float[Array, " time"],
    ends: Coordinates,
    count: Array,
) -> Float[Array, " tether"]:
    """sigma [1/s] of each tether, the maximum over its elements, from the mean axial force of a
    block. ends: q after each step."""
    tethers, every = system.tethers, slice(TENSION_STRIDE - 1, None, TENSION_STRIDE)
    some = ends.tether[every]
    fields = tethers.interpolate(jnp.moveaxis(some, 0, 2))
    axial = system.axial_energy(times[every], None if ends.reel is None else ends.reel[every])
    force = axial.point_forces(jnp.zeros(()), fields, fields).r_x
    tension = jnp.tensordot(tethers.weights, dot(force, fields.r_x) / norm(fields.r_x), 1)
    # Only steps that were taken count; a block of less than TENSION_STRIDE steps counts as slack.
    taken = TENSION_STRIDE * (1 + jnp.arange(len(some))) <= count
    mean = jnp.where(taken[:, None], tension, 0.0).sum(0) / jnp.maximum(taken.sum(), 1)
    rate = jnp.sqrt(jnp.maximum(-mean, 0.0) / (tethers.masses * tethers.lengths))
    return tethers.of_tethers(rate).max(0)
