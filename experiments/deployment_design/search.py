"""Least duration within limits, by gradients of whole runs."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from sail import GOAL, KNOTS, MOST_THRUST, START, Schedule, simulate, violations
from scipy.optimize import minimize

import esail_jax as esail

SHARE = KNOTS / KNOTS[-1]
FAILED = 10.0
RESERVE = 0.01
"""Part of every limit that the searches keep in reserve, for what a coarse mesh and few instants miss."""


# ---- kinds of schedule: numbers z of order one to a schedule -------------------------------------


def schedule_of(duration, shape, forces):
    """Rates of a given shape that pay out the whole length in the duration."""
    paid = GOAL - START
    return Schedule(duration, paid * shape / jnp.trapezoid(shape, SHARE) / duration, forces)


def free(z):
    """A rate at every inner knot and a force at every knot but the last."""
    shape = jnp.concatenate([jnp.zeros(1), jnp.exp(z[1:16]), jnp.zeros(1)])
    forces = MOST_THRUST * jnp.concatenate([z[16:], jnp.zeros(1)])
    return schedule_of(1000.0 * jnp.exp(z[0]), shape, forces)


def window(end, rise):
    """1 while tethers are paid out; it rises from 0 at the start, and is 0 from `end` on."""
    return jnp.clip(jnp.minimum(SHARE, end - SHARE) / rise, 0.0, 1.0)


def steady_thrust(share, rise):
    """A part of the largest force; it rises at the start and falls at the end."""
    return MOST_THRUST * share * window(1.0, rise)


def constant_rate(z):
    log, end, share, rise = z
    return schedule_of(1000.0 * jnp.exp(log), window(end, rise), steady_thrust(share, rise))


def constant_tension(z):
    """With a steady thrust, the tension m (l + r) w^2 of light tethers is constant if the root of l grows
    linearly."""
    log, end, share, rise = z
    root = np.sqrt(START) + (np.sqrt(GOAL) - np.sqrt(START)) * jnp.clip(SHARE / end, 0.0, 1.0)
    return schedule_of(1000.0 * jnp.exp(log), root * window(end, rise), steady_thrust(share, rise))


LOGS, SHARES, RISES = (-1.0, 2.0), (0.0, 1.0), (0.0625, 0.35)
BOUNDS = {
    constant_rate: [LOGS, (0.3, 1.0), SHARES, RISES],
    constant_tension: [LOGS, (0.3, 1.0), SHARES, RISES],
    free: [LOGS] + 15 * [(-6.0, 3.0)] + 16 * [SHARES],
}


def freed(schedule):
    """The numbers of `free` for a schedule."""
    rates = np.log(np.maximum(np.asarray(schedule.rates)[1:-1], 0.1))
    forces = np.asarray(schedule.forces)[:-1] / MOST_THRUST
    return np.concatenate([[np.log(float(schedule.duration) / 1000.0)], rates, forces])


# ---- the search ----------------------------------------------------------------------------------


@esail.jit
def lagrangian(schedule, scales, multipliers, weight):
    """Duration [1000 s] and the augmented Lagrangian's terms of all limits: the sum over instants, the mean
    over members and tethers. Its derivative by the schedule, and the violations."""

    def term(c, m):
        instants = c.shape[1] if c.ndim > 1 else 1
        pushed = jnp.maximum(m + weight * (c + RESERVE), 0.0)
        return instants * (pushed**2 - m**2).mean() / (2.0 * weight)

    def value(schedule):
        exceeded = jax.vmap(lambda scale: violations(simulate(schedule, scale)))(scales)
        terms = jax.tree.map(term, exceeded, multipliers)
        return schedule.duration / 1000.0 + sum(jax.tree.leaves(terms)), exceeded

    return jax.value_and_grad(value, has_aux=True)(schedule)


@esail.jit
def exceeded_by(schedule, scales):
    return jax.vmap(lambda scale: violations(simulate(schedule, scale)))(scales)


DURATIONS = np.arange(1300.0, 3000.0, 100.0)


def scan(kind, members):
    """The numbers of the shortest of many schedules with four numbers that keep the limits, and the number
    of runs."""
    runs, as_schedule = 0, jax.jit(kind)
    for duration in DURATIONS:
        for rise in (0.0625, 0.125, 0.1875, 0.25):
            for end in (0.7, 0.85, 1.0):
                for share in (0.6, 0.8, 1.0):
                    z, runs = np.array([np.log(duration / 1000.0), end, share, rise]), runs + 1
                    if max(largest(exceeded_by(as_schedule(z), members)).values()) <= -RESERVE:
                        return z, runs
    raise RuntimeError("no schedule keeps the limits")


def largest(exceeded):
    """The largest violation of every limit."""
    return {name: float(np.max(x)) for name, x in exceeded.items()}


def search(kind, z, scales, rounds, iterations, weight=3.0, report=print):
    """The numbers z of the shortest schedule within the limits for all members: that of the rounds that
    keep them, or of the last round."""
    as_schedule = jax.jit(kind)
    backward = jax.jit(lambda z, slope: jax.vjp(kind, z)[1](slope)[0])
    shapes = jax.eval_shape(lambda s: exceeded_by(s, scales), as_schedule(z))
    multipliers = {name: np.zeros(x.shape) for name, x in shapes.items()}
    best, least = None, np.inf
    for k in range(rounds):
        failed = 0
        slopes = functools.partial(lagrangian, scales=scales, multipliers=multipliers, weight=weight)

        def cost(z, slopes=slopes):
            nonlocal failed
            (value, _), slope = slopes(as_schedule(z))
            slope = np.asarray(backward(z, slope))
            if not np.isfinite(value) or not np.isfinite(slope).all():
                failed += 1
                return FAILED, np.zeros_like(z)
            return float(value), slope

        options = {"maxiter": iterations, "maxls": 20}
        found = minimize(cost, z, jac=True, method="L-BFGS-B", bounds=BOUNDS[kind], options=options)
        z = found.x
        (_, exceeded), _ = slopes(as_schedule(z))
        multipliers = {
            name: np.maximum(multipliers[name] + weight * (np.asarray(c) + RESERVE), 0.0)
            for name, c in exceeded.items()
        }
        worst, duration = largest(exceeded), float(as_schedule(z).duration)
        if max(worst.values()) <= 0.0 and duration < least:
            best, least = z, duration
        report(
            f"round {k}: {duration:.1f} s, {found.nfev} runs ({failed} failed),",
            {name: round(x, 3) for name, x in worst.items() if x > -0.05},
            flush=True,
        )
        weight *= 1.7
    return z if best is None else best
