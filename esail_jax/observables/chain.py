"""Observables of a rod chain ([MW] Sec. 3)."""

from types import ModuleType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.elements.deployment import Deployed
from esail_jax.elements.hinges import Hinges
from esail_jax.loads.fields import UniformGravity
from esail_jax.numerics.vectors import dot, norm
from esail_jax.observables.entry import WORK, Observable, elastic_energy, kinetic_energy
from esail_jax.point_fields import add_fields
from esail_jax.rod_chain import does_work, linear_fields
from esail_jax.system import Power, System
from esail_jax.terms import find_term

MAX_BALANCE_ERROR = 0.1
"""A run is stopped if the error of its energy balance exceeds this fraction of its energy. Explicit steps
that are too long for the fastest vibration do not always overflow."""


class Instant(NamedTuple):
    """State of a chain at one saved instant."""

    system: System
    hinges: Hinges | None
    time: Scalar
    q: Coordinates
    v: Coordinates
    work: Power | None
    start_energy: Scalar


def tension(i: Instant) -> Float[Array, " rod"]:
    """The axial force of every rod [N], with its dissipative part; it is negative in
    compression."""
    tethers = i.system.tethers
    fields, rates = tethers.interpolate(i.q.tether), tethers.interpolate(i.v.tether)
    stress = add_fields([x.point_forces(i.time, fields, rates) for x in i.system.material_terms]).r_x
    force = dot(stress, fields.r_x) / norm(fields.r_x)
    return force[0]


def stored_energy(system: System, hinges: Hinges | None, q: Coordinates) -> Scalar:
    """The elastic energy U [J] of rods and hinges, of a system at an instant."""
    energy = elastic_energy(system, jnp.zeros(()), q)
    if hinges is not None:
        energy = energy + hinges.energy(jnp.diff(q.tether[0, :, :, 0], axis=1))
    return energy


def internal_energy(system: System, hinges: Hinges | None, q: Coordinates, v: Coordinates) -> Scalar:
    """The sum T + U [J] of kinetic and elastic energy."""
    return kinetic_energy(system, v, q) + stored_energy(system, hinges, q)


def potential_energy(i: Instant) -> Scalar:
    """The potential energy [J] of gravity and of the orbital field. It is zero at the origin, which
    is the anchor, or the reference point of a free chain."""
    system = i.system
    momenta = system.tethers.inertia(i.q.tether)  # M q, masses times positions
    energy = jnp.zeros(())
    gravity = find_term(system.fields, UniformGravity)
    if gravity is not None:
        energy = energy - gravity.vector @ momenta[0].sum((1, 2))
    for field in linear_fields(system):
        # The energy is quadratic in position: -q^T M A q / 2 with the gradient A of the field.
        gradient = field.matrices[0]
        energy = energy - 0.5 * (momenta[0] * jnp.tensordot(gradient, i.q.tether[0], 1)).sum()
    return energy


def balance(i: Instant) -> Scalar:
    """The error T + U - (T + U)_0 - W + D [J] of the energy balance; W is the work of loads and
    fields."""
    energy = internal_energy(i.system, i.hinges, i.q, i.v) - i.start_energy - i.work.external
    energy = energy + i.work.dissipated
    return energy if i.work.winch is None else energy - i.work.winch


def deployed(i: Instant) -> Deployed:
    """Length, rate and acceleration of what is paid out of a chain."""
    return jax.tree.map(lambda x: x[0], i.system.reels.now)


OBSERVABLES = (
    Observable("joint_position", "m", "r", ("joint", "xyz"), "[MW] 2", lambda i: i.q.tether[0, :, :, 0].T),
    Observable("tension", "N", "N", ("rod",), "[MW] 5, derived", tension),
    Observable("kinetic_energy", "J", "T", (), "[MW] 4", lambda i: kinetic_energy(i.system, i.v, i.q)),
    Observable("elastic_energy", "J", "U", (), "[MW] 6", lambda i: stored_energy(i.system, i.hinges, i.q)),
    Observable("potential_energy", "J", "V", (), "zero at the origin", potential_energy),
    Observable("external_work", "J", "W_ext", (), "integral of the power of loads and fields",
               lambda i: i.work.external, needs=WORK),
    Observable("dissipated_energy", "J", "E_d", (), "integral of 2 P_d",
               lambda i: i.work.dissipated, needs=WORK),
    Observable("deployed_length", "m", "l", (), "`[deployment]`", lambda i: deployed(i).length,
               needs="deployment"),
    Observable("payout_rate", "m/s", "l'", (), "`[deployment]`", lambda i: deployed(i).rate,
               needs="deployment"),
    Observable("winch_work", "J", "W_w", (), "integral of -l' F_w", lambda i: i.work.winch,
               needs="deployment"),
    Observable("energy_balance_error", "J", "dE - W + E_d", (), "energy theorem", balance, needs=WORK),
)  # fmt: skip

ENERGY_ERROR = Observable(
    "energy_error", "-", "e_E", (), "[MW] 31, over max(|E_0|, largest T)", lambda i: jnp.zeros(())
)
"""Relative energy error. It depends on earlier instants and is computed by `with_energy_error`."""


def listed(system: System) -> list[Observable]:
    """The observables of a chain; those of work only if anything does work, those of reels with these."""
    present = {"", *([WORK] if does_work(system) else []), *system.parts}
    return [*(entry for entry in OBSERVABLES if entry.needs in present), ENERGY_ERROR]


def observe(instant: Instant) -> dict[str, Array]:
    """All observables of an instant, by name; `energy_error` is 0, not yet computed."""
    return {entry.name: entry.function(instant) for entry in listed(instant.system)}


def with_energy_error(
    rows: dict[str, Any], memory: tuple[Any, Any], xp: ModuleType
) -> tuple[dict[str, Any], tuple[Any, Any]]:
    """Computes `energy_error` = (E - E_0) / max(|E_0|, largest kinetic energy so far) of consecutive rows.

    memory: E_0 (NaN before the first row) and the largest kinetic energy [J] of earlier rows
    xp: numpy or jax.numpy

    Returns the rows and the memory after them.
    """
    energy = rows["kinetic_energy"] + rows["elastic_energy"] + rows["potential_energy"]
    first = xp.where(xp.isnan(memory[0]), energy[0], memory[0])
    peak = xp.maximum.accumulate(xp.maximum(rows["kinetic_energy"], memory[1]))
    size = xp.maximum(abs(first), peak)
    error = xp.where(size > 0.0, (energy - first) / xp.where(size > 0.0, size, 1.0), 0.0)
    return rows | {"energy_error": error}, (first, peak[-1])


def balanced(rows: dict[str, Any], floor: Any, xp: ModuleType) -> Any:
    """Tells at which instants the energy balance holds to MAX_BALANCE_ERROR of the energy, as in every
    usable run. The result is false for NaN. floor: energy [J] that counts as zero (`energy_floor`)."""
    if "energy_balance_error" in rows:
        inner = rows["kinetic_energy"] + rows["elastic_energy"]
        size = xp.maximum(abs(rows["external_work"]), rows["dissipated_energy"])
        size = xp.maximum(size, abs(rows.get("winch_work", size)))
        size, error = xp.maximum(size, inner), rows["energy_balance_error"]
    else:
        energy = rows["kinetic_energy"] + rows["elastic_energy"] + rows["potential_energy"]
        small = abs(rows["energy_error"]) <= MAX_BALANCE_ERROR
        return small | (xp.isfinite(energy) & (rows["kinetic_energy"] + rows["elastic_energy"] <= floor))
    return abs(error) <= MAX_BALANCE_ERROR * size + floor
