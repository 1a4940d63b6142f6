"""The tethers' forces with a hand-written transpose, for derivatives in reverse mode."""

import dataclasses

import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Instants, Nodal
from esail_jax.numerics.vectors import dot
from esail_jax.point_fields import PointFields, add_fields
from esail_jax.system import Power, System
from esail_jax.terms import needs_command


class Transposable(System):
    """A system whose residual is differentiated in reverse mode, with respect to the state only.

    The derivative of the tethers' forces has a hand-written transpose. At a point, `Term.pull_back`
    transposes the derivative of the forces. On either side of it stand `interpolate` and, with the weights
    of the points, `nodal_forces`, which are transposes of each other. The transpose that JAX derives takes
    twice as long (217 instead of 106 us on the baseline). Powers have no such rule: they are zero here.
    """

    @classmethod
    def of(cls, system: System) -> System:
        """The same system, with the hand-written transpose. Lengths that are unknowns are part of the
        state: with them the whole system would depend on it, and JAX transposes the forces."""
        if system.has_unknown_lengths:
            return system
        return cls(**{field.name: getattr(system, field.name) for field in dataclasses.fields(system)})

    def tether_forces(self, time: Instants, q: Nodal, v: Nodal, inertial: Nodal) -> tuple[Nodal, Power]:
        commands = tuple(load.command if needs_command(load) else None for load in self.loads)
        none = jnp.zeros(q.shape[2:-2])
        return transposable_forces(self, commands, time, q, v, inertial), Power(
            none, none, None if self.payout is None else none
        )


Commands = tuple[Array | None, ...]
"""For every load the command of its control law, one number per element; None for loads that need none."""


@jax.custom_vjp
def transposable_forces(
    system: System, commands: Commands, time: Instants, q: Nodal, v: Nodal, inertial: Nodal
) -> Nodal:
    """The tethers' forces. commands: those of the system's loads; they depend on the state and are
    therefore an argument of their own."""
    return System.tether_forces(system, time, q, v, inertial)[0]


def _forces_and_fields(system, commands, time, q, v, inertial):
    fields, rates = (system.tethers.interpolate(x) for x in (q, v))
    forces = transposable_forces(system, commands, time, q, v, inertial)
    return forces, (system, commands, time, fields, rates)


def _forces_pulled_back(at, nodal):
    system, commands, *at = at
    w = system.tethers.interpolate(nodal)
    loads = system.acting_loads
    parts = [term.pull_back(*at, w) for term in (*system.inner_terms, *loads)]
    by_fields, by_rates = (add_fields(list(x)) for x in zip(*parts, strict=True))

    def by_command(load, command):
        def virtual_power(command):
            force = load.with_command(command).point_forces(*at)
            return system.integrate(dot(force.r, w.r)).sum()

        return None if command is None else jax.grad(virtual_power)(command)

    by_commands = tuple(by_command(*pair) for pair in zip(loads, commands, strict=True))
    by_q, by_v = (system.tethers.nodal_forces(x) if any_of(x) else None for x in (by_fields, by_rates))
    return None, by_commands, None, by_q, by_v, system.tethers.inertia(nodal)


transposable_forces.defvjp(_forces_and_fields, _forces_pulled_back)


def any_of(fields: PointFields) -> bool:
    """Tells whether any field is present."""
    return any(field is not None for field in fields)
