"""Steps of collocation that were taken, once more: as functions of the system and of their start, for
derivatives. Nothing is solved again, and the length of a step carries no derivative."""

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.dynamics.collocation import end_of_step, work_of_step
from esail_jax.dynamics.stage_solution import known_stages
from esail_jax.dynamics.stages import Point, factor, stage_powers
from esail_jax.dynamics.step_record import Record
from esail_jax.numerics.perturbed import known
from esail_jax.system import System


def taken_again(system: System, now: Point, records: Record) -> tuple[Point, Record]:
    """The steps of a block, as functions of the system and of what the first of them starts from: the end
    of the last, and the records, with that derivative. The steps' length carries none. Without work and
    powers, which nothing else depends on (`work_again`)."""
    h = records.h[0]
    lam = jax.tree.map(lambda x: x[0, 0], records.stages.lam)
    kept = lax.stop_gradient(factor(*lax.stop_gradient((system, now, h, lam))))

    @jax.checkpoint
    def step(now, record):
        # What was not taken may be infinite: times zero that is no zero.
        stages = jax.tree.map(lambda x: jnp.where(record.taken, x, 0.0), record.stages)
        # From where it was taken: nothing before a step needs to be done again for its derivative.
        now = known(record.start, now)
        unknowns = known_stages(system, now, h, stages, kept, record.info.iterations)
        q, v = end_of_step(system, now, h, unknowns, kept)
        end = now._replace(q=q, v=v, vdot=jax.tree.map(lambda x: x[-1], unknowns.vdot))
        return end, record._replace(start=now, stages=unknowns)

    def step_or_stay(now, record):
        now = now._replace(time=record.start.time)
        return lax.cond(record.taken, step, lambda now, record: (now, record), now, record)

    return lax.scan(step_or_stay, now, records)


def work_again(system: System, start: Point, records: Record) -> Record:
    """Records of `taken_again` in a row, with the powers and the work from those of `start` on."""

    @jax.checkpoint
    def powers(record):
        stages = jax.tree.map(lambda x: jnp.where(record.taken, x, 0.0), record.stages)
        return stage_powers(system, record.start, record.h, stages)

    def step(before, record):
        power = powers(record)
        work = jax.tree.map(jnp.add, before[0], work_of_step(record.h, before[1], power))
        return (work, jax.tree.map(lambda x: x[-1], power)), power

    def step_or_stay(before, record):
        none = jax.tree.map(jnp.zeros_like, record.power)
        after, power = lax.cond(record.taken, step, lambda *x: (x[0], none), before, record)
        start = record.start._replace(work=before[0], power=before[1])
        return after, record._replace(start=start, power=power)

    return lax.scan(step_or_stay, (start.work, start.power), records)[1]
