"""Second derivatives of runs in which a load has kinks, whose instants move with the numbers.

The thrust per length of a tether has a kink where its voltage passes the cutoff voltage or a limit, and at
the rows of a table. At an instant t* the rate A' of this strength A jumps by J. First derivatives of the
motion are continuous there, and the steps, whose sizes carry no derivative, give them as they are. Their
rate jumps. If the numbers move the instant by d, the motion has the old form for the time d longer, and
lacks, for a fixed instant, the impulse

    w = integral of (A_before - A_after) dt = J d^2 / 2.

It is zero, and so is its first derivative, but its second one is not: J (dt*/dp)^2. The impulse changes the
velocities by w da/dA, where the acceleration a is linear in A. With a distance s that is zero at t* (the
voltage from a limit, say) it is J (ds/dp)^2 / (2 |s'|), for which t* need not be solved for.

Programs that compute no second derivative lack all of this (`numerics/vanishing.py`).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, PerTether, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.lockstep import cond_of_members
from esail_jax.numerics.symbolic_zeros import nothing_of
from esail_jax.numerics.vanishing import half_product, half_square, vanishing
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.steppers.knots import near
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power, System


class Nodes(NamedTuple):
    """Instants [s] of a step, its start and its end among them, and positions and velocities there (first
    axis)."""

    time: Float[Array, " node"]
    q: Coordinates
    v: Coordinates

    def at(self, index: int) -> "Moment":
        """The instant and the state of a node."""
        return jax.tree.map(lambda x: x[index], tuple(self))


class Passed(NamedTuple):
    """What kinks within a step add at a later instant: to positions, velocities, accelerations, work and
    power. All these values are zero."""

    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    work: Power
    power: Power


class Impulses(NamedTuple):
    """Impulses per length [N s/m] of the tethers for several kinks, and their instants [s], counted from
    the start of the step."""

    size: Float[Array, "kink tether"]
    after: Float[Array, "kink tether"]


Moment = tuple[Scalar, Coordinates, Coordinates]
"""An instant [s] of a step, and positions and velocities there."""


def passed_like(system: System, nodes: Nodes, until: Moment) -> Passed:
    """Numbers in the form of the result of `kinks_passed`."""
    time, q, v = until
    power = jax.tree.map(lambda _: time, system.no_power)
    return Passed(q, v, v, power, power)


@vanishing(passed_like)
def kinks_passed(system: System, nodes: Nodes, until: Moment) -> Passed:
    """What kinks between the start of a step and an instant of it add there."""
    still = lax.stop_gradient((system, nodes))
    there = jnp.stack([x.any() for x in (*knots_within(*still), *margins_passed(*still))]).any()
    nothing = nothing_of(passed_like(system, nodes, until))
    return cond_of_members(there, changes, lambda *_: nothing, system, nodes, until)


def changes(system: System, nodes: Nodes, until: Moment) -> Passed:
    """What the kinks add. An impulse acts at the start of the step and at the instant, in the ratio
    that preserves its first moment, and moves the latter by the time in between: both right to second order
    of the step."""
    impulses = [add(at_knots(system, nodes, i), at_margins(system, nodes, i)) for i in kinked(system)]
    time, *end = until
    span = time - nodes.time[0]
    length = jnp.where(span > 0.0, span, 1.0)

    def three(x):
        size = jnp.where(x.after <= span + 4.0 * near(time), x.size, 0.0)
        weights = 1.0 - x.after / length, x.after / length, span - x.after
        return jnp.stack([(size * weight).sum(0) for weight in weights])

    states = jax.tree.map(lambda x, y: jnp.stack([x, y, y]), nodes.at(0), until)
    weighted = tuple(three(x) for x in impulses)
    moved, works = lax.map(lambda row: response(system, *row), (*states, weighted))
    v, work = jax.tree.map(lambda x: x[0] + x[1], (moved, works))
    moved = jax.tree.map(lambda x: x[2], moved)

    def motion(q, v):
        motion = consistent_motion(system, time, q, v)
        return motion.vdot, motion.power

    vdot, power = jax.jvp(motion, tuple(end), (moved, v))[1]
    return Passed(moved, v, vdot, work, power)


def kinked(system: System) -> list[int]:
    """The places of the loads that have kinks."""
    return [i for i, load in enumerate(system.loads) if load.has_kinks]


def add(*parts: Impulses) -> Impulses:
    """All impulses together."""
    return Impulses(*(jnp.concatenate(x) for x in zip(*parts, strict=True)))


def response(
    system: System, time: Scalar, q: Coordinates, v: Coordinates, impulses: tuple[PerTether, ...]
) -> tuple[Coordinates, Power]:
    """The change of the velocities, and the work, of impulses [N s/m] of the kinked loads. Nothing
    else acts in no time."""
    system = eqx.tree_at(lambda x: (x.energies, x.dissipations), system, ((), ()))

    def motion(added):
        stronger = system.with_added_strength(dict(zip(kinked(system), added, strict=True)))
        motion = consistent_motion(stronger, time, q, v)
        return motion.vdot, motion.power

    return jax.jvp(motion, (jax.tree.map(jnp.zeros_like, impulses),), (impulses,))[1]


# ---- kinks at known instants ---------------------------------------------------------------------------


def knots_within(system: System, nodes: Nodes) -> tuple[Array, ...]:
    """Which knots of the system lie in the step, whose ends are shifted behind knots there: all in
    increasing order, and equal ones once."""
    return () if (ordered := ordered_knots(system, nodes)) is None else (ordered[1],)


def ordered_knots(system: System, nodes: Nodes) -> tuple[Array, Array] | None:
    """The knots [s] in increasing order, and which of them count; None for a system without."""
    foreseen = system.knots(*nodes.at(0))
    if foreseen is None:
        return None
    knots = jnp.sort(lax.stop_gradient(foreseen))
    begin, end = (t + 4.0 * near(t) for t in (nodes.time[0], nodes.time[-1]))
    another = jnp.append(True, jnp.diff(knots) > 4.0 * near(knots[1:]))
    return knots, (knots > begin) & (knots <= end) & another


def at_knots(system: System, nodes: Nodes, index: int) -> Impulses:
    """The impulses at knots. Just before and just behind one, the strength A has the same value,
    but not the same derivative: D = A_before - A_behind is J times the change of the knot, so that
    w = D^2/(2 J), for every tether its own. A knot of the law and one of the wind may lie at the same
    instant and move apart: each of the two is held while the other one passes."""
    load, (time, q, v) = system.loads[index], nodes.at(-1)
    if (ordered := ordered_knots(system, nodes)) is None:
        return Impulses(*(jnp.zeros((0, system.tethers.count)),) * 2)
    knots, inside = ordered

    def strength(of_law, of_wind):
        measured = system.measurements(of_law, q, v) if system.controlled else None
        return load.strength(of_wind, measured)

    def passed(strength, knot):
        sides = [knot - 2.0 * near(knot), knot + 2.0 * near(knot)]
        (before, rate), (behind, later) = (
            jax.jvp(strength, (side,), (jnp.ones_like(side),)) for side in sides
        )
        return half_square(before - behind, lax.stop_gradient(later - rate))

    def of(knot):
        by_law = passed(lambda time: strength(time, knot), knot)
        return by_law + passed(lambda time: strength(knot, time), knot)

    safe = jnp.where(inside, knots, time)
    size = jnp.where(inside[:, None], jax.vmap(of)(safe), 0.0)
    after = jnp.clip(safe - nodes.time[0], 0.0, nodes.time[-1] - nodes.time[0])
    return Impulses(size, jnp.broadcast_to(after[:, None], size.shape))


# ---- kinks at a level of the voltage -------------------------------------------------------------------


def margins_of(system: System, nodes: Nodes, index: int) -> tuple[Array, Array]:
    """The distances from the kinks of a load at every node, and the jumps of the strength's
    derivative with respect to them: (node, kink, tether)."""

    def of(time, q, v):
        measured = system.measurements(time, q, v) if system.controlled else None
        return system.loads[index].kinks(time, measured)

    return jax.vmap(of)(*nodes)


def margins_passed(system: System, nodes: Nodes) -> list[Array]:
    """For every kinked load between which nodes which kinks are passed."""
    return [changes_of_sign(margins_of(system, nodes, i)[0]) for i in kinked(system)]


def changes_of_sign(margin: Float[Array, "node kink tether"]) -> Array:
    """Between which nodes the sign changes."""
    return (margin[1:] > 0.0) != (margin[:-1] > 0.0)


def at_margins(system: System, nodes: Nodes, index: int) -> Impulses:
    """The impulses at the kinks that are passed between two nodes, where the distance s and its
    derivatives are interpolated linearly: w = J s^2/(2 |s'|), with s = 0."""
    margin, jump = margins_of(system, nodes, index)
    hit = changes_of_sign(margin)
    length = jnp.diff(nodes.time)[:, None, None]
    before, change = margin[:-1], jnp.where(hit, jnp.diff(margin, axis=0), 1.0)
    part = lax.stop_gradient(jnp.where(hit, -before / change, 0.0))
    distance = (1.0 - part) * before + part * margin[1:]
    jump = jnp.where(hit, (1.0 - part) * jump[:-1] + part * jump[1:], 1.0)
    stiffness = lax.stop_gradient(jnp.abs(change) / (length * jump))
    size = jnp.where(hit, half_square(distance, stiffness), 0.0)
    after = (nodes.time[:-1] - nodes.time[0])[:, None, None] + part * length
    return Impulses(*(x.reshape(-1, x.shape[-1]) for x in (size, after)))


# ---- kinks between two segments of a run ---------------------------------------------------------------


@vanishing(lambda before, behind, point, instant: (point.v, point.work))
def between_segments(
    before: System, behind: System, point: Point, instant: Scalar
) -> tuple[Coordinates, Power]:
    """What a kink of the forces between two segments of a run adds to the velocities and to the
    work. instant [s]: the end of the first segment, with its derivative.

    The change of the velocities is d (a_before - a_behind)/2, whose factors vanish, and likewise that of
    the work."""
    first, later = (consistent_motion(x, point.time, point.q, point.v) for x in (before, behind))
    moved = instant - lax.stop_gradient(instant)

    def added(one, other):
        return half_product(moved, one - other)

    return jax.tree.map(added, (first.vdot, first.power), (later.vdot, later.power))
