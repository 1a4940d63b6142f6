"""The tethers' forces with a transpose of their own, for derivatives in reverse mode."""

import dataclasses

import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Instants, Nodal
from esail_jax.numerics.vectors import dot
from esail_jax.system import Power, System, add_fields
from esail_jax.terms import PointFields, needs_command


class Transposable(System):
    """A system for derivatives in reverse with respect to the state and nothing else. Forces of tethers
    have a transpose of their own; the powers, which have none, are left out.

    At a point the forces' derivative is turned around by `Term.pull_back`, and on either side of that
    stand each other's transposes: `interpolate`, and `nodal_forces` with the weights of the points. The
    transpose that the compiler is given otherwise takes twice as long (106 for 217 us on the baseline)."""

    @classmethod
    def of(cls, system: System) -> "Transposable":
        """The same system."""
        return cls(**{field.name: getattr(system, field.name) for field in dataclasses.fields(system)})

    def tether_forces(self, time: Instants, q: Nodal, v: Nodal, inertial: Nodal) -> tuple[Nodal, Power]:
        commands = tuple(load.command if needs_command(load) else None for load in self.loads)
        none = jnp.zeros(q.shape[2:-2])
        return transposable_forces(self, commands, time, q, v, inertial), Power(none, none)


Commands = tuple[Array | None, ...]
"""For every load the command of its control law, one number per element; None for loads that need none."""


@jax.custom_vjp
def transposable_forces(
    system: System, commands: Commands, time: Instants, q: Nodal, v: Nodal, inertial: Nodal
) -> Nodal:
    """The tethers' forces. commands: those of the system's loads, which depend on the state."""
    return System.tether_forces(system, time, q, v, inertial)[0]


def _forces_and_fields(system, commands, time, q, v, inertial):
    fields, rates = (system.tethers.interpolate(x) for x in (q, v))
    forces = transposable_forces(system, commands, time, q, v, inertial)
    return forces, (system, commands, time, fields, rates)


def _forces_pulled_back(at, nodal):
    system, commands, *at = at
    w = system.tethers.interpolate(nodal)
    parts = [term.pull_back(*at, w) for term in (*system.inner_terms, *system.loads)]
    by_fields, by_rates = (add_fields(list(x)) for x in zip(*parts, strict=True))

    def by_command(load, command):
        def virtual_power(command):
            force = load.with_command(command).point_forces(*at)
            return system.integrate(dot(force.r, w.r)).sum()

        return None if command is None else jax.grad(virtual_power)(command)

    by_commands = tuple(by_command(*pair) for pair in zip(system.loads, commands, strict=True))
    by_q, by_v = (system.tethers.nodal_forces(x) if any_of(x) else None for x in (by_fields, by_rates))
    return None, by_commands, None, by_q, by_v, system.tethers.inertia(nodal)


transposable_forces.defvjp(_forces_and_fields, _forces_pulled_back)


def any_of(fields: PointFields) -> bool:
    """Tells whether any field is present."""
    return any(field is not None for field in fields)
