"""Tethers that are paid out: their Lagrangian, which tests differentiate, their losses, and laws."""

from esail_jax.elements.deployment import DeployedEnergy, density_of
from esail_jax.numerics.vectors import dot, total_of

FROM_REST = {
    "table": {"deployment.time": [0.0, 10.0], "deployment.rate": [0.0, 1.0]},
    "tension": {"deployment.law": "tension", "deployment.time": [0.0, 9.0],
                "deployment.tension": [0.1, 0.1], "deployment.drum_mass": 3.0},
}  # fmt: skip
"""Laws by which tethers that are at rest begin to be paid out."""


def lagrangian(reels, length, rate, q, v):
    """T - U [J] of every tether, with its remote unit and what is wound up, for given lengths and rates."""
    batch, each = reels.tethers, reels.tethers.repeat_per_element
    share = length / reels.payout.total
    fields, rates = batch.interpolate_motion(q, v)
    velocity = rates.r + each(rate / share) * reels.stretching.distance * fields.r_x
    density = 0.5 * reels.density * each(share) * dot(velocity, velocity)
    for energy in reels.energies:
        density = density - DeployedEnergy(energy, each(share)).density(fields)
    tip, root = (dot(v[0, :, k], v[0, :, k]) for k in (-1, 0))
    stored = density_of(batch) * (reels.payout.total - length)
    return reels.per_tether(density) + 0.5 * batch.tip_mass * tip + 0.5 * stored * root


def dissipation(now, q, v):
    """R [W] of all tethers of a system at an instant."""
    motion = now.reels.tethers.interpolate_motion(q, v)
    return now.integrate(total_of(term.density(*motion) for term in now.acting_dissipations))
